"""How fast a CyberGlove sends: the period it is told, and the period below which it cannot go.

The period is two 16-bit words; their product counts ticks of 1/115200 s, whatever the baud rate; 0 is "as fast as you
can". How fast that is, one driver quotes from the vendor's SerialCommands document: a record is digitised sensor by
sensor, then sent. A single source: the driver warns by it and refuses nothing.
"""

from math import ceil, isfinite

from .cyberglove_frame import OVERHEAD
from .errors import SettingError

TICKS_HZ = 115_200
BITS_A_BYTE = 10
DIGITISED_US = 250.0
FILTERED_US = 125.6
_WORD = 0xFFFF

Words = tuple[int, int]
FASTEST: Words = (0, 0)


def period_words(rate_hz: float | None) -> Words:
    """Return the two words that ask for the rate nearest to `rate_hz`; without one, for the fastest.

    Raises SettingError if no glove can be told such a rate.
    """
    if rate_hz is None:
        return FASTEST
    if not isfinite(rate_hz) or rate_hz <= 0.0 or TICKS_HZ / rate_hz > _WORD * _WORD:
        raise SettingError(f"a CyberGlove cannot send {rate_hz:g} records a second: ask for 1 to 160")
    ticks = max(1, round(TICKS_HZ / rate_hz))
    times = ceil(ticks / _WORD)
    return round(ticks / times), times


def told_us(words: Words) -> float:
    """Return the period in microseconds that the words tell; 0 for the fastest."""
    return words[0] * words[1] * 1e6 / TICKS_HZ


def digitising_us(sensors: int, filtered: bool = False) -> float:
    """Return how long the box takes to digitise so many sensors, through its digital filter or not."""
    return sensors * (DIGITISED_US + FILTERED_US * filtered)


def shortest_us(sensors: int, baud: int, *, status: bool = False, filtered: bool = False) -> float:
    """Return the shortest period in microseconds that the line and the box allow."""
    return digitising_us(sensors, filtered) + sending_us(sensors + OVERHEAD + status, baud)


def sending_us(size: int, baud: int) -> float:
    """Return how long `size` bytes take on the line, in microseconds: 8 data bits, a start bit, a stop bit."""
    return size * BITS_A_BYTE * 1e6 / baud

"""How a UART of an AVR comes to a baud rate: a divider of the processor's clock, times 16 or 8 (U2X)."""

from dataclasses import dataclass

_DIVIDERS = 4096
_USUAL = (9600, 19_200, 38_400, 57_600, 76_800, 115_200, 230_400, 250_000, 500_000, 1_000_000, 2_000_000)
_EXACT = 0.005


@dataclass(frozen=True, slots=True)
class BaudSetting:
    """What to write to UBRRn, whether to set U2Xn, and by how much the rate is then off, as a share."""

    ubrr: int
    double: bool
    error: float


def best_setting(baud: int, clock_hz: int) -> BaudSetting | None:
    """Return the setting nearest to `baud`, None if there is none.

    Of equally near ones it is the one without U2X, whose receiver samples twice as often and forgives more.
    """
    found = [setting for double in (False, True) if (setting := _setting(baud, clock_hz, double))]
    return min(found, key=lambda setting: (abs(setting.error), setting.double), default=None)


def near_rates(baud: int, clock_hz: int) -> tuple[int, ...]:
    """Return the usual rates that are made within half a percent, the four nearest to `baud` in rising order."""
    good = [rate for rate in _USUAL if (best := best_setting(rate, clock_hz)) and abs(best.error) < _EXACT]
    return tuple(sorted(sorted(good, key=lambda rate: abs(rate - baud))[:4]))


def _setting(baud: int, clock_hz: int, double: bool) -> BaudSetting | None:
    step = 8 if double else 16
    ubrr = max(round(clock_hz / (step * baud)) - 1, 0)
    return BaudSetting(ubrr, double, clock_hz / (step * (ubrr + 1)) / baud - 1.0) if ubrr < _DIVIDERS else None

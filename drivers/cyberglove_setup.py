"""From an open line to a CyberGlove that is known and set up: what it has, what it was told, what is odd about it."""

from collections.abc import Sequence
from dataclasses import dataclass
from time import monotonic

from .cyberglove_commands import INFORMATION, POLL, READY, Command, query, setting
from .cyberglove_dialogue import Dialogue
from .cyberglove_sensors import SENSORS_18, SENSORS_22, masked_sensors
from .cyberglove_timing import FASTEST, Words, sending_us, shortest_us, told_us
from .errors import DeviceError, SettingError
from .serial_line import SerialLine

# The rates that the box can be set to without a change inside it, the usual first.
BAUD_RATES = (115_200, 38_400, 19_200, 9_600)

# After it is switched on, a box says for a while that it is not ready.
_READY_S = 1.0
_NAMES = {18: SENSORS_18, 22: SENSORS_22}


@dataclass(frozen=True, slots=True)
class Wanted:
    """How a glove shall send.

    words    the period (`cyberglove_timing.period_words`)
    poll     whether it shall be asked for each record, so that the host keeps the period
    sensors  how many it must have; None: as many as it says
    status   whether records shall carry the status byte
    """

    words: Words
    poll: bool
    sensors: int | None
    status: bool


@dataclass(frozen=True, slots=True)
class GloveInfo:
    """What was found at the end of the line.

    baud        its rate
    sensors     how many bytes of sensors a record has, 18 or 22
    names       what they measure, in wire order
    mask        the software mask, 3 bytes, the lowest bit of the first one first; empty where the box does not tell
    right_hand  for which hand it is; None where the box does not tell
    text        the box's information text
    status      whether records carry the status byte
    period_us   from one record to the next: as wanted, or the shortest that box and line should manage
    notes       what is odd, in sentences for the user
    """

    baud: int
    sensors: int
    names: tuple[str, ...]
    mask: bytes
    right_hand: bool | None
    text: str
    status: bool
    period_us: int
    notes: tuple[str, ...] = ()


def find_line(url: str, rates: Sequence[int]) -> SerialLine:
    """Return an open line to a box that answers, at the first of `rates` at which it does. Raises DeviceError else."""
    for baud in rates:
        line = SerialLine(url, baud)
        try:
            dialogue = Dialogue(line)
            dialogue.hush()
            dialogue.ask(query("G"))
        except DeviceError as reason:
            line.close()
            if len(rates) == 1:
                raise
            failure = reason
        except BaseException:
            line.close()
            raise
        else:
            return line
    tried = ", ".join(map(str, rates))
    raise DeviceError(f"{url}: no CyberGlove answers at {tried} baud: check its power and the cable") from failure


def set_up(line: SerialLine, wanted: Wanted) -> GloveInfo:
    """Ask a box that answers what it is, and tell it how to send records.

    Raises DeviceError if it does not answer, or is no glove that can be read.
    """
    dialogue = Dialogue(line)
    notes = _until_ready(dialogue, line.url)
    sensors = _sensors(dialogue, line.url, wanted.sensors)
    mask = _optional(dialogue, query("M")) or b""
    right, text = _optional(dialogue, query("R")), _optional(dialogue, INFORMATION) or b""
    status = _configured(dialogue, wanted)
    if wanted.status and not status:
        notes += ("It sends no status byte: plug and wrist switch cannot be seen while it streams.",)
    filtered = _optional(dialogue, query("F")) not in (None, b"\0")
    told, shortest = told_us(wanted.words), shortest_us(sensors, line.baud, status=status, filtered=filtered)
    if wanted.poll:
        shortest += sending_us(len(POLL), line.baud)
    return GloveInfo(
        baud=line.baud,
        sensors=sensors,
        names=_names(mask, sensors),
        mask=mask,
        right_hand=None if right is None else right != b"\0",
        text="".join(filter(str.isprintable, text.decode("ascii", "replace"))).strip(),
        status=status,
        period_us=round(max(told, shortest)),
        notes=notes + _rate_note(told, shortest),
    )


def _configured(dialogue: Dialogue, wanted: Wanted) -> bool:
    """Tell the box how to send, and return whether its records will carry the status byte."""
    words = FASTEST if wanted.poll else wanted.words
    dialogue.ask(setting("T", b"".join(word.to_bytes(2, "big") for word in words)))
    _optional(dialogue, setting("D", b"\0"))  # a box without time stamps has none to switch off
    return _optional(dialogue, setting("U", bytes([wanted.status]))) is not None and wanted.status


def _until_ready(dialogue: Dialogue, url: str) -> tuple[str, ...]:
    """Ask until the box is ready. Which of 1 and 2 means what, sources disagree: both pass, with a note."""
    end = monotonic() + _READY_S
    while (state := dialogue.ask(query("G"))[0]) != READY and monotonic() < end:
        dialogue.hush()
    if state == 0:
        raise DeviceError(f"{url}: the CyberGlove's box is neither initialised nor has it a glove: is one plugged in?")
    return () if state == READY else (f"?G says {state}, not {READY}: the glove is unplugged or not initialised.",)


def _sensors(dialogue: Dialogue, url: str, expected: int | None) -> int:
    answer = _optional(dialogue, query("N")) or _optional(dialogue, query("S"))
    count = answer[0] if answer else expected
    if count is None:
        raise DeviceError(f"{url}: the CyberGlove does not say how many sensors it has: say so (sensors = 18, or 22)")
    if expected is not None and count != expected:
        raise SettingError(
            f"{url}: the CyberGlove sends {count} sensors, not {expected}: write `sensors = {count}` under [cyberglove]"
        )
    if count not in _NAMES:
        raise DeviceError(
            f"{url}: the CyberGlove sends {count} sensors, neither 18 nor 22: another program masked some (its M"
            " setting); switch the box off and on"
        )
    return count


def _names(mask: bytes, count: int) -> tuple[str, ...]:
    masked = masked_sensors(mask)
    return masked if len(masked) == count else _NAMES[count]


def _rate_note(told: float, shortest: float) -> tuple[str, ...]:
    if not 0.0 < told < shortest:
        return ()
    return (
        f"{1e6 / told:.0f} records a second are asked for, and box and line should manage {1e6 / shortest:.0f}: ask"
        " for fewer if records come with the fault 'too fast'.",
    )


def _optional(dialogue: Dialogue, command: Command) -> bytes | None:
    """Return the values of the answer, None where this box does not know the command: never for a lost answer."""
    try:
        return dialogue.ask(command)
    except DeviceError:
        dialogue.hush()
        return None

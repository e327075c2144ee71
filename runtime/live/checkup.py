"""A check of every device of a harness, one after the other: is it there, and is it as fast as its wire allows?"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from statistics import median_low, pstdev
from time import monotonic

import msgspec
from msgspec.structs import replace

from thenar.drivers.errors import ThenarError

from ..frames import GloveFrame, SwitchFrame
from ..harness.wiring import FASTEST_HZ, Harness
from ..names import list_names
from ..scanning.scanmap import ScanMap
from ..sources.base import Source, sources_of
from ..taxels import LiveTaxel, calibration_of
from .quarantine import Chattering, numbers

# A device may be this many times as slow as its wire, and this much: computers have other things to do, too.
_SLOW, _SPARE_US = 1.5, 200.0
# A rate is judged after two seconds: in the first one, rows may come that had been waiting.
_LISTEN_S, _LATEST = 2.5, 0.6
# Start-up time of a board that is reset when its port opens.
_STARTS_S = 3.0
_READ_S = 0.1
_FIVE = 5
_ADVICE = "does its clock run at the speed in glove.toml, and is the computer busy?"


class CheckResult(msgspec.Struct, frozen=True):
    """The finding on a device, or on one of its taxels.

    part          what the device says it is, or the taxel
    predicted_us  from one reading, record or row to the next by the arithmetic of the wire, for a CyberGlove by its
                  vendor's formula
    measured_us   the same as measured, the mean; None if nothing came
    remarks       what is missing, slow or odd, in sentences
    slow          whether it takes much longer than its wire does
    """

    device: str
    part: str
    present: bool
    predicted_us: float
    measured_us: float | None = None
    remarks: tuple[str, ...] = ()
    slow: bool = False


def check_up(
    harness: Harness, scan: ScanMap, names: Sequence[str], sensors: Sequence[str] | None = None
) -> Iterator[Callable[[], tuple[CheckResult, ...]]]:
    """Yield a finding on each device of `harness`, read as fast as it can: of its chips and streams only what `scan`
    reads, the switches `names`, and of the joints only `sensors`, if not all are read. A finding takes a few seconds.

    It does not raise for a device that is not there: that is a finding.
    """
    glove = harness.cyberglove
    fastest = replace(
        harness,
        cyberglove=None if glove is None else replace(glove, rate_hz=None),
        buses=tuple(replace(bus, rate_hz=FASTEST_HZ) for bus in harness.buses),
        spi=tuple(replace(device, rate_hz=FASTEST_HZ) for device in harness.spi),
    )
    for source in sources_of(fastest, names, scan, calibration_of(fastest.taxel_settings)):
        if sensors is not None:
            source.read_only(sensors)
        yield partial(_check, source, fastest, names)


def _check(source: Source, harness: Harness, names: Sequence[str]) -> tuple[CheckResult, ...]:
    """Return the finding on a device, and one on each of its taxels."""
    try:
        source.open()
        frames, measured_us = _heard(source)
        wrong = source.fault_message()
        counts = source.faults()
    except ThenarError as error:
        return (CheckResult(source.name, "", False, source.wire_us, None, (str(error),)),)
    finally:
        source.close()
    shown = [frame for frame in frames if isinstance(frame, SwitchFrame)]
    never = source.owned
    for frame in shown:
        never &= frame.lost
    slow = measured_us is not None and measured_us > _SLOW * source.wire_us + _SPARE_US
    remarks = [*filter(None, (wrong, *source.notes)), *([f"counted: {counts}"] if counts else [])]
    remarks += _wrong(names, shown)
    if slow and measured_us is not None:
        remarks.append(f"{measured_us / source.wire_us:.1f} times as slow as its wire: {_ADVICE}")
    if not frames and not wrong:
        remarks.append("it responds, and then no data is received: is it busy, or set to another rate?")
    there = bool(frames) and not never
    found = CheckResult(source.name, source.part, there, source.wire_us, measured_us, tuple(remarks), slow)
    return (found, *(_taxel(source.name, taxel, harness, shown) for taxel in source.taxels))


def _heard(source: Source) -> tuple[list[SwitchFrame | GloveFrame], float | None]:
    """Return the frames that come within the time after the first, and the mean time between the later ones of them;
    a row with joints and switches makes two frames, and counts once.
    """
    frames, times_s = list[SwitchFrame | GloveFrame](), list[float]()
    listen_s = max(_LISTEN_S, _FIVE * source.wire_us / 1e6)
    end = monotonic() + listen_s + _STARTS_S
    while (now := monotonic()) < end:
        if (frame := source.read(_READ_S)) is None:
            continue
        end = end if frames else now + listen_s
        frames.append(frame)
        if type(frame) is type(frames[0]):
            times_s.append(monotonic())
    later = times_s[int(_LATEST * (len(times_s) - 2)) :]
    return frames, 1e6 * (later[-1] - later[0]) / (len(later) - 1) if len(times_s) > 1 else None


def _wrong(switches: Sequence[str], frames: Sequence[SwitchFrame]) -> Iterator[str]:
    """Yield remarks on switches that were closed in all frames, and on those that changed faster than a hand."""
    chattering, seen, closed = Chattering(len(switches)), 0, (1 << len(switches)) - 1
    for frame in frames:
        read = ~frame.lost
        chattering.frame(frame.time_us, frame.closed, read)
        seen, closed = seen | read, closed & (frame.closed | ~read)
    shaking = chattering.switches
    if never := [switches[number] for number in numbers(seen & closed & ~shaking)] if frames else []:
        yield f"closed all the time: {list_names(never)}; if nothing was touched, they are stuck"
    if shaking:
        yield f"faster than a hand: {list_names([switches[number] for number in numbers(shaking)])}; a loose contact?"


def _taxel(device: str, taxel: LiveTaxel, harness: Harness, frames: Sequence[SwitchFrame]) -> CheckResult:
    """Return the finding on a taxel: its counts, their noise, and its fault.

    Without a calibration, counts at the ends of the converter are remarked, but are not faults.
    """
    name, fault = taxel.name, taxel.fault
    place = harness.taxel_names.index(name)
    counts = [code for frame in frames if frame.taxels is not None and (code := frame.taxels[place]) is not None]
    remarks: list[str] = [fault] if fault else []
    if counts:
        wander = max(counts) - min(counts)
        remarks.insert(0, f"{median_low(counts)} counts, noise {pstdev(counts):.1f}, {wander} from end to end")
        if not fault and taxel.highest is not None and median_low(counts) in (0, taxel.highest):
            remarks.append("at the end of the converter: at rest, pressed hard, or an open wire")
    return CheckResult(device, f"taxel {name}", bool(counts) and fault in ("", "saturated"), 0.0, None, tuple(remarks))

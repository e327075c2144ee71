"""A check of every device of a harness, one after the other: is it there, and is it as fast as its wire allows?"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from statistics import fmean, median, median_low, pstdev
from time import monotonic, perf_counter

import msgspec

from thenar.drivers.errors import ThenarError
from thenar.drivers.i2c.supervisor import PlacedChip

from ..frames import SwitchFrame
from ..harness.wiring import GloveWiring, Harness
from ..names import list_names
from ..scanning.scanmap import ScanMap
from ..scanning.timing import ChipTime, glove_us, scan_us
from ..sources.base import SOURCES
from ..sources.cyberglove import GloveDevice
from ..sources.i2c import I2cDevice, PortLevels
from ..sources.rows import RowSource
from ..sources.spi import SpiConverter
from ..taxels import Taxels, calibration_of
from .quarantine import Chattering, numbers

# How much slower than its wire a device may be: computers have other things to do, too.
SLOW = 1.5
_SCANS = 101
_LISTEN_S = 1.0
# A rate of rows is judged after two seconds: in the first one, rows may come that had been waiting.
_ROWS_S = 2.5
# Start-up time of a board that is reset when its port opens.
_STARTS_S = 3.0
# The part of a finding on the record time of all sensors.
RECORD = "a record"


class CheckResult(msgspec.Struct, frozen=True):
    """The finding on a device; for a bus, chip by chip and as a whole.

    predicted_us  from one record or row to the next, or the time of the readings, by the arithmetic of the
                  wire, for a CyberGlove by its vendor's formula
    measured_us   the same as measured, the median; None if nothing came
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
    """Yield a finding on each device of `harness`, of its chips and streams only what `scan` reads: the switches
    `names`, and of the joints only `sensors`, if not all are read. A finding takes a second or a few.

    It does not raise for a device that is not there: that is a finding.
    """
    if (glove := harness.cyberglove) is not None:
        yield lambda: _glove(glove, sensors or ())
    for number in range(len(harness.streams)):
        yield lambda number=number: _stream(harness, number, scan, names, sensors)  # type: ignore[misc]
    for bus in sorted({port.bus for port in scan.ports}):
        look = _bus if bus < len(harness.buses) else _spi
        yield lambda bus=bus, look=look: look(harness, bus, scan)  # type: ignore[misc]


def _glove(wiring: GloveWiring, read: Sequence[str]) -> tuple[CheckResult, ...]:
    """Return the kind and the speed of the glove as wired, and its best record times: of all its sensors, and of those
    that are `read`, or half of them.
    """
    device, predicted = GloveDevice(wiring), glove_us(wiring, wiring.all_sensors)
    try:
        device.open()
        measured, info = _gap(lambda: device.read(_LISTEN_S)), device.info
        remarks = (*(() if info is None else info.notes), *_counted(device))
    except ThenarError as wrong:
        return (CheckResult(device.name, "", False, predicted, None, (str(wrong),)),)
    finally:
        device.close()
    found = _remarked(CheckResult(device.name, "" if info is None else info.text, True, predicted, measured, remarks))
    some = read if 0 < len(read) < device.sensors else wiring.sensor_names[: device.sensors // 2]
    fastest = msgspec.structs.replace(wiring, rate_hz=None, record_us=None)
    return (found, _record(fastest, wiring.sensor_names), _record(fastest, some))


def _record(wiring: GloveWiring, read: Sequence[str]) -> CheckResult:
    """Return the record time of these sensors by the vendor's formula, and as measured."""
    device = GloveDevice(wiring)
    device.read_only(read)
    predicted = glove_us(wiring, len(read))
    part = RECORD if len(read) == device.sensors else f"{RECORD} of {len(read)} sensors"
    try:
        device.open()
        measured, unmasked = _gap(lambda: device.read(_LISTEN_S), fmean), device.fault_message()
    except ThenarError as wrong:
        return CheckResult(device.name, part, True, predicted, None, (str(wrong),))
    finally:
        device.close()
    if unmasked or measured is None:
        return CheckResult(device.name, part, True, predicted, measured, (unmasked or "no record comes",))
    said = f"{measured:.0f} us were measured, {measured / predicted:.2f} of the vendor's formula, {predicted:.0f} us"
    return CheckResult(device.name, part, True, predicted, measured, (said,))


def _stream(
    harness: Harness, number: int, scan: ScanMap, names: Sequence[str], sensors: Sequence[str] | None
) -> tuple[CheckResult, ...]:
    made = (source for kind in SOURCES.values() for source in kind.sources(harness, names, scan))
    streams = (source for source in made if isinstance(source, RowSource))
    device = next(source for source in streams if source.wiring is harness.streams[number])
    if sensors is not None:
        device.read_only(sensors)
    predicted, frames, rows = float(device.wiring.period_us), list[SwitchFrame](), 0
    end = monotonic() + max(_ROWS_S, 5 * predicted / 1e6) + _STARTS_S
    try:
        device.open()
        while (now := monotonic()) < end:
            if (frame := device.read(_LISTEN_S / 10)) is not None:
                frames += [frame] if isinstance(frame, SwitchFrame) else []
                end = end if rows else now + max(_ROWS_S, 5 * predicted / 1e6)
                rows += 1
        measured = None if device.watch.hz is None else 1e6 / device.watch.hz
        wrong = (device.fault_message(), f"counted: {faults}" if (faults := device.faults()) else "")
        remarks = (*filter(None, wrong), *_wrong(names, frames))
    except ThenarError as error:
        return (CheckResult(device.name, "", False, predicted, None, (str(error),)),)
    finally:
        device.close()
    found = CheckResult(
        device.name, "rows", bool(rows), predicted, measured, remarks or (() if rows else ("no row comes",))
    )
    return (found, *taxel_findings(device.name, tuple(device.wiring.taxels), harness, frames, None))


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


def taxel_findings(
    device: str, names: Sequence[str], harness: Harness, frames: Sequence[SwitchFrame], highest: int | None
) -> Iterator[CheckResult]:
    """Yield a finding on each taxel of these names: its counts, their noise, and its faults.

    Without a calibration, counts at the ends of the converter are remarked, but are not faults.
    """
    places = harness.taxel_names
    calibration = calibration_of(harness.taxel_settings)
    for name in names:
        read = Taxels([name], [[]], calibration, harness.taxel_settings, highest)
        place = places.index(name)
        codes = [frame.taxels[place] for frame in frames if frame.taxels is not None]
        wrong = []
        for code in codes:
            read.read(0, [code])
            wrong.append(read.faults[0])
        counts = [code for code in codes if code is not None]
        fault = max(sorted(set(wrong)), key=wrong.count) if wrong else "silent"
        remarks: list[str] = [fault] if fault else []
        if counts:
            wander = max(counts) - min(counts)
            remarks.insert(0, f"{median_low(counts)} counts, noise {pstdev(counts):.1f}, {wander} from end to end")
            if not fault and highest is not None and median_low(counts) in (0, highest):
                remarks.append("at the end of the converter: at rest, pressed hard, or an open wire")
        yield CheckResult(device, f"taxel {name}", fault in ("", "saturated"), 0.0, None, tuple(remarks))


def _bus(harness: Harness, number: int, scan: ScanMap) -> tuple[CheckResult, ...]:
    device = I2cDevice(harness, number, scan)
    ports = tuple(port for port in scan.ports if port.bus == number)
    times = scan_us(msgspec.structs.replace(scan, ports=ports), harness)
    try:
        device.open()
        # Both are in the order of the chips' numbers.
        found = [_chip(device, chip, time) for chip, time in zip(device.bus.chips, times.chips, strict=True)]
        whole = _duration(device.scan().read)
        frames = [device.read(_LISTEN_S) for _ in range(_SCANS)] if device.taxels else []
        way = (device.bus.fault_message,) if device.bus.fault_message else (f"reads {device.bus.way}",)
    except ThenarError as wrong:
        return (CheckResult(device.name, "", False, times.us, None, (str(wrong),)),)
    finally:
        device.close()
    there = all(finding.present for finding in found)
    scanned = _remarked(CheckResult(device.name, "a whole scan", there, times.us, whole if there else None, way))
    return (*found, scanned, *_taxels(device.name, device.taxels, harness, frames))


def _spi(harness: Harness, bus: int, scan: ScanMap) -> tuple[CheckResult, ...]:
    device = SpiConverter(harness, bus - len(harness.buses), scan)
    ports = tuple(port for port in scan.ports if port.bus == bus)
    (predicted,) = scan_us(msgspec.structs.replace(scan, ports=ports), harness).chips
    try:
        device.open()
        measured = _duration(device.run)
        frames = [device.read(_LISTEN_S) for _ in range(_SCANS)]
        wrong = device.fault_message()
    except ThenarError as error:
        return (CheckResult(device.name, "", False, predicted.us, None, (str(error),)),)
    finally:
        device.close()
    there = not device.silent
    remarks = (wrong,) if wrong and not there else ()
    found = CheckResult(device.name, device.device.chip.name, there, predicted.us, measured if there else None, remarks)
    return (_remarked(found), *_taxels(device.name, device.taxels, harness, frames))


def _taxels(
    device: str, taxels: Sequence[PortLevels], harness: Harness, frames: Sequence[SwitchFrame | None]
) -> Iterator[CheckResult]:
    came = [frame for frame in frames if frame is not None]
    for taxel in taxels:
        yield from taxel_findings(device, [taxel.name], harness, came, taxel.highest)


def _chip(device: I2cDevice, chip: PlacedChip, time: ChipTime) -> CheckResult:
    taken = _duration(device.scan(chip).read)
    if not chip.present:
        return CheckResult(device.name, time.place, False, time.us, None, (chip.last_error,))
    remarks = (f"{chip.errors} failures, the last: {chip.last_error}",) if chip.errors else ()
    return _remarked(CheckResult(device.name, time.place, True, time.us, taken, remarks))


def _remarked(finding: CheckResult) -> CheckResult:
    """Return the finding with a remark if it is slow, or silent."""
    if finding.measured_us is None and finding.present:
        remark = "it responds, and then no data is received: is it busy, or set to another rate?"
        return msgspec.structs.replace(finding, remarks=(*finding.remarks, remark))
    times = (finding.measured_us or 0.0) / finding.predicted_us
    if times <= SLOW:
        return finding
    remark = f"{times:.1f} times as slow as its wire: {_ADVICE}"
    return msgspec.structs.replace(finding, remarks=(*finding.remarks, remark), slow=True)


_ADVICE = "does its clock run at the speed in glove.toml, and is the computer busy?"


def _gap(read: Callable[[], object], middle: Callable[[list[float]], float] = median) -> float | None:
    """Return the median time between two frames within a second, in microseconds; or their mean, which does not change
    for frames that come in bunches.
    """
    end, came = monotonic() + _LISTEN_S, list[float]()
    while monotonic() < end:
        if read() is not None:
            came.append(perf_counter())
    gaps = [later - earlier for earlier, later in pairwise(came)]
    return 1e6 * middle(gaps) if gaps else None


def _duration(read: Callable[[], object]) -> float:
    """Return the median time of a scan, in microseconds."""
    taken = []
    for _ in range(_SCANS):
        start = perf_counter()
        read()
        taken.append(perf_counter() - start)
    return 1e6 * median(taken)


def _counted(device: GloveDevice) -> tuple[str, ...]:
    """Return a remark on bytes lost or damaged on a line, if there were any."""
    wrong = [f"{count.name} {count.value}" for count in device.counts() if count.value and count.name in _WRONG]
    return (f"on its line: {', '.join(wrong)}",) if wrong else ()


_WRONG = ("faults", "wrong start", "wrong length", "damaged", "short", "overlong", "gaps", "misfits", "missing")

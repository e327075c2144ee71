"""The content of a spec for a reduced glove, decided once; files and tables only write it down."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from msgspec import Struct
from msgspec.structs import replace

from thenar.runtime.errors import BuildError, HarnessError
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.live.system import own_joints
from thenar.runtime.manifest import Detected, Faults, Manifest, Recognised, Switch
from thenar.runtime.names import list_names
from thenar.runtime.scanning.plan import plan_scan, unwired
from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.scanning.timing import glove_us, scan_us

from ..facts import Fact, SensorCount, facts
from ..hand import HandShape
from .circuit import BillLine, Circuit, bill_of, bill_of_joints, bill_of_parts, glove_circuit
from .layout import (
    GloveWire,
    PlacedSensor,
    WireEnd,
    as_soldered,
    counted_sensors,
    crowded,
    elements_of,
    ends_of,
    place_sensors,
    wires_of,
)
from .pattern import Pattern, pattern_of
from .prices import Part
from .propose import propose_cyberglove, propose_harness


class ExpectedPerformance(Struct, frozen=True):
    """Times calculated from bus arithmetic, in microseconds, without the computer's overhead per transaction.

    scan_us      scan of all kept switches on expanders, in `transactions` transactions, mux selections included
    full_us      scan of all switches that are wired to expanders, kept or not
    rows_us      from row to row of each stream with kept sensors
    glove_us     between records of the CyberGlove with `sensors` sensors, the build's joints; None without joints
    rates        the accuracy measured when the build was compiled
    faults       the accuracy on the training rows under the worst faults
    detection    the detection rates of nothing held
    """

    transactions: int
    scan_us: float
    full_us: float
    rows_us: tuple[int, ...]
    sensors: int
    glove_us: float | None
    rates: tuple[Recognised, ...]
    faults: Faults | None = None
    detection: tuple[Detected, ...] = ()


def expected_of(manifest: Manifest, scan: ScanMap, harness: Harness) -> ExpectedPerformance:
    """Return the expected times and rates of a build's switches in a harness, with a complete scan by `scan`."""
    time = scan_us(scan, harness)
    glove = harness.cyberglove if manifest.joints else None
    return ExpectedPerformance(
        transactions=len(scan.ports) + time.selects,
        scan_us=time.us,
        full_us=time.full_us,
        rows_us=tuple(
            stream.period_us
            for stream, read in zip(harness.streams, scan.streams, strict=True)
            if read.switches or read.levels
        ),
        sensors=len(manifest.joints),
        glove_us=None if glove is None else glove_us(glove, len(manifest.joints)),
        rates=manifest.rates,
        faults=manifest.faults,
        detection=manifest.detection,
    )


class SwitchReader(Struct, frozen=True):
    """A reader of sensors by its designator: a chip or a board, and the numbers of the sensors on its pins."""

    ref: str
    place: str
    pins: tuple[str, ...]
    switches: tuple[int, ...]


class SpecSummary(Struct, frozen=True):
    """A spec as values: the content of `spec.json`. `remarks` are sentences for whoever builds the glove.

    kept  the numbers of kept sensors, in words; sensors: those of them that are wired
    """

    glove: str
    kept: str
    proposed: bool
    hand_length_mm: float | None
    print_on: str
    sensors: tuple[PlacedSensor, ...]
    readers: tuple[SwitchReader, ...]
    wires: tuple[GloveWire, ...]
    materials: tuple[BillLine, ...]
    expected: ExpectedPerformance
    remarks: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class GloveSpec:
    """A reduced glove: its summary, drawing, circuit and firmware, and the facts of the build as it is wired. pattern
    is None if the positions are unknown.
    """

    summary: SpecSummary
    harness: Harness
    scan: ScanMap
    circuit: Circuit
    pattern: Pattern | None
    facts: tuple[Fact, ...]


def glove_spec(
    manifest: Manifest,
    scan: ScanMap | None = None,
    harness: Harness | None = None,
    hand: HandShape | None = None,
    parts: Mapping[str, Part] | None = None,
) -> GloveSpec:
    """Return the spec of a build's glove, wired with `harness`; without one, a wiring is proposed.

    scan is the build's scan map, if it has one; hand, the hand that has positions for its switches; parts, the part of
    a price list for each of its sensors, by name: all of them, or none. Raises BuildError
    if the build keeps no switch, or has a scan map but no harness is given; HarnessError if the harness lacks a kept
    switch.
    """
    if not manifest.switches:
        raise BuildError("the build keeps no switch, so there is no glove to build: compile it with ``inputs`` both")
    wired = _harness(manifest, scan, harness)
    kept_names = [switch.name for switch in manifest.switches]
    read = plan_scan(kept_names, wired)
    names = elements_of(wired, kept_names)
    known = hand if hand is not None and hand.knows(names) else None
    soldered = as_soldered(wired)
    ends = ends_of(soldered, names)
    switches = place_sensors(names, {names[end.switch] for end in ends if end.taxel}, known)
    wires = wires_of(switches, ends, known)
    circuit = glove_circuit(switches, ends, wires, soldered, "" if known is None else known.part_number)
    joints = [joint.name for joint in manifest.joints]
    bought = {sensor.name: sensor.ref for sensor in switches} if parts else {}
    if parts and wired.cyberglove is None:
        bought |= {joint: joint for joint in joints}
    groups: dict[str, list[WireEnd]] = {}
    for end in ends:
        groups.setdefault(end.unit.ref, []).append(end)
    kept = str(SensorCount.of_build(manifest))
    size = "" if known is None or known.length_mm is None else f", right hand of {known.length_mm:g} mm"
    title = f"{wired.name}: {counted_sensors(switches)}{size}"
    pattern = None if known is None else pattern_of(switches, known, title)
    summary = SpecSummary(
        glove=wired.name,
        kept=kept,
        proposed=harness is None,
        hand_length_mm=None if known is None else known.length_mm,
        print_on="" if pattern is None else pattern[0].hint,
        sensors=switches,
        readers=tuple(
            SwitchReader(ref, its[0].unit.place, tuple(end.pin for end in its), tuple(end.switch + 1 for end in its))
            for ref, its in sorted(groups.items(), key=lambda item: (item[0][0], int(item[0][1:])))
        ),
        wires=wires,
        materials=(
            *bill_of_parts(bought, parts or {}),
            *bill_of(circuit, wires, bought),
            *bill_of_joints([joint for joint in joints if joint not in bought], wired.cyberglove is not None),
        ),
        expected=expected_of(manifest, read, wired),
        remarks=(*_remarks(manifest, wired, switches, known), *_of_boards(wired)),
    )
    return GloveSpec(summary, wired, read, circuit, pattern, facts(manifest, read, wired))


def _harness(manifest: Manifest, scan: ScanMap | None, harness: Harness | None) -> Harness:
    names = [switch.name for switch in manifest.switches]
    if harness is None:
        if scan is not None:
            raise BuildError("the build was compiled for a specific wiring: name its glove.toml with ``glove``")
        return propose_harness(names, cyberglove=propose_cyberglove([joint.name for joint in manifest.joints]))
    if missing := unwired(harness, names):
        raise HarnessError(
            f"harness {harness.name!r} has no pin or column for {list_names(missing)}, which the build keeps: "
            "add what is missing to its file"
        )
    # Calibrations become bare file names: the files belong next to the spec's glove.toml.
    glove = harness.cyberglove
    return replace(
        harness,
        cyberglove=None if glove is None else replace(glove, calibration=_bare(glove.calibration)),
        streams=tuple(replace(stream, calibration=_bare(stream.calibration)) for stream in harness.streams),
    )


def _bare(path: str | None) -> str | None:
    return (path or "").replace("\\", "/").rsplit("/", 1)[-1] or None


def _of_boards(harness: Harness) -> Iterator[str]:
    """Yield where the multiplexers of each board go."""
    for number, stream in enumerate(harness.streams, start=1):
        if stream.board is not None and stream.board.select:
            commons = dict.fromkeys(pin.partition(".")[0] for pin in stream.board.pins.values() if "." in pin)
            yield (
                f"A{number}: S0 to S3 of its multiplexers go to {', '.join(stream.board.select)}, their commons to "
                f"{', '.join(commons)}"
            )


def _remarks(
    manifest: Manifest, harness: Harness, switches: Sequence[PlacedSensor], hand: HandShape | None
) -> Iterator[str]:
    """Yield sentences for whoever builds the glove."""
    if hand is None:
        yield (
            "the positions of this glove's sensors are unknown (--layout gives them): there is no cutting "
            "pattern, and wire lengths are left out"
        )
    else:
        for first, second, apart in crowded(switches, hand.body_mm):
            yield (
                f"{switches[first - 1].ref} and {switches[second - 1].ref} are {apart} mm apart and their bodies "
                f"{hand.body_mm:g} mm wide: move one of them aside"
            )
    kept = {name for switch in manifest.switches for name in (switch.name, switch.source)}
    kept |= {joint.name for joint in manifest.joints}
    flexed = tuple(joint for stream in harness.streams for joint in stream.joints)
    if unread := [name for name in (*harness.switches, *harness.taxel_names, *flexed) if name not in kept]:
        yield f"not read, so that its cable can be pulled without soldering: {', '.join(unread)}"
    refs = {sensor.name: sensor.ref for sensor in switches}
    measured: dict[str, list[Switch]] = {}
    for switch in manifest.switches:
        if switch.threshold is not None and switch.name in refs:
            yield (
                f"{refs[switch.name]} is a level of the pad {switch.source}: set its comparator to "
                f"{switch.threshold.value:g} {switch.threshold.taxel.unit}; it is {switch.closed}"
            )
        elif switch.threshold is not None:
            measured.setdefault(switch.source, []).append(switch)
    for taxel, levels in measured.items():
        closed = list_names([level.closed for level in levels])
        yield f"{refs[taxel]} is the pad {taxel}, whose counts thenar compares: {closed}"
    joints = own_joints([joint.name for joint in manifest.joints])
    if joints and harness.joint_device is None:
        yield joints

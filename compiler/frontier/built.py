"""From designs to points: what they take as measured, how they decide, and which of them are on a front for that."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from .designs import Design, best_designs
from .pareto import front
from .points import DecisionKind, Latency, Point, Setting, Time
from .waiting import DECISIONS

EARLY = (
    "Scans that end early are tried with decisions on single frames: a dwell with a lead reads on for longer, and a "
    "sequential test needs whole scans."
)


@dataclass(frozen=True, slots=True, eq=False)
class Built:
    """A design and what classifying takes in it, as it was measured or simulated."""

    design: Design
    classify: Time

    @property
    def frame(self) -> Time:
        """Reading everything, on lines of their own, and classifying."""
        design = self.design
        return Time(max(design.scan.us, design.transfer.us) + self.classify.us, self.classify.how)

    @property
    def decisions(self) -> tuple[DecisionKind, ...]:
        """The decisions that its scans serve."""
        return DECISIONS if self.design.scan_kind == "full" else ("single",)


Waits = Mapping[tuple[Built, DecisionKind], Latency]


def with_whole_scans(kept: Sequence[Design]) -> list[Design]:
    """Return the designs, each once, and those whose scans may end early with whole scans as well: other decisions
    than on single frames need these.
    """
    found = {_identity(design): design for design in kept}
    for design in kept:
        whole = replace(design, scan_kind="full")
        found.setdefault(_identity(whole), whole)
    return list(found.values())


def points_of(builts: Sequence[Built], waits: Waits, names: Sequence[str], max_bins: int | None) -> tuple[Point, ...]:
    """Return those that are on a front, numbered from the fastest frame on.

    names  of all switches of the set
    """
    fronts = _fronts(builts, waits)
    ordered = sorted(builts, key=lambda built: (built.frame.us, built.design.n_switches))
    found = [(built, kind) for built in ordered for kind in built.decisions if fronts[built, kind]]
    return tuple(
        _point(number, built, kind, waits[built, kind], tuple(fronts[built, kind]), names, max_bins)
        for number, (built, kind) in enumerate(found, 1)
    )


def _fronts(builts: Sequence[Built], waits: Waits) -> dict[tuple[Built, DecisionKind], list[str]]:
    found: dict[tuple[Built, DecisionKind], list[str]] = {place: [] for place in waits}
    of = {built.design: built for built in builts}
    by_time, by_switches = best_designs(list(of), lambda design: of[design].frame.us)
    for name, designs in (("frame", by_time), ("switches", by_switches)):
        for design in designs:
            found[of[design], "single"].append(name)
    for built, kind in _quickest(builts, waits):
        found[built, kind].append("latency")
    return found


def _quickest(builts: Sequence[Built], waits: Waits) -> Iterator[tuple[Built, DecisionKind]]:
    for kind in DECISIONS:
        latencies = {built: waits[built, kind].mean_us for built in builts if kind in built.decisions}
        for built in front(list(latencies), latencies.__getitem__, lambda built: built.design.rate.mean):
            yield built, kind


def _identity(design: Design) -> tuple[object, ...]:
    wired = design.wired and (design.wired.wiring, design.wired.clock_hz)
    return id(design.close), design.tabled, design.classified, wired, design.scan_kind


def _point(
    number: int,
    built: Built,
    kind: DecisionKind,
    latency: Latency,
    fronts: tuple[str, ...],
    names: Sequence[str],
    max_bins: int | None,
) -> Point:
    design = built.design
    wired, tabled, close = design.wired, design.tabled, design.close
    return Point(
        number=number,
        setting=Setting(
            way=design.choice.way,
            inputs=design.choice.inputs,
            rounds=tabled.rounds,
            width=tabled.shape.width,
            layout=design.classified.layout,
            scan=design.scan_kind,
            decision=kind,
            wiring="" if wired is None else wired.wiring,
            clock_hz=0 if wired is None else wired.clock_hz,
            table_bits=tabled.shape.table_bits,
            max_bins=max_bins,
        ),
        switches=tuple(names[column] for column in close.screened.columns),
        rate=design.rate,
        left_out=None if close.left_out is None else close.left_out[tabled],
        scan=design.scan,
        transfer=design.transfer,
        classify=built.classify,
        frame=built.frame,
        latency=latency,
        flash=design.classified.flash,
        ram=design.classified.ram,
        ports=0 if wired is None else wired.scan.ports,
        chips=0 if wired is None else wired.scan.chips,
        compile_s=round(design.compile_s, 2),
        fronts=fronts,
    )

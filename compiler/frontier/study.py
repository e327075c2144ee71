"""A frontier from recordings: everything is screened, what is near the front is looked at closely, and put together."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING

from .asking import Desk
from .building import Design, best_designs, designs
from .candidates import NO_SWITCHES, Choice, finalists
from .closeup import Close, look_closely
from .equipment import Equipment
from .material import Cuts, Material
from .measured import Measured, measure_designs
from .pareto import front
from .points import SCHEMA, DecisionKind, Frontier, Latency, Mark, Point, Setting, Time, Tried, Way
from .pricing import Tabled
from .screening import Screening, screen
from .settings import BEST, Search, Shape
from .stages import Learner
from .stream import Stream
from .waiting import DECISIONS, Pace, Waited, WaitKey, WaitTask, find_latencies

if TYPE_CHECKING:
    from ...runtime.manifest import Inputs

# The paper's S, and all switches there are.
PAPERS = (Way("id3", 0.0), Way("id3", 13.0), Way("id3", 62.0))


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a point has to satisfy: the best within a time, or the fastest that recognises a share; None: not asked."""

    budget_us: float | None = None
    rate: float | None = None

    @property
    def words(self) -> str:
        """What was asked for, "" for nothing."""
        if self.budget_us is not None:
            return f"the best within {self.budget_us:g} us a frame"
        return "" if self.rate is None else f"the fastest that recognises {100 * self.rate:g} %"

    def pick(self, points: Sequence[Point]) -> Point | None:
        """Return the point that suits; None where none does or nothing was asked for."""
        single = [point for point in points if point.setting.decision == "single"]
        if self.budget_us is not None:
            quick = [point for point in single if point.frame.us <= self.budget_us]
            return max(quick, key=lambda point: (point.rate.mean, -point.frame.us), default=None)
        good = [point for point in single if self.rate is not None and point.rate.mean >= self.rate]
        return min(good, key=lambda point: (point.frame.us, -point.rate.mean), default=None)


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """What a frontier is computed from: rows and how they are cut, what is tried, what may be built, a stream to decide
    on (of the test rows of the first fold, or of other recordings), and what the user asks for.
    """

    source: str
    material: Material
    cuts: Cuts
    search: Search
    equipment: Equipment
    stream: Stream
    wanted: Wanted
    own: Mark | None = None
    skipped: tuple[str, ...] = ()


def find_frontier(study: Study, desk: Desk) -> Frontier:
    """Return the frontier. Answers that are in the desk's store are not looked for again."""
    learner = Learner(desk, study.material, study.cuts, study.search.max_bins)
    screening = screen(learner, study.search, study.equipment)
    chosen = finalists(screening.screened, _papers(screening, study), study.search.finalists)
    closes = look_closely(learner, study.search, study.equipment, chosen)
    every = [design for close in closes for design in designs(close, study.material.codes.shape[1])]
    by_time, by_switches = best_designs(every)
    kept = list(dict.fromkeys([*by_time, *by_switches]))
    measured = measure_designs(study.equipment, kept, desk)
    latencies = _latencies(study, learner, kept)
    points = _points(study, kept, by_time, by_switches, measured, latencies)
    picked = study.wanted.pick(points)
    return Frontier(
        schema=SCHEMA,
        thenar=version("thenar"),
        source=study.source,
        fingerprint=study.material.fingerprint,
        rows=len(study.material.labels),
        subjects=study.material.n_subjects,
        n_switches=len(study.material.switch_names),
        n_joints=study.material.codes.shape[1],
        grasps=study.material.grasps,
        target=study.equipment.model.target,
        folds=study.search.folds,
        repeats=study.search.repeats,
        combinations=len(every) * len(DECISIONS) + len(screening.screened) * len(study.search.stages),
        points=points,
        tried=_tried(screening, closes),
        curves=screening.curves,
        marks=_marks(study, closes),
        checks=measured.checks,
        skipped=(*study.skipped, *measured.skipped, study.stream.what),
        picked=None if picked is None else picked.number,
        wanted=study.wanted.words,
    )


def _papers(screening: Screening, study: Study) -> list[Choice]:
    """Return the choices to mark: the paper's, with all inputs, and all switches."""
    widest: "Inputs" = "both" if study.material.codes.shape[1] else "switches"
    ways = {screened.choice.way for screened in screening.screened}
    return [Choice(way, widest) for way in (*PAPERS, _everything(study)) if way in ways]


def _everything(study: Study) -> Way:
    """Return the way that keeps all switches; whichever method says so, it is the same."""
    return Way(BEST, float(len(study.material.switch_names)))


def _latencies(study: Study, learner: Learner, kept: Sequence[Design]) -> dict[Design, tuple[Latency, ...]]:
    """Return the latencies of every design, one for each of DECISIONS."""
    fold = study.cuts.screening[0]
    grouped: dict[Choice, list[Design]] = {}
    for design in kept:
        grouped.setdefault(design.choice, []).append(design)
    keys = {
        choice: WaitKey(
            learner.columns(choice, fold),
            choice.joints,
            study.cuts.names[fold],
            study.stream.what,
            tuple(Pace(design.tabled, design.frame_us) for design in mine),
            learner.max_bins,
        )
        for choice, mine in grouped.items()
    }
    tasks = [WaitTask(key, study.material, fold, study.stream, 2.0 + len(key.paces)) for key in keys.values()]
    found = learner.desk.ask("latencies", tasks, find_latencies, Waited)
    return {
        design: latencies
        for choice, mine in grouped.items()
        for design, latencies in zip(mine, found[keys[choice]].latencies, strict=True)
    }


def _points(
    study: Study,
    kept: Sequence[Design],
    by_time: Sequence[Design],
    by_switches: Sequence[Design],
    measured: Measured,
    latencies: dict[Design, tuple[Latency, ...]],
) -> tuple[Point, ...]:
    """Return the points, numbered from the fastest frame on: each design as it is, and with the decisions that pay."""
    quickest: set[tuple[Design, DecisionKind]] = set()
    for number, kind in enumerate(DECISIONS):
        waits = {design: latencies[design][number].mean_us for design in kept}
        quickest |= {(design, kind) for design in front(kept, waits.__getitem__, lambda design: design.rate.mean)}
    found = []
    for design in sorted(kept, key=lambda design: (design.frame_us, design.n_switches)):
        for number, kind in enumerate(DECISIONS):
            fronts = [
                name
                for name, there in (
                    ("frame", kind == "single" and design in by_time),
                    ("switches", kind == "single" and design in by_switches),
                    ("latency", (design, kind) in quickest),
                )
                if there
            ]
            if fronts:
                found.append((design, kind, latencies[design][number], tuple(fronts)))
    names = study.material.switch_names
    return tuple(
        _point(number, design, kind, latency, fronts, names, measured, study.search.max_bins)
        for number, (design, kind, latency, fronts) in enumerate(found, 1)
    )


def _point(
    number: int,
    design: Design,
    kind: DecisionKind,
    latency: Latency,
    fronts: tuple[str, ...],
    names: tuple[str, ...],
    measured: Measured,
    max_bins: int | None,
) -> Point:
    wired, tabled, close = design.wired, design.tabled, design.close
    classify = measured.classify(design)
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
        classify=classify,
        frame=Time(max(design.scan.us, design.transfer.us) + classify.us, classify.how),
        latency=latency,
        flash=design.classified.flash,
        ram=design.classified.ram,
        ports=0 if wired is None else wired.scan.ports,
        chips=0 if wired is None else wired.scan.chips,
        compile_s=round(close.compile_s, 2),
        fronts=fronts,
    )


def _tried(screening: Screening, closes: Sequence[Close]) -> tuple[Tried, ...]:
    """Return everything that was screened, and the finalists after every stage of their training."""
    screened = [
        Tried(one.choice.way, one.choice.inputs, len(one.columns), 0, one.rate, one.frame_us)
        for one in screening.screened
    ]
    stages = [
        Tried(one.choice.way, one.choice.inputs, len(one.columns), rounds, rate, one.frame_us)
        for close, one in ((close, close.screened) for close in closes)
        for rounds, rate in close.stages.items()
    ]
    return (*screened, *stages)


def _marks(study: Study, closes: Sequence[Close]) -> tuple[Mark, ...]:
    """Return what to see beside the points: all switches, the paper's placements, the user's own build."""
    named = {_everything(study): f"all {len(study.material.switch_names)} switches"}
    named |= {way: f"paper, S = {way.parameter:g}" for way in PAPERS}
    marks = []
    for close in closes:
        screened = close.screened
        if screened.choice.way in named and screened.choice.inputs != "switches" and screened.choice.way != NO_SWITCHES:
            marks.append(_mark(named[screened.choice.way], close, study))
    return (*marks, *([study.own] if study.own else []))


def _mark(name: str, close: Close, study: Study) -> Mark:
    tabled = Tabled(min(100, study.search.rounds), Shape(16))
    rate = close.rates[tabled]
    return Mark(name, len(close.screened.columns), rate, close.screened.frame_us)

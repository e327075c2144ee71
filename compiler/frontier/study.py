"""A frontier from recordings: everything is screened, what is near the front is looked at closely, and put together."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version

from .beside_points import choices_to_mark, marks_of, tried
from .built import EARLY, Built, Waits, points_of, with_whole_scans
from .candidates import Choice, finalists
from .closeup import look_closely
from .designs import best_designs, designs
from .equipment import Equipment
from .material import Cuts, Material
from .measured import measure_designs
from .points import SCHEMA, Frontier, FrontierError, Mark, Point
from .screening import Screening, screen
from .settings import Search
from .stages import Learner
from .storing.asking import Desk
from .streaming.stream import Stream
from .waiting import Pace, Waited, WaitKey, WaitTask, digest, find_latencies


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
    """Return the frontier. Answers that are in the desk's store are not looked for again.

    A point's rate is one of those by which the points were chosen, so the best of many is a little lucky; its rate with
    subjects left out had no say. Raises FrontierError if nothing can be built.
    """
    n_joints = study.material.codes.shape[1]
    learner = Learner(desk, study.material, study.cuts, study.search.max_bins)
    screening = screen(learner, study.search, study.equipment)
    _check(screening, study)
    named = choices_to_mark(len(study.material.switch_names), n_joints)
    chosen = finalists(screening.screened, list(named), study.search.finalists)
    closes = look_closely(learner, study.search, study.equipment, chosen)
    every = [design for close in closes for design in designs(close, n_joints)]
    by_time, by_switches = best_designs(every, lambda design: design.frame_us)
    kept = with_whole_scans([*by_time, *by_switches])
    measured = measure_designs(study.equipment, kept, desk)
    builts = [Built(design, measured.classify(design)) for design in kept]
    points = points_of(builts, _waits(study, learner, builts), study.material.switch_names, study.search.max_bins)
    picked, seen = study.wanted.pick(points), tried(screening, closes, study.search)
    early = [EARLY] if any(design.scan_kind == "early" for design in kept) else []
    marks = marks_of(named, closes, study.search, n_joints)
    return Frontier(
        schema=SCHEMA,
        thenar=version("thenar"),
        source=study.source,
        fingerprint=study.material.fingerprint,
        rows=len(study.material.labels),
        subjects=study.material.n_subjects,
        n_switches=len(study.material.switch_names),
        n_joints=n_joints,
        grasps=study.material.grasps,
        target=study.equipment.model.target,
        folds=study.search.folds,
        repeats=study.search.repeats,
        combinations=sum(len(Built(design, design.classify).decisions) for design in every) + len(seen),
        points=points,
        tried=seen,
        curves=screening.curves,
        marks=(*marks, *([study.own] if study.own else [])),
        checks=measured.checks,
        skipped=(*study.skipped, *measured.skipped, *early, study.stream.what),
        picked=None if picked is None else picked.number,
        wanted=study.wanted.words,
    )


def _check(screening: Screening, study: Study) -> None:
    if not screening.screened:
        raise FrontierError(
            f"no placement that was tried can be built for {study.equipment.model.target}: name other --methods or "
            "another --target"
        )


def _waits(study: Study, learner: Learner, builts: Sequence[Built]) -> Waits:
    """Return the latency of every build with every decision that it serves, by tables of rows that the stream of the
    set's own test rows does not hold.
    """
    fold, stream = study.cuts.screening[0], digest(study.stream)
    grouped: dict[Choice, list[Built]] = {}
    for built in builts:
        grouped.setdefault(built.design.choice, []).append(built)
    keys = {
        choice: WaitKey(
            learner.columns(choice, fold),
            choice.joints,
            study.cuts.names[fold],
            stream,
            tuple(Pace(built.design.tabled, built.frame.us, built.decisions) for built in mine),
            learner.max_bins,
        )
        for choice, mine in grouped.items()
    }
    tasks = [WaitTask(key, study.material, fold, study.stream, 2.0 + len(key.paces)) for key in keys.values()]
    found = learner.desk.ask("latencies", tasks, find_latencies, Waited)
    return {
        (built, kind): latency
        for choice, mine in grouped.items()
        for built, latencies in zip(mine, found[keys[choice]].latencies, strict=True)
        for kind, latency in zip(built.decisions, latencies, strict=True)
    }

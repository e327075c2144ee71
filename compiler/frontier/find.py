"""Find a frontier from recordings: screen everything, evaluate candidates near the front fully, assemble the result."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from importlib.metadata import version
from itertools import filterfalse
from os.path import lexists
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np

from thenar.runtime.build import Build
from thenar.runtime.errors import BuildError, HarnessError
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.manifest import PAPERS_TRAINER
from thenar.runtime.names import list_names
from thenar.runtime.published import NONE

from ..evaluation.rates import Rate
from ..limits import check_inputs, check_memory, check_types
from ..placement.elements import Element, above
from ..placement.methods.base import BEST, METHODS, PAPERS, usual
from ..placement.ports import ports_of_whole_glove
from ..publication import check_folder, entries, publish_folder
from ..recordings.frames import check_trials
from ..recordings.graspset import GraspSet
from ..samples import Samples
from ..text import INDEPENDENT, sentence
from .cache import Cache, Report, Store
from .designs import Design, Latencies, best_designs, designs, lucks, points_of, with_whole_scans
from .equipment import Equipment, equipment_for
from .finalists import OTHERS, PRICE_S, Close, finalists, look_closely, papers_depth, papers_tables
from .latency import Pace, latencies
from .measure import TRIAL_S, measured
from .moving import Moving
from .plots import PICTURES, pictures
from .points import SCHEMA, Frontier, FrontierError, Mark, PlacementChoice, Point, Tried, frontier_to_bytes
from .screen import FEWER_JOINTS, OTHER_TRAINERS, QUICK_PRICE_S, Screened, screen, screen_fewer, screen_others
from .search import JOINTS, TAXEL_LEVELS, Candidate, Search, available_inputs, curve_placements, tried_placements
from .stream import Stream, stream_of
from .survey import Cuts, Survey, fit_s, path_s, settle_s
from .timing.scan_times import Records, records_of, scan_times
from .timing.wirings import Wiring, reads_by_itself, wirings
from .words import csv_bytes

RecordTime = Literal["formula", "wire"]
FRONTIER_NAME, TABLE_NAME, STORE_NAME = "frontier.json", "frontier.csv", "store.jsonl"
_DOCUMENTS = frozenset({FRONTIER_NAME, TABLE_NAME, *(f"{name}.svg" for name in PICTURES)})
_EARLY = (
    "Scans that end early are tried with decisions on single frames: a dwell with a lead reads on for longer, and a "
    "sequential test needs whole scans."
)
_RENEWED = f"{STORE_NAME} had the form of an older thenar: everything was computed again"
_UNTIMED = (
    "the time of reading the joints ({}) is unknown and is left out of every frame time and latency: give it with "
    "--joint-us"
)
# Empirical: number of marked placements in addition to the finalists; of designs of a finalist on a front; the share of
# distinct placements among those tried; of layouts to simulate in addition.
_MARKED, _DESIGNS, _DIFFERENT, _CHECKED = 3, 2, 0.8, 30
# Placements to screen with the other trainers, as a multiple of the finalists.
_WIDER = 3
# Number of placements to try with fewer joints.
_FEWER = 5
# Expected seconds of one core to learn what segments cost, and to play a stream.
_LEARNT_S = 5.0


@dataclass(frozen=True, slots=True)
class Wanted:
    """Requirement for a point: the best within a time, or the fastest with an accuracy; None: no selection."""

    budget_us: float | None = None
    rate: float | None = None

    @property
    def words(self) -> str:
        """The requirement in words, "" for none."""
        if self.budget_us is not None:
            return f"the best within {self.budget_us:g} us a frame"
        return "" if self.rate is None else f"the fastest that recognises {100 * self.rate:g} %"

    def pick(self, points: Sequence[Point]) -> Point | None:
        """Return the selected point, or None."""
        single = [point for point in points if point.setting.decision == "single"]
        if self.budget_us is not None:
            quick = [point for point in single if point.frame.us <= self.budget_us]
            # By the rates that points were chosen by, for which their luck was estimated.
            return max(quick, key=lambda point: (point.rate.mean + point.luck, -point.frame.us), default=None)
        good = [point for point in single if self.rate is not None and point.rate.mean >= self.rate]
        return min(good, key=lambda point: (point.frame.us, -point.rate.mean), default=None)


def find_frontier(
    grasp_set: GraspSet,
    output: Path | None = None,
    *,
    source: str = "recordings",
    harness: Harness | None = None,
    target: str = "host",
    search: Search | None = None,
    wanted: Wanted | None = None,
    build: Path | None = None,
    joint_us: float | None = None,
    record_time: RecordTime = "formula",
    filtered: bool = False,
    stream: GraspSet | None = None,
    jobs: int = -1,
    cluster: str | None = None,
    report: Report | None = None,
) -> Frontier:
    """Find the trade-off of accuracy and time: the best switches, joints, rounds, tables, wirings and decisions.

    Every placement is screened by nested cross-validation; those near the front are fully evaluated, priced for the
    target, and simulated there.

    Parameters
    ----------
    grasp_set : GraspSet
        Recordings of at least two grasp types; no fold splits a trial. Rows in which nothing is held only count in
        decision latency.
    output : Path, optional
        Folder for frontier.json, frontier.csv, three pictures, and the store, from which an interrupted run resumes.
        By default nothing is written or stored.
    source : str
        Name of the recordings.
    harness : Harness, optional
        A glove's wiring: it is tried as well, and switches are chosen by the cost of its ports.
    target : str
        Deployment target, one of `thenar.compiler.frontier.targets.TARGETS`.
    search : Search, optional
        Size of the search. Baselines that are not installed are left out.
    wanted : Wanted, optional
        Which point to pick.
    build : Path, optional
        A build folder, to be marked on the pictures.
    joint_us : float, optional
        Time of reading all joints, in microseconds, if they are not a CyberGlove's. By default that time is left out
        of every frame, and a sentence of `skipped` says so.
    record_time : {"formula", "wire"}
        The time of a CyberGlove's record, if the harness has no measured one: the vendor's formula, or only its bytes
        on the line.
    filtered : bool
        Whether the formula is with the box's digital filter on.
    stream : GraspSet, optional
        Other recordings of the same glove, to measure decision latency on; usually the test rows of the first fold.
    jobs : int
        Worker processes, -1 for all cores.
    cluster : str, optional
        Address of a Dask scheduler, whose workers do the work.
    report : callable, optional
        Called with the done and total expected seconds of one core.

    Returns
    -------
    Frontier
        A point's rate is corrected for the selection of the best of many; see `thenar.compiler.evaluation.luck`.

    Raises
    ------
    FrontierError
        If the recordings, the build or the stream do not fit, nothing can be built, or the folder holds other things.
    StoreError
        If another run uses the folder, or the disk is full.

    Examples
    --------
    >>> from thenar.compiler import GraspSet
    >>> found = find_frontier(GraspSet.load("set.grasps"), Path("frontier"))  # doctest: +SKIP
    >>> found.points[0].frame.us  # doctest: +SKIP
    """
    samples = _samples(grasp_set.without_none())
    # Levels of one taxel share its conversion.
    costs = harness is not None or bool(grasp_set.taxel_columns)
    search, lacking = _installed(search or Search(methods=usual(ours=True, wired=costs)))
    cuts = Cuts.of(samples, search)
    ports = ports_of_whole_glove(harness, grasp_set.element_names, len(grasp_set.taxel_columns))
    made = [] if output is None else [*filterfalse(lexists, (output / STORE_NAME, output, *output.parents))]
    with _folder(output) as folder, Store(folder / STORE_NAME, f"thenar {version('thenar')}") as store:
        cache = Cache(store, report or _unheard, jobs=jobs, cluster=cluster)
        with _taken_back_if_refused(made):
            records = _records(grasp_set, harness, target, joint_us, record_time, filtered)
            equipment = equipment_for(target, _wirings(grasp_set, harness, target), cache, records)
            survey = Survey(grasp_set, source, samples, ports, search, cuts, equipment, cache)
            played = _stream(survey, stream)
            own = () if build is None else (own_build(build, grasp_set, equipment),)
        cache.expect(estimated_costs(survey))
        untimed = (_UNTIMED.format(list_names(grasp_set.joint_names)),) if records.how == "unknown" else ()
        renewed = (_RENEWED,) if store.renewed else ()
        found = _found(survey, played, wanted or Wanted(), own, (*renewed, *untimed, *lacking))
        if output is not None:
            # The store moves into the new folder as the same file, and must stay locked meanwhile.
            publish_folder(_documents(found), output, kept_entries, FrontierError)
    return found


@contextmanager
def _taken_back_if_refused(made: Sequence[Path]) -> Iterator[None]:
    """Remove files and folders that a run made if its request is refused; files added by others meanwhile stay."""
    try:
        yield
    except (FrontierError, BuildError, HarnessError):
        with suppress(OSError):
            for path in made:
                (path.rmdir if path.is_dir() else path.unlink)()
        raise


def _records(
    grasp_set: GraspSet,
    harness: Harness | None,
    target: str,
    joint_us: float | None,
    record_time: RecordTime,
    filtered: bool,
) -> Records:
    """Return the time of reading the joints, by the best available source."""
    return records_of(
        grasp_set.joint_names,
        joint_us,
        None if harness is None else harness.cyberglove,
        wire_only=record_time == "wire",
        filtered=filtered,
        masked=not reads_by_itself(target),
    )


def _samples(grasp_set: GraspSet) -> Samples:
    """Return the rows of a set in which something is held, checked before any work."""
    n_types = len(np.unique(grasp_set.labels))
    if n_types < 2:
        raise FrontierError(f"the recordings hold {n_types} grasp type(s): there is nothing to distinguish")
    check_types(n_types, FrontierError)
    # All switches and levels at once are tried as well.
    elements = len(grasp_set.switch_names) + TAXEL_LEVELS[-1] * len(grasp_set.taxel_columns)
    check_inputs(n_types, elements, len(grasp_set.joints), FrontierError)
    check_memory(len(grasp_set), n_types, FrontierError)
    check_trials(grasp_set, FrontierError)
    return Samples.of(grasp_set)


def _wirings(grasp_set: GraspSet, harness: Harness | None, target: str) -> tuple[Wiring, ...]:
    return wirings(
        harness,
        target,
        switches=bool(grasp_set.switch_names) or not grasp_set.taxel_columns,
        taxels=bool(grasp_set.taxel_columns),
    )


def _installed(search: Search) -> tuple[Search, tuple[str, ...]]:
    """Return the search without baselines that are not installed, and a sentence on each of these."""
    missing = [name for name in search.baselines if not METHODS[name].installed]
    there = tuple(name for name in search.baselines if name not in missing)
    said = (f"{name} was left out: it needs {METHODS[name].install}, which is not installed" for name in missing)
    return replace(search, baselines=there), tuple(said)


@contextmanager
def _folder(output: Path | None) -> Iterator[Path]:
    if output is None:
        with TemporaryDirectory(prefix="thenar") as folder:
            yield Path(folder)
        return
    output.parent.mkdir(parents=True, exist_ok=True)
    check_folder(output, kept_entries, FrontierError)
    output.mkdir(exist_ok=True)
    yield output


def kept_entries(folder: Path) -> list[str]:
    """Return the entries of a frontier's folder that are kept: the store and the user's files."""
    there = entries(folder)
    if there and not {FRONTIER_NAME, STORE_NAME} & set(there):
        raise FrontierError(f"{folder} is not empty and holds no frontier: name another folder")
    return [path for path in there if path not in _DOCUMENTS]


def _documents(found: Frontier) -> dict[str, bytes]:
    drawn = {f"{name}.svg": data for name, data in pictures(found, "svg").items()}
    return {FRONTIER_NAME: frontier_to_bytes(found), TABLE_NAME: csv_bytes(found), **drawn}


def _stream(survey: Survey, given: GraspSet | None) -> Stream:
    """Return the test rows of the first fold as a stream, or the recordings given for it."""
    grasp_set, seed = survey.grasp_set, survey.search.seed
    number = {grasp: label for label, grasp in enumerate(survey.samples.grasps)} | {NONE: -1}
    if given is None:
        labels = np.array([number[grasp] for grasp in grasp_set.grasps.tolist()], np.intp)
        # The test rows, and the rows of their movements in which nothing is held.
        movements, test = grasp_set.movement_ids, np.flatnonzero(~grasp_set.is_none)[survey.cuts.screening[0].test]
        return stream_of(grasp_set, labels, np.flatnonzero(np.isin(movements, movements[test])), seed=seed)
    if given.fingerprint() == grasp_set.fingerprint():
        raise FrontierError(
            f"the stream equals the training set, {survey.source}: name other recordings with --stream, or leave it "
            "out to use held-out rows"
        )
    if (given.element_names, given.joints) != (grasp_set.element_names, grasp_set.joints):
        raise FrontierError(f"the stream has other switches, taxels or joints than {survey.source}")
    strange = sorted({str(grasp) for grasp in given.grasps} - set(number))
    if strange:
        raise FrontierError(f"the stream holds {strange[0]!r}, which {survey.source} does not")
    labels = np.array([number[str(grasp)] for grasp in given.grasps], dtype=np.intp)
    return stream_of(given, labels, seed=seed)


def estimated_costs(survey: Survey) -> dict[str, float]:
    """Estimate each stage's cost in seconds of one core before any has begun, so that the time left never grows."""
    search, cuts, sizes = survey.search, survey.cuts, [len(survey.elements(most)) for most in survey.levels]
    rows, simulated = len(survey.samples.labels), survey.equipment.model.part is not None
    kinds = available_inputs(sizes[-1], survey.n_joints)
    wired = len(kinds) - ("joints" in kinds)
    train, more = ([len(fold.train) for fold in folds] for folds in (cuts.screening, cuts.others))
    # Once, or for each of the inputs if a method uses joints.
    several = {name: len(sizes) * (wired if METHODS[name].uses_joints else min(wired, 1)) for name in search.methods}
    methods = [name for name, count in several.items() for _ in range(count)]
    choices = sum(len(tried_placements(name, size)) for name in search.methods for size in sizes) * wired + (
        "joints" in kinds
    )
    baselines = sum(len(curve_placements(name, sizes[-1])) for name in search.baselines)
    trainers = [search.alone(name) for name in search.trainers]
    last, again = min(search.finalists + _MARKED, choices), min(_WIDER * search.finalists, choices)
    few = papers_depth(search)
    fewer = min(_FEWER, choices) * sum(size < survey.n_joints for size in JOINTS)

    def settling(some: Sequence[Search], sizes: Sequence[int]) -> float:
        open_ones = [each for each in some if len(each.candidates) > 1]
        return len(kinds) * sum(settle_s(each, size) for each in open_ones for size in sizes)

    def screening(some: Sequence[Search]) -> float:
        return sum(fit_s(each, ((each.screened,), ()), size) for each in some for size in train)

    return {
        "placements": sum(path_s(name, n) for name in methods for n in (rows, *train)),
        "baselines": sum(path_s(name, n) for name in search.baselines for n in train) if wired else 0.0,
        "settings": settling(trainers[:1], (rows, *train)),
        f"settings{OTHER_TRAINERS}": settling(trainers[1:], (rows, *train)),
        "finalists' settings": settling(trainers, more),
        "screening": (_DIFFERENT * choices + baselines) * screening(trainers[:1]),
        f"screening{FEWER_JOINTS}": fewer * screening(trainers[:1]),
        f"screening{OTHER_TRAINERS}": again * screening(trainers[1:]),
        "times": _DIFFERENT * choices * QUICK_PRICE_S,
        f"times{OTHER_TRAINERS}": again * len(trainers[1:]) * QUICK_PRICE_S,
        "finalists' placements": sum(path_s(name, n) for name in methods for n in more),
        "finalists": last * sum(fit_s(search, (search.stages, search.tabled), n) for n in train),
        OTHERS: last * sum(fit_s(few, (few.stages, few.tabled), n) for n in more),
        "prices": last * PRICE_S,
        "simulations": last * _DESIGNS * TRIAL_S * simulated,
        "checks": _CHECKED * TRIAL_S * simulated,
        "latencies": last * (2.0 + _DESIGNS * (_LEARNT_S if survey.grasp_set.is_none.any() else 1.0)),
    }


def _found(survey: Survey, stream: Stream, wanted: Wanted, own: tuple[Mark, ...], lacking: tuple[str, ...]) -> Frontier:
    search, n_switches, most = survey.search, survey.samples.n_switches, survey.levels[-1]
    n_elements = len(survey.elements(most))
    screened, curves = screen(survey)
    if not screened:
        raise FrontierError(
            f"no placement that was tried can be built for {survey.equipment.model.target}: name other --methods or "
            "another --target"
        )
    several = finalists(screened, (), _WIDER * search.finalists)
    screened += screen_fewer(survey, finalists([one for one in screened if one.choice.joints], (), _FEWER))
    screened += screen_others(survey, several)
    named = choices_to_mark(n_elements, survey.n_joints, search.trainers[0], most)
    closes = look_closely(survey, finalists(screened, list(named), search.finalists))
    every = [design for close in closes for design in designs(close, survey.transfer(close.screened.choice))]
    by_time, by_switches = best_designs(every)
    kept, checks, skipped = measured(with_whole_scans([*by_time, *by_switches]), survey.equipment, survey.cache)
    luck = lucks((by_time, by_switches), every, screened, survey.cuts, search.seed)
    points = points_of(kept, _latencies(survey, stream, kept), luck, survey.names, survey.training, survey.some_joints)
    picked, tried = wanted.pick(points), _tried(screened, closes, search)
    claimed = [sentence(INDEPENDENT)] if survey.grasp_set.independent else []
    early = [_EARLY] if any(design.scan_kind == "early" for design in kept) else []
    return Frontier(
        schema=SCHEMA,
        thenar=version("thenar"),
        source=survey.source,
        fingerprint=survey.grasp_set.fingerprint(),
        rows=len(survey.samples.labels),
        trials=len(survey.cuts.people),
        subjects=len(np.unique(survey.cuts.people)),
        by=survey.cuts.by,
        n_switches=n_switches,
        n_taxels=len(survey.grasp_set.taxel_columns),
        n_levels=n_elements - n_switches,
        n_joints=survey.n_joints,
        grasps=survey.samples.grasps,
        target=survey.equipment.model.target,
        folds=search.folds,
        repeats=len(survey.cuts.repeats),
        combinations=sum(len(design.decisions) for design in every) + len(tried),
        points=points,
        tried=tried,
        curves=curves,
        marks=(*marks_of(named, closes, survey), *own),
        checks=checks,
        skipped=(*lacking, *claimed, *skipped, *early, stream.what),
        picked=None if picked is None else picked.number,
        wanted=wanted.words,
    )


def _latencies(survey: Survey, stream: Stream, kept: Sequence[Design]) -> Latencies:
    """Return the latency of every design with every decision that it allows, by tables trained on rows outside the
    stream of held-out rows.
    """
    fold, grouped = survey.cuts.screening[0], dict[Candidate, list[Design]]()
    moving = Moving.of(survey.grasp_set, fold.train, survey.search.seed)
    for design in kept:
        grouped.setdefault(design.close.screened.choice, []).append(design)
    calls = [
        latencies.call(
            2.0 + len(mine) * (_LEARNT_S if moving else 1.0),
            survey.read(choice, fold),
            fold.train,
            survey.columns(choice, fold),
            stream.with_elements(survey.elements(choice.levels, fold)).with_joints(survey.joints(choice, fold)),
            tuple(
                Pace(design.tables.tabled, design.frame.us, design.decisions, design.slow_us, design.asked)
                for design in mine
            ),
            survey.training(choice, fold),
            moving and moving.reading(survey.elements(choice.levels, fold), survey.joints(choice, fold)),
        )
        for choice, mine in grouped.items()
    ]
    return {
        (design, kind): latency
        for mine, found in zip(grouped.values(), survey.cache.ask("latencies", calls), strict=True)
        for design, several in zip(mine, found, strict=True)
        for kind, latency in zip(design.decisions, several, strict=True)
    }


def _tried(screened: Sequence[Screened], closes: Sequence[Close], search: Search) -> tuple[Tried, ...]:
    """Return everything that was screened, and the finalists after every stage of their training."""
    searches = {name: search.alone(name) for name in search.trainers}
    first = [(one, searches[one.choice.trainer].screened, one.judged.rate) for one in screened]
    then = [(close.screened, rounds, rate) for close in closes for rounds, rate in close.stages.items()]
    return tuple(
        Tried(
            one.choice.placement,
            one.choice.inputs,
            len(one.columns),
            rounds if searches[one.choice.trainer].staged else None,
            rate,
            one.frame_us,
            sys.intern(one.choice.trainer),
            one.choice.keep_joints,
            one.choice.levels,
        )
        for one, rounds, rate in (*first, *then)
    )


def _unheard(_done: int, _total: int) -> None:
    pass


# The paper's S.
_PAPERS = (62.0,)


def choices_to_mark(
    n_switches: int, n_joints: int, trainer: str = PAPERS_TRAINER, levels: int | None = None
) -> dict[Candidate, str]:
    """Return the choices to mark, with their names: the paper's placement and all switches, alone and with the joints;
    with `levels` levels of each taxel.
    """
    if not n_switches:
        return {}
    marked = {PlacementChoice(PAPERS, prune): f"paper, S = {prune:g}" for prune in _PAPERS}
    # Keeping all switches is the same by any method.
    marked[PlacementChoice(BEST, float(n_switches))] = f"all of {n_switches}"
    alone = {Candidate(choice, "switches", trainer, levels=levels): name for choice, name in marked.items()}
    with_joints = {replace(one, inputs="both"): f"{name}, joints" for one, name in alone.items()}
    return alone | (with_joints if n_joints else {})


def marks_of(named: dict[Candidate, str], closes: Sequence[Close], survey: Survey) -> tuple[Mark, ...]:
    """Return the marks of those choices that were fully evaluated, with the paper's rounds and whole scans."""
    found, tabled = [], papers_tables(survey.search)
    for close in closes:
        screened = close.screened
        if screened.choice in named:
            priced = next(tables for tables in close.priced if tables.tabled == tabled)
            us = priced.fastest_us(survey.transfer(screened.choice).us)
            if us is not None:
                found.append(Mark(named[screened.choice], len(screened.columns), close.tables[tabled].rate, us))
    return tuple(found)


def own_build(folder: Path, grasp_set: GraspSet, equipment: Equipment) -> Mark:
    """Return the user's build as a mark: its recorded rate, and its frame in the fastest wiring for its switches.

    Raises FrontierError if it has no rate, or is not for these recordings or this equipment.
    """
    build = Build.load(folder)
    manifest = build.manifest
    names = [switch.name for switch in manifest.switches]
    # Comparable with the frontier's rates.
    pooled = [rate for rate in manifest.rates if rate.protocol != "training" and not rate.of.startswith("new")]
    if not pooled:
        raise FrontierError(f"{folder} has no accuracy: compile it with --folds 4, or leave --build out")
    options, fitting = equipment.model.options(build.tables), equipment.fitting(names)
    if not options or (names and not fitting):
        raise FrontierError(f"{folder} cannot be built for {equipment.model.target}: leave --build out, or --target")
    joints = [joint.name for joint in manifest.joints]
    sources = _places([switch.source for switch in manifest.switches], grasp_set.element_names, folder)
    above_codes = [0 if switch.threshold is None else switch.threshold.code for switch in manifest.switches]
    bits = above(grasp_set.switches, grasp_set.taxels, tuple(map(Element, sources, above_codes)))
    codes = grasp_set.codes[:, _places(joints, [joint.name for joint in grasp_set.joints], folder)]
    scans = [scan_times(names, build.tables, wiring, bits, codes, equipment.overhead).full_us for wiring in fitting]
    frame_us = max(min(scans, default=0.0), equipment.records.of(len(joints)).us) + options[0].us
    return Mark(
        f"build {folder.name}", len(names), Rate.counted((pooled[0].correct,), pooled[0].total, of="pooled"), frame_us
    )


def _places(names: Sequence[str], there: Sequence[str], folder: Path) -> list[int]:
    for name in names:
        if name not in there:
            raise FrontierError(
                f"{folder} reads {name!r}, which the recordings do not hold: it was compiled from others"
            )
    return [there.index(name) for name in names]

"""Find a frontier from recordings: screen everything, evaluate candidates near the front fully, assemble the result."""

import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from importlib.metadata import version
from itertools import filterfalse
from os.path import lexists
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from msgspec.structs import replace as changed_to

from thenar.runtime.errors import HarnessError
from thenar.runtime.files import write_atomically
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.names import list_names

from ..placement.constraints import Limits
from ..placement.methods.base import usual
from ..placement.ports import ports_of_whole_glove
from ..publication import check_folder, entries, publish_folder
from ..recogniser import check_inputs
from ..recordings.graspset import GraspSet
from ..recordings.summary import check_trials
from ..samples import Samples, check_types
from ..text import INDEPENDENT, sentence
from ..workers import check_memory
from .cache import Cache, Report, Store
from .designs import best_designs, designs_of, lucks, points_of
from .finalists import (
    EvaluatedFinalist,
    Screened,
    evaluate_finalists,
    marks_of,
    recipes_to_mark,
    screen,
    screen_fewer,
    screen_others,
    select_finalists,
)
from .plots import picture
from .points import SCHEMA, Frontier, FrontierError, Tried, frontier_to_bytes
from .price import equipment_for
from .search import TAXEL_LEVELS, Search, placement_of
from .survey import Cuts, Survey
from .words import csv_bytes

FRONTIER_NAME, TABLE_NAME, PICTURE_NAME, STORE_NAME = "frontier.json", "frontier.csv", "frontier.svg", "store.sqlite"
_DOCUMENTS = frozenset({FRONTIER_NAME, TABLE_NAME, PICTURE_NAME})
# Placements to screen with the other trainers, as a multiple of the finalists.
_WIDER = 3
# Number of placements to try with fewer joints.
_FEWER = 5
# Calls of `Cache.ask`: the calibration, four to screen, four with fewer joints, three with other trainers, five for the
# finalists, the simulations; one more for own trials.
_ROUNDS = 18
_UNTIMED = "the time of reading the joints ({}) is unknown and is left out of every frame time: give it with --joint-us"


def find_frontier(
    grasp_set: GraspSet,
    output: Path | None = None,
    *,
    source: str = "recordings",
    harness: Harness | None = None,
    target: str = "host",
    search: Search | None = None,
    budget_us: float | None = None,
    rate: float | None = None,
    joint_us: float | None = None,
    own_trials: int = 0,
    limits: Limits | None = None,
    jobs: int = -1,
    report: Report | None = None,
    rough: Callable[[Frontier], None] | None = None,
) -> Frontier:
    """Find the trade-off of accuracy and time: the best switches, joints, rounds, tables and wirings.

    Every placement is screened by nested cross-validation; those near the front are fully evaluated, priced for the
    target, and simulated there.

    Parameters
    ----------
    grasp_set : GraspSet
        Recordings of at least two grasp types; no fold splits a trial. Rows in which nothing is held are left
        out.
    output : Path, optional
        Folder for frontier.json, frontier.csv, the picture, and the store, from which an interrupted run resumes.
        By default nothing is written or stored.
    source : str
        Name of the recordings.
    harness : Harness, optional
        A glove's wiring: it is tried as well, and switches are chosen by the cost of its ports.
    target : str
        Deployment target, one of `thenar.compiler.frontier.targets.TARGETS`.
    search : Search, optional
        Size of the search.
    budget_us, rate : float, optional
        Pick the best point within this time of a frame, or the fastest of this accuracy.
    joint_us : float, optional
        Time of reading all joints, in microseconds. By default it is that of a CyberGlove's record, as measured for
        the harness, else by the vendor's formula; of other joints it is left out of every frame, and a sentence of
        `skipped` says so.
    own_trials : int
        Also evaluate the points for new subjects, before and after this number of own trials of each type; 0: do not.
    limits : Limits, optional
        The sensors to keep or to leave out, and prices, for a search among sensors.
    jobs : int
        Worker processes, -1 for all cores.
    report : callable, optional
        Called with the done and total steps; every round of work has the same number of them.
    rough : callable, optional
        Called after the first screening, with a frontier of which only what was tried is known. Its picture is in
        `output` until the finished one replaces it.

    Returns
    -------
    Frontier
        A point's rate is corrected for the selection of the best of many; see `thenar.compiler.evaluation.rates.Draws`.

    Raises
    ------
    FrontierError
        If the recordings do not fit, there is no such target, nothing can be built, or the folder holds other things.
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
    search = search or Search(methods=usual(wired=harness is not None or bool(grasp_set.taxel_columns)))
    if limits is not None and not search.by_sensors:
        raise FrontierError("``have``, ``never`` and ``prices`` are for ``sensors`` or ``price``: add one of these")
    cuts = Cuts.of(samples, search)
    if own_trials and not cuts.subjects:
        raise FrontierError("own trials are those of a subject who is left out: record two or more subjects")
    types = samples.labels[np.unique(cuts.trials, return_index=True)[1]]
    trials_of_a_type = Counter(zip(cuts.people.tolist(), types.tolist(), strict=True))
    if own_trials >= max(trials_of_a_type.values()):
        raise FrontierError(f"nobody has more than {own_trials} trials of a type: adapt to fewer")
    ports = ports_of_whole_glove(harness, grasp_set.element_names, len(grasp_set.taxel_columns))
    created = [] if output is None else [*filterfalse(lexists, (output / STORE_NAME, output, *output.parents))]
    with _folder(output) as folder, Store(folder / STORE_NAME, f"thenar {version('thenar')}") as store:
        cache = Cache(store, report or (lambda _done, _total: None), _ROUNDS + bool(own_trials), jobs=jobs)
        with _remove_created_on_error(created, store):
            equipment = equipment_for(grasp_set, harness, target, cache, joint_us)
            survey = Survey(grasp_set, source, samples, ports, search, cuts, equipment, cache, limits)
        untimed = [_UNTIMED.format(list_names(grasp_set.joint_names))] if equipment.records.how == "unknown" else []

        def show_rough(early: Frontier) -> None:
            if output is not None:
                write_atomically(output / PICTURE_NAME, picture(early, "svg"))
            if rough is not None:
                rough(early)

        frontier = _found(survey, own_trials, show_rough)
        frontier = changed_to(
            frontier,
            skipped=(*untimed, *frontier.skipped),
            picked=_picked(frontier, budget_us, rate),
            wanted=_in_words(budget_us, rate),
        )
        if output is not None:
            # The store moves into the new folder as the same file, and stays locked meanwhile.
            store.finish()
            files = frontier_to_bytes(frontier), csv_bytes(frontier), picture(frontier, "svg")
            named = dict(zip((FRONTIER_NAME, TABLE_NAME, PICTURE_NAME), files, strict=True))
            publish_folder(named, output, kept_entries, FrontierError)
    return frontier


@contextmanager
def _remove_created_on_error(created: Sequence[Path], store: Store) -> Iterator[None]:
    """Remove files and folders that a run made if its request is refused; files added by others meanwhile stay."""
    try:
        yield
    except (FrontierError, HarnessError):
        store.finish()
        with suppress(OSError):
            for path in created:
                (path.rmdir if path.is_dir() else path.unlink)()
        raise


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


def _found(survey: Survey, own_trials: int, rough: Callable[[Frontier], None]) -> Frontier:
    """Return the frontier of a survey, without a picked point; call `rough` with what the first screening tried."""
    search, equipment, n_switches = survey.search, survey.equipment, survey.samples.n_switches
    screened = screen(survey)
    if not screened:
        raise FrontierError(
            f"no placement that was tried can be built for {equipment.model.target}: name other ``methods`` or "
            "another ``target``"
        )
    claimed = [sentence(INDEPENDENT)] if survey.grasp_set.independent else []
    model = equipment.model
    notes = filter(None, (model.unmeasured, model.note, equipment.overhead.what, equipment.records.what))
    tried = _tried(screened, (), search)
    frontier = Frontier(
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
        n_levels=survey.size(survey.levels[-1]) - n_switches,
        n_joints=survey.inputs.n_joints,
        grasps=survey.samples.grasps,
        target=model.target,
        machine=model.machine,
        folds=search.folds,
        repeats=len(survey.cuts.repeats),
        combinations=len(tried),
        points=(),
        tried=tried,
        marks=(),
        have=() if survey.limits is None else survey.limits.keep,
        never=() if survey.limits is None else survey.limits.never,
        price=search.price,
        prices={} if survey.limits is None else dict(survey.limits.prices),
        own_trials=own_trials,
        skipped=(*claimed, *notes),
    )
    rough(frontier)
    fewer = screen_fewer(
        survey, select_finalists([one for one in screened if one.recipe.inputs != "switches"], (), _FEWER)
    )
    others = screen_others(survey, select_finalists(screened, (), _WIDER * search.finalists))
    screened += (*fewer, *others)
    recipes = recipes_to_mark(survey)
    finalists = evaluate_finalists(survey, select_finalists(screened, recipes, search.finalists))
    designs = [
        design for finalist in finalists for design in designs_of(finalist, survey.transfer(finalist.screened.recipe))
    ]
    tried = _tried(screened, finalists, search)
    luck = lucks(designs, screened, survey)
    kept = list(dict.fromkeys(design for front in best_designs(designs) for design in front))
    times = survey.measured(design.tables.content for design in kept)
    kept = [replace(design, measured=times.get(design.tables.content)) for design in kept]
    adapted = survey.adapted([design.tables.recipe for design in kept], own_trials) if own_trials else {}
    return changed_to(
        frontier,
        combinations=len(designs) + len(tried),
        points=points_of(kept, luck, adapted, survey),
        tried=tried,
        marks=marks_of(recipes, finalists, survey),
    )


def _picked(frontier: Frontier, budget_us: float | None, rate: float | None) -> int | None:
    """Return the number of the selected point: the best within a time, or the fastest of an accuracy; None: none."""
    if budget_us is not None:
        quick = [point for point in frontier.points if point.frame.us <= budget_us]
        # By the rates that points were chosen by, for which their luck was estimated.
        chosen = max(quick, key=lambda point: (point.rate.mean + point.luck, -point.frame.us), default=None)
    else:
        good = [point for point in frontier.points if rate is not None and point.rate.mean >= rate]
        chosen = min(good, key=lambda point: (point.frame.us, -point.rate.mean), default=None)
    return None if chosen is None else chosen.number


def _in_words(budget_us: float | None, rate: float | None) -> str:
    """Return the goal for which a point is to be picked, "" for none."""
    if budget_us is not None:
        return f"the best within {budget_us:g} µs a frame"
    return "" if rate is None else f"the fastest that recognises {100 * rate:g} %"


def _tried(screened: Sequence[Screened], finalists: Sequence[EvaluatedFinalist], search: Search) -> tuple[Tried, ...]:
    """Return everything that was screened, and the finalists after every stage of their training."""
    searches = {name: search.alone(name) for name in search.trainers}
    first = [(one, searches[one.recipe.trainer].screened, one.judged.rate) for one in screened]
    then = [(finalist.screened, rounds, rate) for finalist in finalists for rounds, rate in finalist.stages.items()]
    return tuple(
        Tried(
            placement=placement_of(one.recipe),
            inputs=one.recipe.inputs,
            n_switches=one.size,
            rounds=rounds if searches[one.recipe.trainer].staged else None,
            rate=rate,
            frame_us=one.frame_us,
            # msgspec omits a name that equals the default only if it is the very same string.
            trainer=sys.intern(one.recipe.trainer),
            keep_joints=one.recipe.keep_joints,
            levels=one.recipe.levels,
        )
        for one, rounds, rate in (*first, *then)
    )

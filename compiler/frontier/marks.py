"""The marks of a frontier's pictures: the paper's placement, all switches, and the user's build."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from thenar.runtime.build import Build
from thenar.runtime.recipe import PAPERS_TRAINER

from ..evaluation.rates import Rate
from ..placement.methods.base import BEST, PAPERS
from ..recordings.graspset import GraspSet
from .equipment import Equipment
from .finalists import EvaluatedFinalist, papers_tables
from .points import FrontierError, PlacementChoice, ReferencePoint
from .search import Candidate
from .survey import Survey
from .timing.scan_times import scan_times

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


def marks_of(
    named: dict[Candidate, str], closes: Sequence[EvaluatedFinalist], survey: Survey
) -> tuple[ReferencePoint, ...]:
    """Return the marks of those choices that were fully evaluated, with the paper's rounds."""
    found, tabled = [], papers_tables(survey.search)
    for close in closes:
        screened = close.screened
        if screened.choice in named:
            priced = next(tables for tables in close.priced if tables.tabled == tabled)
            us = priced.fastest_us(survey.transfer(screened.choice).us)
            if us is not None:
                found.append(
                    ReferencePoint(named[screened.choice], len(screened.elements), close.tables[tabled].rate, us)
                )
    return tuple(found)


def own_build(folder: Path, grasp_set: GraspSet, equipment: Equipment) -> ReferencePoint:
    """Return the user's build as a mark: its recorded rate, and its frame in the fastest wiring for its switches.

    Raises FrontierError if it has no rate, or is not for these recordings or this equipment.
    """
    build = Build.load(folder)
    manifest = build.manifest
    names = [switch.name for switch in manifest.switches]
    # Comparable with the frontier's rates.
    pooled = [rate for rate in manifest.rates if rate.protocol != "training" and not rate.of.startswith("new")]
    if not pooled:
        raise FrontierError(f"{folder} has no accuracy: compile it with ``folds`` 4, or leave ``build`` out")
    cost, fitting = equipment.model.cost(build.tables), equipment.fitting(names)
    if cost is None or (names and not fitting):
        raise FrontierError(
            f"{folder} cannot be built for {equipment.model.target}: leave ``build`` out, or ``target``"
        )
    joints = [joint.name for joint in manifest.joints]
    _check([switch.source for switch in manifest.switches], grasp_set.element_names, folder)
    _check(joints, [joint.name for joint in grasp_set.joints], folder)
    scans = [scan_times(names, wiring, equipment.overhead).us for wiring in fitting]
    frame_us = max(min(scans, default=0.0), equipment.records.of(len(joints)).us) + cost.us
    return ReferencePoint(
        f"build {folder.name}", len(names), Rate.counted((pooled[0].correct,), pooled[0].total, of="pooled"), frame_us
    )


def _check(names: Sequence[str], there: Sequence[str], folder: Path) -> None:
    """Raise FrontierError if the recordings lack an input of the build."""
    for name in names:
        if name not in there:
            raise FrontierError(
                f"{folder} reads {name!r}, which the recordings do not hold: it was compiled from others"
            )

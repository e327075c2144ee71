"""What is marked beside the points: the paper's placements, all switches, the user's own build."""

from collections.abc import Sequence
from pathlib import Path

from thenar.runtime.build import Build

from ..placement.methods.base import BEST, PAPERS
from ..recordings.graspset import GraspSet
from .equipment import Equipment
from .finalists import Close, papers_tables
from .points import FrontierError, Mark, Way
from .screen import rate_of
from .search import Candidate
from .survey import Survey
from .timing.scan_times import scan_times, transfer_us

# The paper's S.
_PAPERS = (62.0,)


def choices_to_mark(n_switches: int, n_joints: int) -> dict[Candidate, str]:
    """Return what to mark, with its name: the paper's placement and all switches, alone and with the joints."""
    if not n_switches:
        return {}
    marked = {Way(PAPERS, prune): f"paper, S = {prune:g}" for prune in _PAPERS}
    # Whichever method says so, to keep all of them is the same.
    marked[Way(BEST, float(n_switches))] = f"all of {n_switches}"
    alone = {Candidate(way, "switches"): name for way, name in marked.items()}
    return alone | ({Candidate(way, "both"): f"{name}, joints" for way, name in marked.items()} if n_joints else {})


def marks_of(named: dict[Candidate, str], closes: Sequence[Close], survey: Survey) -> tuple[Mark, ...]:
    """Return the marks of these choices that were looked at closely, with the paper's rounds and whole scans."""
    found, tabled = [], papers_tables(survey.search)
    for close in closes:
        screened = close.screened
        if screened.choice in named:
            priced = next(tables for tables in close.priced if tables.tabled == tabled)
            us = priced.fastest_us(survey.n_joints if screened.choice.joints else 0)
            if us is not None:
                found.append(Mark(named[screened.choice], len(screened.columns), close.rates[tabled], us))
    return tuple(found)


def own_build(folder: Path, grasp_set: GraspSet, equipment: Equipment) -> Mark:
    """Return the user's own build as a mark: its rate as it says, its frame in the fastest wiring for its switches.

    Raises FrontierError where it does not say, or is not for these recordings or this equipment.
    """
    build = Build.load(folder)
    manifest = build.manifest
    names = [switch.name for switch in manifest.switches]
    honest = [rate for rate in manifest.rates if rate.protocol == "honest"]
    if not honest:
        raise FrontierError(
            f"{folder} does not say what it recognises: compile it with --folds 4, or leave --build out"
        )
    rate, options, wirings = honest[-1], equipment.model.options(build.tables), equipment.fitting(names)
    if not options or (names and not wirings):
        raise FrontierError(f"{folder} cannot be built for {equipment.model.target}: leave --build out, or --target")
    joints = [joint.name for joint in manifest.joints]
    bits = grasp_set.switches[:, _places(names, grasp_set.switch_names, folder)]
    codes = grasp_set.codes[:, _places(joints, [joint.name for joint in grasp_set.joints], folder)]
    scans = [scan_times(names, build.tables, wiring, bits, codes, equipment.beside).full_us for wiring in wirings]
    frame_us = max(min(scans, default=0.0), transfer_us(len(joints))) + options[0].us
    return Mark(f"build {folder.name}", len(names), rate_of((rate.correct,), rate.total), frame_us)


def _places(names: Sequence[str], there: Sequence[str], folder: Path) -> list[int]:
    for name in names:
        if name not in there:
            raise FrontierError(
                f"{folder} reads {name!r}, which the recordings do not hold: it was compiled from others"
            )
    return [there.index(name) for name in names]

"""The one sentence that reads the frontier's picture."""

from ...text import counted, duration, interval, listed, percent
from ..points import Frontier, Mark, Point
from .words import featured


def sentence(frontier: Frontier) -> str:
    """Return so many switches, so much time, so much recognition, against the marks; or that there are no points."""
    point = featured(frontier)
    if point is None:
        return f"Of {frontier.combinations:,} combinations none is a point of the frontier."
    said = (
        f"Point {point.number}: {_inputs(frontier, point)}, read and classified in {duration(point.frame.us)} "
        f"on {frontier.target}, recognise {interval(point.rate)} % of the grasps"
    )
    against = [_mark(mark) for mark in frontier.marks]
    return f"{said}, against {listed(against)}." if against else f"{said}."


def _inputs(frontier: Frontier, point: Point) -> str:
    some = f"{len(point.switches)} of {frontier.n_switches} switches"
    joints = counted(frontier.n_joints, "joint")
    return {"switches": some, "joints": joints, "both": f"{some} and {joints}"}[point.setting.inputs]


def _mark(mark: Mark) -> str:
    name = (
        mark.name
        if str(mark.n_switches) in mark.name
        else f"{counted(mark.n_switches, 'switch', 'switches')} ({mark.name})"
    )
    return f"{percent(mark.rate.mean)} in {duration(mark.frame_us)} with {name}"

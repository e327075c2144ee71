"""How a frontier's points are named, on pictures, in tables and in the sentence."""

from ...text import counted
from ..points import Frontier, Mark, Point, Setting

_LONGEST = 40  # letters of a name on a picture
_SPARED = 0.005  # what a rate may lack and still count as level: half a point


def inputs_of(point: Point) -> str:
    """Return what a point reads: "33 switches", "joints alone", "8 switches + joints"."""
    if point.setting.inputs == "joints":
        return "joints alone"
    return counted(len(point.switches), "switch", "switches") + (" + joints" if point.setting.inputs == "both" else "")


def shorten(name: str) -> str:
    """Return a name that has room on a picture: one line of at most 40 letters."""
    line = " ".join(name.split())
    return line if len(line) <= _LONGEST else f"{line[: _LONGEST - 3]}..."


def way_of(setting: Setting) -> str:
    """Return how switches were chosen: "id3 62"."""
    return f"{setting.way.method} {setting.way.parameter:g}"


def wiring_of(setting: Setting) -> str:
    """Return wiring and clock: "mcp23017 400 kHz", "board 1 Mbaud"; nothing where no switch is read."""
    if not setting.clock_hz:
        return ""
    unit = "baud" if setting.wiring == "board" else "Hz"
    for letter, size in (("M", 1_000_000), ("k", 1_000)):
        if setting.clock_hz >= size:
            return f"{setting.wiring} {setting.clock_hz / size:g} {letter}{unit}"
    return f"{setting.wiring} {setting.clock_hz} {unit}"


def featured(frontier: Frontier) -> Point | None:
    """Return the point to speak of: the picked one; else the fastest that is level with the mark of most switches,
    within half a point of recognition; else the best. None where there are no points.
    """
    if frontier.picked is not None:
        return frontier.point(frontier.picked)
    goal = most_switches(frontier)
    level = [each for each in frontier.points if goal is not None and each.rate.mean >= goal.rate.mean - _SPARED]
    if level:
        return min(level, key=lambda each: (each.frame.us, -each.rate.mean, each.number))
    return max(frontier.points, key=lambda each: (each.rate.mean, -each.frame.us, -each.number), default=None)


def most_switches(frontier: Frontier) -> Mark | None:
    """Return the mark of most switches, the first of equals: what a reduced glove is held against."""
    return max(frontier.marks, key=lambda mark: mark.n_switches, default=None)

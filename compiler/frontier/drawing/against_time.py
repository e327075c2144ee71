"""Rate against a cost in time, logarithmic: of a frame, and of a decision."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...text import duration
from ..points import Frontier, Mark, Point, Tried
from .artists import (
    draw_best,
    draw_marks,
    draw_points,
    draw_tails,
    draw_tried,
    loud_label,
    mark_label,
    point_label,
    ring,
)
from .chart import key, rates, sheet, times
from .labels import Label, Labels
from .words import featured, inputs_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DECISIONS = {"single": "one frame", "dwell": "dwell", "sequential": "sequential test"}


@dataclass(frozen=True, slots=True)
class _Cost:
    """What a picture holds the rate against: on which line of best points, in which words, and where a point stands."""

    title: str
    front: str
    best: str
    axis: str
    of_point: Callable[[Point], float]
    end: Callable[[Point], float]  # of a line from the point to the right; the point itself: no line
    of_mark: Callable[[Mark], float | None]
    shows: Callable[[Point], bool]
    tried: Callable[[Frontier], tuple[Tried, ...]]
    words: Callable[[Point], str]


_FRAME = _Cost(
    title="What accuracy costs in time",
    front="frame",
    best="the best for its time",
    axis="time of a frame: the glove read, the grasp classified",
    of_point=lambda point: point.frame.us,
    end=lambda point: point.frame.us,
    tried=lambda frontier: frontier.tried,
    of_mark=lambda mark: mark.frame_us,
    # A frame takes as long whatever is made of its answer: other decisions would lie on the same places.
    shows=lambda point: point.fronts != ("latency",),
    words=inputs_of,
)
_LATENCY = _Cost(
    title="From the hand's arrival to the decision",
    front="latency",
    best="the best for its latency",
    axis="time until a grasp is decided on: its mean, and a line to the 99th percentile",
    of_point=lambda point: point.latency.mean_us,
    end=lambda point: point.latency.p99_us,
    tried=lambda _: (),
    of_mark=lambda mark: mark.latency_us,
    shows=lambda point: "latency" in point.fronts,
    words=lambda point: _DECISIONS[point.setting.decision],
)


def draw_frontier(frontier: Frontier) -> "Figure":
    """Return rate against frame time, all that was tried in the background. To be called inside `painting`."""
    return _draw(frontier, _FRAME)


def draw_latency(frontier: Frontier) -> "Figure":
    """Return rate against decision latency, mean and 99th percentile. To be called inside `painting`."""
    return _draw(frontier, _LATENCY)


def _draw(frontier: Frontier, cost: _Cost) -> "Figure":
    figure, axes = sheet(frontier, cost.title)
    marks = [(us, mark) for mark in frontier.marks if (us := cost.of_mark(mark)) is not None]
    shown = [point for point in frontier.points if cost.shows(point)]
    rates(axes, [*(point.rate for point in shown), *(mark.rate for _, mark in marks)])
    tried = [(each.frame_us, each) for each in cost.tried(frontier) if each.rate.mean >= axes.get_ylim()[0]]
    points = [(cost.of_point(point), point, cost.front in point.fronts) for point in shown]
    tails = [(x, cost.end(point), point) for x, point, _ in points]
    all_us = (
        *(us for us, _ in marks),
        *(us for us, _ in tried),
        *(us for us, _, _ in points),
        *(end for _, end, _ in tails),
    )
    times(axes, all_us, cost.axis)

    labels = Labels(axes)
    draw_tried(axes, labels, tried)
    draw_best(axes, labels, [(x, point.rate.mean) for x, point, best in points if best], cost.best)
    draw_tails(axes, labels, [tail for tail in tails if tail[0] != tail[1]])
    draw_points(axes, labels, points)
    draw_marks(axes, labels, marks)
    ring(axes, [(x, point) for x, point, _ in points if point is featured(frontier)])
    key(axes)
    labels.write(*_labels(frontier, shown, cost, marks))
    return figure


def _labels(
    frontier: Frontier, shown: Sequence[Point], cost: _Cost, marks: list[tuple[float, Mark]]
) -> Iterator[Label]:
    """Yield what is written, what takes most room first."""
    spoken_of = featured(frontier)
    if spoken_of in shown:
        assert spoken_of is not None
        us = cost.of_point(spoken_of)
        yield loud_label(us, spoken_of, duration(us))
    for us, mark in marks:
        yield mark_label(us, mark, duration(us))
    for point in shown:
        if point is not spoken_of:
            yield point_label(cost.of_point(point), point, cost.words(point))

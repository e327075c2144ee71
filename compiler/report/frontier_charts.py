"""Three charts of a frontier: rate against frame time, number of switches and latency. A click picks a point."""

from collections.abc import Iterable, Sequence

from ..frontier.points import Frontier, Point
from ..text import NBSP
from .charts import Chart, axis, figure, logarithmic
from .frontier_traces import (
    Cost,
    Placed,
    Trace,
    best_line,
    curve_traces,
    mark_names,
    percent_of,
    point_traces,
    screened,
    short,
    stars,
)


def frontier_charts(frontier: Frontier) -> tuple[Chart, ...]:
    """Return the three charts; those without anything to show are left out."""
    if not frontier.points:
        return ()
    return (_by_frame(frontier), _by_switches(frontier), _by_latency(frontier))


def _by_frame(frontier: Frontier) -> Chart:
    points = frontier.points
    marks = [(mark.frame_us, mark) for mark in frontier.marks if mark.frame_us > 0]
    traces = [screened(frontier.tried), best_line(points, "frame", _frame_us), *point_traces(points, _frame_us)]
    caption = (
        f"Recognition rate against frame time. The line joins the best for their time; bars are 95{NBSP}% intervals."
    )
    return _chart("by-frame", caption, traces, marks, points, _frame_us, "Frame time, µs (logarithmic)")


def _by_switches(frontier: Frontier) -> Chart:
    points = [point for point in frontier.points if point.switches]
    traces = [*curve_traces(frontier.curves), *point_traces(points, _switches)]
    marks = [(float(mark.n_switches), mark) for mark in frontier.marks if mark.n_switches]
    caption = (
        "Recognition rate against the number of switches: curves are of switches alone, ours bold, rivals dotted. "
        "Points without switches are not on it."
    )
    return _chart("by-switches", caption, traces, marks, points, _switches, "Switches (logarithmic)")


def _by_latency(frontier: Frontier) -> Chart:
    points = [point for point in frontier.points if point.latency.mean_us > 0]
    marks = [(mark.latency_us, mark) for mark in frontier.marks if mark.latency_us]
    traces = [best_line(points, "latency", _latency_us), *point_traces(points, _latency_us, to_p99=True)]
    caption = (
        "Recognition rate against decision latency, from the hand's arrival in a grasp until it is decided on: the "
        "mean, and to its right the 99th percentile. Grasps that were missed are in neither, and points that miss all "
        "are not on it."
    )
    return _chart("by-latency", caption, traces, marks, points, _latency_us, "Decision latency, µs (logarithmic)")


def _chart(
    ident: str,
    caption: str,
    traces: Iterable[Trace],
    marks: Sequence[Placed],
    points: Sequence[Point],
    cost: Cost,
    title: str,
) -> Chart:
    drawn = [trace for trace in (*traces, stars(marks)) if trace["x"]]
    ring: Trace = {
        "type": "scatter",
        "mode": "markers",
        "name": "picked",
        "x": [],
        "y": [],
        "hoverinfo": "skip",
        "marker": {"symbol": "circle-open", "size": 22, "color": "var(--picked)", "line": {"width": 3}},
    }
    costs = [value for trace in drawn for value in trace["x"]]
    places = {str(point.number): [short(cost(point)), percent_of(point.rate)] for point in points}
    made = figure(
        [*drawn, ring],
        meta={"ring": len(drawn), "places": places},
        xaxis=logarithmic(title, costs),
        yaxis=axis("Recognised, %"),
        annotations=list(mark_names(marks, costs, [value for trace in drawn for value in trace["y"]])),
    )
    return Chart(ident, caption, made)


def _frame_us(point: Point) -> float:
    return point.frame.us


def _switches(point: Point) -> float:
    return float(len(point.switches))


def _latency_us(point: Point) -> float:
    return point.latency.mean_us

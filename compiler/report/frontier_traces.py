"""The traces of a frontier's charts, as Plotly takes them."""

from collections.abc import Callable, Iterable, Sequence
from math import log10
from typing import Any

from ..frontier.pareto import front
from ..frontier.points import Curve, Mark, Point, Rate, Tried
from ..text import interval, microseconds
from .charts import words
from .point_view import point_words

Trace = dict[str, Any]
Cost = Callable[[Point], float]
Placed = tuple[float, Mark]  # where across

_HOVER = "%{text}<extra></extra>"
_INPUTS = {
    "both": ("switches and joints", "circle", "var(--both)"),
    "switches": ("switches", "square", "var(--switches)"),
    "joints": ("joints", "diamond", "var(--joints)"),
}
_SYMBOLS = ("circle", "square", "diamond", "triangle-up", "triangle-down", "cross", "x", "pentagon", "hexagon", "star")
_LINE = 0.075  # height of a line of text, of the range of rates
_OURS = ("var(--both)", "var(--switches)", "var(--joints)", "var(--fourth)")
_THIN: Trace = {"type": "data", "thickness": 1, "width": 3}


def point_traces(points: Sequence[Point], cost: Cost, *, to_p99: bool = False) -> Iterable[Trace]:
    """Yield the points, a trace for each kind of inputs; with `to_p99`, bars reach to the latency's 99th percentile."""
    for inputs, (name, symbol, colour) in _INPUTS.items():
        chosen = [point for point in points if point.setting.inputs == inputs]
        trace: Trace = {
            "type": "scatter",
            "mode": "markers",
            "name": name,
            "x": [short(cost(point)) for point in chosen],
            "y": [percent_of(point.rate) for point in chosen],
            "error_y": _bars([point.rate for point in chosen]),
            "customdata": [point.number for point in chosen],
            "text": [_hover(point) for point in chosen],
            "hovertemplate": _HOVER,
            "marker": {"symbol": symbol, "size": 11, "color": colour, "line": {"width": 1, "color": "var(--paper)"}},
        }
        if to_p99:
            late = [short(point.latency.p99_us - point.latency.mean_us) for point in chosen]
            trace["error_x"] = {**_THIN, "array": late, "arrayminus": [0.0] * len(late)}
        yield trace


def _hover(point: Point) -> str:
    latency = (
        f"latency {microseconds(point.latency.mean_us)} µs, 99th percentile {microseconds(point.latency.p99_us)} µs"
    )
    return "<br>".join(
        [
            f"<b>Point {point.number}</b>",
            *(words(part) for part in point_words(point).split(", ")),
            f"<b>{interval(point.rate)} %</b>",
            f"frame {microseconds(point.frame.us)} µs",
            latency,
        ]
    )


def best_line(points: Sequence[Point], name: str, cost: Cost) -> Trace:
    """Return the line of a front: level from each point until a better one; one that is best of its kind alone may lie
    below it.
    """
    there = [(cost(point), point.rate.mean) for point in points if name in point.fronts]
    best = front(there, lambda place: place[0], lambda place: place[1], step=0.0)
    return {
        "type": "scatter",
        "mode": "lines",
        "name": "best",
        "x": [short(x) for x, _ in best],
        "y": [short(100 * y) for _, y in best],
        "hoverinfo": "skip",
        "line": {"color": "var(--soft)", "width": 2, "shape": "hv"},
    }


def screened(placements: Sequence[Tried]) -> Trace:
    """Return the placements that were screened."""
    return {
        "type": "scatter",
        "mode": "markers",
        "name": "screened",
        "x": [short(tried.frame_us) for tried in placements],
        "y": [percent_of(tried.rate) for tried in placements],
        "text": [
            f"{words(tried.way.method)} {tried.way.parameter:g}, {tried.inputs}<br>{tried.n_switches} switches"
            f"<br>{interval(tried.rate)} %"
            for tried in placements
        ],
        "hovertemplate": _HOVER,
        "marker": {"size": 5, "color": "var(--faint)"},
    }


def stars(marks: Sequence[Placed]) -> Trace:
    """Return what to compare with."""
    return {
        "type": "scatter",
        "mode": "markers",
        "name": "to compare",
        "x": [short(x) for x, _ in marks],
        "y": [percent_of(mark.rate) for _, mark in marks],
        "error_y": _bars([mark.rate for _, mark in marks]),
        "text": [f"{words(mark.name)}<br>{mark.n_switches} switches<br>{interval(mark.rate)} %" for _, mark in marks],
        "hovertemplate": _HOVER,
        "marker": {"symbol": "star", "size": 13, "color": "var(--marks)"},
    }


def mark_names(marks: Sequence[Placed], costs: Sequence[float], rates: Sequence[float]) -> Iterable[Trace]:
    """Yield the names of the marks, a line each below the lowest mark, so that those side by side stay legible."""
    positive = [cost for cost in costs if cost > 0] or [1.0]
    middle = (min(positive) * max(positive)) ** 0.5
    line = _LINE * (max(rates, default=0.0) - min(rates, default=0.0))
    lowest = min((percent_of(mark.rate) for _, mark in marks), default=0.0)
    for place, (x, mark) in enumerate(sorted(marks, key=lambda placed: placed[0])):
        yield {
            "x": round(log10(x), 5),  # what Plotly wants of an annotation on a logarithmic axis
            "y": percent_of(mark.rate),
            "text": words(mark.name),
            "ax": -14 if x > middle else 14,
            "ayref": "y",
            "ay": short(lowest - line * (1.3 + place)),
            "xanchor": "right" if x > middle else "left",
            "arrowhead": 0,
            "arrowwidth": 1,
            "arrowcolor": "var(--marks)",
            "bgcolor": "var(--paper)",
            "opacity": 0.85,
            "font": {"size": 12, "color": "var(--marks)"},
        }


def curve_traces(curves: Sequence[Curve]) -> Iterable[Trace]:
    """Yield a curve for each method, ours first."""
    ours = [curve for curve in curves if curve.ours]
    rivals = [curve for curve in curves if not curve.ours]
    for place, curve in enumerate(ours):
        colour = _OURS[place % len(_OURS)]
        yield _curve(curve, {"color": colour, "width": 3}, {"size": 7, "color": colour})
    for place, curve in enumerate(rivals):
        marker = {"size": 7, "color": "var(--soft)", "symbol": f"{_SYMBOLS[place % len(_SYMBOLS)]}-open"}
        yield _curve(curve, {"color": "var(--soft)", "width": 1, "dash": "dot"}, marker)


def _curve(curve: Curve, line: Trace, marker: Trace) -> Trace:
    named = [(size, rate) for size, rate in zip(curve.sizes, curve.rates, strict=True) if size > 0]
    return {
        "type": "scatter",
        "mode": "lines+markers",
        "name": words(curve.method),
        "x": [short(size) for size, _ in named],
        "y": [percent_of(rate) for _, rate in named],
        "text": [f"{words(curve.what)}<br>{size:g} switches: {interval(rate)} %" for size, rate in named],
        "hovertemplate": _HOVER,
        "line": line,
        "marker": marker,
    }


def _bars(rates: Sequence[Rate]) -> Trace:
    above = [short(100 * (rate.high - rate.mean)) for rate in rates]
    below = [short(100 * (rate.mean - rate.low)) for rate in rates]
    return {**_THIN, "array": above, "arrayminus": below}


def percent_of(rate: Rate) -> float:
    """Return the mean of a rate in percent."""
    return short(100 * rate.mean)


def short(value: float) -> float:
    """Round to what can be seen, so that the page stays small."""
    return round(value, 3)

"""What the report's charts share: Plotly's figures as JSON, small, and coloured by names that the page resolves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from math import ceil, floor, log10
from typing import TYPE_CHECKING, Any

import msgspec

from .errors import ReportError

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


@dataclass(frozen=True, slots=True)
class Chart:
    """A chart: the id of its place in the page, what it shows, and its figure in JSON."""

    ident: str
    caption: str
    figure: bytes


def words(text: str) -> str:
    """Return `text` such that Plotly, which reads tags in texts, shows it as it is."""
    return escape(text, quote=False)


def axis(title: str, **values: object) -> dict[str, Any]:
    """Return an axis with a title, lines that are there and no more."""
    lines = {"gridcolor": "var(--line)", "linecolor": "var(--soft)", "zeroline": False, "automargin": True}
    return {"title": {"text": title}, **lines, **values}


def logarithmic(title: str, values: Sequence[float]) -> dict[str, Any]:
    """Return a logarithmic axis for those of `values` that are positive, its ticks plain numbers: 1, 2, 5, 10, ..."""
    positive = [value for value in values if value > 0] or [1.0]
    low, high = min(positive), max(positive)
    decades = range(floor(log10(low)), ceil(log10(high)) + 1)
    # No more than a narrow screen has room for.
    steps = (1, 2, 3, 5, 7) if high <= 10 * low else (1, 2, 5) if high <= 200 * low else (1,)
    ticks = [step * 10.0**decade for decade in decades for step in steps]
    return axis(title, type="log", tickangle=0, tickvals=ticks, ticktext=[f"{tick:,g}" for tick in ticks])


def figure(traces: Sequence[Mapping[str, Any]], **layout: object) -> bytes:
    """Return the figure of `traces` in JSON; the same traces give the same bytes. Raises ReportError without Plotly."""
    Figure = _figure_class()
    shared = {
        "font": {"family": "system-ui, sans-serif", "size": 14, "color": "var(--ink)"},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "margin": {"l": 50, "r": 10, "t": 10, "b": 40},
        "hoverlabel": {"bgcolor": "var(--paper)", "font": {"color": "var(--ink)"}, "bordercolor": "var(--soft)"},
        "legend": {"orientation": "h", "x": 0, "y": 0, "yref": "container", "yanchor": "bottom"},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": "var(--soft)", "activecolor": "var(--ink)"},
        "hovermode": "closest",
        "autosize": True,
        "uirevision": "kept",  # what the reader zoomed into stays when colours change
    }
    made = Figure(data=list(traces), layout={**shared, **layout})
    made.layout.template = None
    return msgspec.json.encode(made.to_plotly_json(), order="deterministic")


def _figure_class() -> "type[Figure]":
    try:
        from plotly.graph_objects import Figure
    except ImportError as reason:
        raise ReportError("the report's charts need plotly: pip install 'thenar[compiler]'") from reason
    return Figure  # type: ignore[no-any-return]

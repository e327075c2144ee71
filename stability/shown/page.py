"""The report as one HTML file that needs no other: table, pictures, and no date."""

import re
from dataclasses import dataclass
from importlib.resources import files

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from ..report import Report
from ..wording import besides, bound_of, error_of, failures, legend, summary, verdict


@dataclass(frozen=True, slots=True)
class Figure:
    """A picture (SVG as bytes, or nothing where there is none) with what it is and how to read it."""

    name: str
    title: str
    caption: str
    svg: bytes | None


@dataclass(frozen=True, slots=True)
class _Inline:
    title: str
    caption: str
    svg: Markup


def page(report: Report, figures: tuple[Figure, ...]) -> str:
    """Return the page. The same report and figures give the same text."""
    environment = Environment(autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True)
    environment.filters |= {
        "summary": summary,
        "besides": besides,
        "failures": failures,
        "legend": legend,
        "error": error_of,
        "bound": bound_of,
        "verdict": verdict,
    }
    template = environment.from_string(files(__package__).joinpath("page.html.j2").read_text("utf-8"))
    pictures = [_Inline(figure.title, figure.caption, _inline(figure)) for figure in figures]
    return template.render(report=report, pictures=pictures)


def _inline(figure: Figure) -> Markup:
    """Return the picture as an element of the page, its names its own and nothing in it that points elsewhere."""
    if figure.svg is None:
        return Markup("")
    svg = figure.svg.decode()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.S)
    # Two pictures both have an axes_1; within the page a name must be one thing's.
    svg = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{figure.name}-", svg)
    label = Markup.escape(figure.title)
    return Markup(svg.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1))

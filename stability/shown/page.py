"""The report as one self-contained HTML file: table and pictures, without a date."""

import re
from dataclasses import dataclass
from importlib.resources import files

from thenar.drivers.extras import optional

from ..report import Report, bound_of, error_of, failures, legend, summary, verdict, weka_lines

with optional():
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture (SVG as bytes, or None) with title and caption."""

    name: str
    title: str
    caption: str
    svg: bytes | None


def page(report: Report, pictures: tuple[Picture, ...]) -> str:
    """Return the page. The same report and pictures give the same text."""
    environment = Environment(autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True)
    filters = (summary, weka_lines, failures, legend, error_of, bound_of, verdict)
    environment.filters |= {each.__name__: each for each in filters}
    template = environment.from_string(files(__package__).joinpath("page.html.j2").read_text("utf-8"))
    inline = [(picture, _inline(picture)) for picture in pictures]
    return template.render(report=report, pictures=inline)


def _inline(picture: Picture) -> Markup:
    """Return the picture as an element of the page, with unique ids and no external links."""
    if picture.svg is None:
        return Markup("")
    svg = picture.svg.decode()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.S)
    # Two pictures both have an axes_1; within the page an id must be unique.
    svg = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{picture.name}-", svg)
    label = Markup.escape(picture.title)
    return Markup(svg.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1))

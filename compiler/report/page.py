"""`report_html`: one HTML file that needs no other file, no network and no date."""

from dataclasses import replace
from functools import lru_cache, partial

from thenar.drivers.extras import optional

from ..facts import SensorCount
from ..pictures import colour_variables, templates
from ..text import sentence
from . import frontier, sections
from .content import HandPicture, ReportContent, hand_picture

with optional():
    from jinja2 import Environment
    from markupsafe import Markup


def report_html(content: ReportContent) -> bytes:
    """Return the report in UTF-8; the same content gives the same bytes.

    The page's policy allows no script and no requests: any name stays text.
    """
    environment = _environment()
    assert environment.loader is not None
    style = environment.loader.get_source(environment, "report.css")[0]
    page = environment.get_template("report.html.j2").render(
        content=content,
        manifest=content.manifest,
        facts=partial(_facts, content),
        sections=sections,
        hand=_hand(content),
        confusion=sections.confusion_of(content),
        frontier=frontier,
        style=Markup(colour_variables() + style),
    )
    return page.encode()


def _facts(content: ReportContent, *topics: str) -> list[tuple[str, str]]:
    """Return labels and texts of the facts about `topics`."""
    chosen = (fact for fact in content.facts if fact.topic in topics)
    return [(f"{fact.label[:1].upper()}{fact.label[1:]}", fact.text) for fact in chosen]


@lru_cache(maxsize=1)
def _environment() -> Environment:
    environment = templates(__package__, "templates")
    environment.filters["sentence"] = sentence
    return environment


def _hand(content: ReportContent) -> HandPicture | None:
    if content.hand is None or not content.sources:
        return None
    placed = replace(SensorCount.of_build(content.manifest), joints=(0, 0))
    summary = (
        f"{content.hand.view}; {placed} are kept and numbered in the order in which they were chosen. "
        "The table lists them."
    )
    return hand_picture(content.hand, content.sources, "kept-hand", "Kept sensors on the hand", sentence(summary))

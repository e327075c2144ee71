"""`report_html`: one HTML file that needs no other file, no network and no date."""

from dataclasses import replace
from functools import lru_cache, partial

from thenar.drivers.extras import optional

from ..facts import SensorCount
from ..pictures import colour_variables, embedded, policy_hash, templates
from ..text import sentence
from . import sections
from .content import HandPicture, ReportContent, hand_picture
from .frontier import frontier_view

with optional():
    from jinja2 import Environment
    from markupsafe import Markup


def report_html(content: ReportContent) -> bytes:
    """Return the report in UTF-8; the same content gives the same bytes.

    The page's policy allows only its script, by SHA-256, and no requests: any name stays text.
    Raises PictureError where a frontier's charts cannot be drawn without matplotlib.
    """
    environment, manifest, frontier = _environment(), content.manifest, None
    if content.frontier is not None:
        frontier = frontier_view(content.frontier, manifest.source.fingerprint, content.hand, content.point)
    script = _file(environment, "report.js")
    page = environment.get_template("report.html.j2").render(
        content=content,
        manifest=manifest,
        facts=partial(_facts, content),
        sections=sections,
        hand=_hand(content),
        confusion=sections.confusion_of(content),
        frontier=frontier,
        style=Markup(colour_variables()) + _file(environment, "report.css"),
        script=script,
        script_sha256=policy_hash(script),
        points=embedded({str(detail.number): detail for detail in (() if frontier is None else frontier.details)}),
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


def _file(environment: Environment, name: str) -> Markup:
    """Return a file of the templates' folder verbatim."""
    assert environment.loader is not None
    return Markup(environment.loader.get_source(environment, name)[0])


def _hand(content: ReportContent) -> HandPicture | None:
    if content.hand is None or not content.sources:
        return None
    placed = replace(SensorCount.of_build(content.manifest), joints=(0, 0))
    summary = (
        f"{content.hand.view}; {placed} are kept and numbered in the order in which they were chosen. "
        "The table lists them."
    )
    return hand_picture(content.hand, content.sources, "kept-hand", "Kept sensors on the hand", sentence(summary))

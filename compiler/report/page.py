"""The page of a build: one HTML file with its summary, its report and a try, without network, other files or a date."""

from functools import lru_cache, partial

from thenar.drivers.extras import optional

from ..facts import SensorCount
from ..pictures import colour_variables, embedded, policy_hash, templates
from ..text import sentence
from . import frontier, sections
from .content import ReportContent
from .tryout import script, shared

with optional():
    from jinja2 import Environment
    from markupsafe import Markup


def report_html(content: ReportContent) -> bytes:
    """Return the page in UTF-8; the same content gives the same bytes.

    Its policy allows its own script and style, and no requests: any name stays text.
    """
    environment = _environment()
    assert environment.loader is not None
    style = shared("hand.css") + colour_variables() + environment.loader.get_source(environment, "report.css")[0]
    whole = script("tables" in content.data)
    page = environment.get_template("report.html.j2").render(
        content=content,
        manifest=content.manifest,
        sensors=SensorCount.of_build(content.manifest),
        facts=partial(_facts, content),
        sections=sections,
        confusion=sections.confusion_of(content),
        frontier=frontier,
        style=Markup(style),
        style_sha256=policy_hash(style),
        script=Markup(whole),
        script_sha256=policy_hash(whole),
        data=embedded(content.data),
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

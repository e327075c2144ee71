"""The page of a build: one HTML file with its summary, its report and a try, without network, other files or a date."""

import base64
import hashlib
from functools import lru_cache, partial

import msgspec

from thenar.drivers.extras import optional

from ..facts import SensorCount
from ..pictures import colour_variables
from ..text import sentence
from . import frontier, sections
from .content import ReportContent
from .tryout import script, shared

with optional():
    from jinja2 import Environment, PackageLoader, StrictUndefined
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
    environment = Environment(
        loader=PackageLoader(__package__, "templates"),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["sentence"] = sentence
    return environment


def embedded(data: object) -> Markup:
    """Return JSON for a script element: whatever a name contains, it begins or ends no tag and is no entity."""
    text = msgspec.json.encode(data).decode()
    for letter in "<>&":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return Markup(text)


def policy_hash(text: str) -> str:
    """Return the SHA-256 by which a page's policy allows a script or a style."""
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()

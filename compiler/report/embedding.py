"""What the page runs: Plotly and our script, named by their hashes so that nothing else runs, and the data for both."""

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
from markupsafe import Markup
from msgspec import Struct

from .charts import Chart
from .frontier_view import FrontierView


@dataclass(frozen=True, slots=True)
class Embedded:
    """Scripts to write between tags as they are, the data in JSON, the policy that lets these run, Plotly's version."""

    scripts: tuple[Markup, ...]
    data: Markup
    policy: str
    plotly: str


class _Point(Struct, frozen=True):
    """What the script writes into the page where a point is picked; `on_hand` numbers the hand's switches."""

    said: str
    facts: tuple[str, ...]
    switches: tuple[str, ...]
    on_hand: tuple[int, ...]
    command: str


class _Data(Struct, frozen=True):
    charts: dict[str, msgspec.Raw]
    points: dict[str, _Point]


def embed(script: str, charts: Sequence[Chart], frontier: FrontierView | None) -> Embedded:
    """Return what `charts` and the frontier's section need; without charts, Plotly stays away.

    The page's policy allows these scripts by SHA-256, and no request at all: whatever a name holds stays text.
    """
    scripts = [script]
    version = ""
    if charts:
        from plotly.offline import get_plotlyjs, get_plotlyjs_version

        # A page's line ends are read as \n, and that is what a browser hashes.
        scripts.insert(0, get_plotlyjs().replace("\r\n", "\n"))
        version = get_plotlyjs_version()
    hashes = " ".join(f"'sha256-{_digest(text)}'" for text in scripts)
    return Embedded(
        scripts=tuple(map(Markup, scripts)),
        data=_data(charts, frontier),
        policy=(
            f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:; "
            "base-uri 'none'; form-action 'none'"
        ),
        plotly=version,
    )


def _digest(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _data(charts: Sequence[Chart], frontier: FrontierView | None) -> Markup:
    data = _Data({chart.ident: msgspec.Raw(chart.figure) for chart in charts}, _points(frontier))
    text = msgspec.json.encode(data).decode()
    # Whatever a name holds: no tag begins or ends here, and no entity is one.
    for letter in "<>&":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return Markup(text)


def _points(frontier: FrontierView | None) -> dict[str, _Point]:
    if frontier is None:
        return {}
    hand = () if frontier.hand is None else frontier.hand.dots
    number = {dot.name: dot.number for dot in hand}
    return {
        str(detail.number): _Point(
            said=detail.said,
            facts=tuple(value for _, value in detail.facts),
            switches=detail.switches,
            on_hand=tuple(number[name] for name in detail.switches) if hand else (),
            command=detail.command,
        )
        for detail in frontier.details
    }

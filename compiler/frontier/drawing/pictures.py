"""The frontier as pictures: rate against frame time, against the number of switches, and against decision latency."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from ...pictures import painting, rendered
from ..points import Frontier
from .against_switches import draw_switches
from .against_time import draw_frontier, draw_latency
from .chart import FONT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES: Mapping[str, Callable[[Frontier], "Figure"]] = MappingProxyType(
    {"frontier": draw_frontier, "switches": draw_switches, "latency": draw_latency}
)


def pictures(frontier: Frontier, kind: Literal["svg", "png"]) -> Mapping[str, bytes]:
    """Return "frontier", "switches" and "latency" as files; equal frontiers give equal bytes. Raises PictureError."""
    with painting(font_size=FONT):
        return {name: rendered(draw(frontier), kind) for name, draw in PICTURES.items()}

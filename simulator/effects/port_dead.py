"""Ports that no longer reply: their sixteen switches read as open.

Their wires still carry current: in a matrix (switch.ghosting) their closed switches still connect the columns.
"""

from typing import Annotated

from msgspec import Meta

from ..body.layout import murakami160
from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..pipeline.parts import Count, chooser, port_count, port_of
from ..streams import Draw


def prepare(
    setting: SceneSetting,
    *,
    ports: Annotated[tuple[Annotated[int, Meta(ge=0)], ...], Meta(min_length=1)] | None = None,
    count: Count = None,
) -> Step:
    """Return the step that opens every switch of the dead ports. Raises SceneError if there are no such ports.

    Either the numbers of the dead ports, from 0, or their count, drawn for the glove; one by default.
    """
    switches = len(murakami160())
    dead = chooser("port.dead", "port", "dead", port_count(switches), ports or (), count)
    port = port_of(switches)

    def step(batch: Batch, draw: Draw) -> None:
        batch.bits = batch.bits & ~dead(draw)[port]

    return step


MEMBER = Effect(
    name="port.dead",
    summary="whole ports read as open",
    order=760,
    reads=("bits",),
    writes=("bits",),
    either=("ports", "count"),
    prepare=prepare,
)

"""Ports that no longer reply: their sixteen switches read as open.

Their wires still carry current: in a matrix (switch.ghosting) their closed switches still connect the columns.
"""

from typing import Annotated

from msgspec import Meta

from ..body.layout import murakami160
from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, EffectParameters, SceneSetting, Step
from ..pipeline.parts import chooser, port_count, port_of
from ..streams import Draw


class Parameters(EffectParameters, frozen=True):
    """Either the numbers of the dead ports, from 0, or their count, drawn for the glove; one by default."""

    ports: Annotated[tuple[Annotated[int, Meta(ge=0)], ...], Meta(min_length=1)] | None = None
    count: Annotated[int, Meta(ge=1)] | None = None

    def __post_init__(self) -> None:
        """Reject both at once."""
        if self.ports is not None and self.count is not None:
            raise ValueError("say which `ports` are dead or their `count`, not both")


def prepare(parameters: Parameters, setting: SceneSetting) -> Step:
    """Return the step that opens every switch of the dead ports. Raises SceneError if there are no such ports."""
    switches = len(murakami160())
    dead = chooser("port.dead", "port", "dead", port_count(switches), parameters.ports or (), parameters.count)
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
    parameters=Parameters,
    prepare=prepare,
)

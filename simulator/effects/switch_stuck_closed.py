"""Switches that are always closed: a short circuit, a jammed dome."""

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..pipeline.parts import StuckParameters, stuck
from ..streams import Draw


class Parameters(StuckParameters, frozen=True):
    """Which switches. One that is also stuck open (switch.stuck_open) reads closed."""


def prepare(parameters: Parameters, setting: SceneSetting) -> Step:
    """Return the step that closes them. Raises SceneError if the glove has no such switch."""
    chosen = stuck(MEMBER.name, parameters)

    def step(batch: Batch, draw: Draw) -> None:
        batch.bits = batch.bits | chosen(draw)

    return step


MEMBER = Effect(
    name="switch.stuck_closed",
    summary="some switches always read closed",
    order=740,
    reads=("bits",),
    writes=("bits",),
    parameters=Parameters,
    prepare=prepare,
)

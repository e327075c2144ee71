"""Switches that never close: a broken wire, a worn-out dome."""

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..pipeline.parts import StuckParameters, stuck
from ..streams import Draw


class Parameters(StuckParameters, frozen=True):
    """Which switches. One that is also stuck closed (switch.stuck_closed) reads closed."""


def prepare(parameters: Parameters, setting: SceneSetting) -> Step:
    """Return the step that opens them. Raises SceneError if the glove has no such switch."""
    chosen = stuck(MEMBER.name, parameters)

    def step(batch: Batch, draw: Draw) -> None:
        batch.bits = batch.bits & ~chosen(draw)

    return step


MEMBER = Effect(
    name="switch.stuck_open",
    summary="some switches never read closed",
    order=730,
    reads=("bits",),
    writes=("bits",),
    parameters=Parameters,
    prepare=prepare,
)

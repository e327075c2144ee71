"""Switches that are always closed: a short circuit, a jammed dome."""

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..pipeline.parts import Count, SwitchList, stuck
from ..streams import Draw


def prepare(setting: SceneSetting, *, switches: SwitchList = None, count: Count = None) -> Step:
    """Return the step that closes them. Raises SceneError if the glove has no such switch.

    Which switches: `parts.stuck`. One that is also stuck open (switch.stuck_open) reads closed.
    """
    chosen = stuck(MEMBER.name, switches, count)

    def step(batch: Batch, draw: Draw) -> None:
        batch.bits = batch.bits | chosen(draw)

    return step


MEMBER = Effect(
    name="switch.stuck_closed",
    summary="some switches always read closed",
    order=740,
    reads=("bits",),
    writes=("bits",),
    either=("switches", "count"),
    prepare=prepare,
)

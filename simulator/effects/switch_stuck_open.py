"""Switches that never close: a broken wire, a worn-out dome."""

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..pipeline.parts import Count, SwitchList, stuck
from ..streams import Draw


def prepare(setting: SceneSetting, *, switches: SwitchList = None, count: Count = None) -> Step:
    """Return the step that opens them. Raises SceneError if the glove has no such switch.

    Which switches: `parts.stuck`. One that is also stuck closed (switch.stuck_closed) reads closed.
    """
    chosen = stuck(MEMBER.name, switches, count)

    def step(batch: Batch, draw: Draw) -> None:
        batch.bits = batch.bits & ~chosen(draw)

    return step


MEMBER = Effect(
    name="switch.stuck_open",
    summary="some switches never read closed",
    order=730,
    reads=("bits",),
    writes=("bits",),
    either=("switches", "count"),
    prepare=prepare,
)

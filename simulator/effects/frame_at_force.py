"""Initial contact by force: frames come when the most loaded place bears given forces.

Of the frames from contact to read-out the first comes at contact and the last, as usual, at read-out; those between are
spread evenly over the force. If the force is never reached, the frame comes at read-out.
"""

from typing import Annotated

import numpy as np
from msgspec import Meta

from ..errors import SceneError
from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step, frame_times
from ..streams import Draw


def prepare(setting: SceneSetting, *, to_n: Annotated[float, Meta(gt=0.0, le=100.0)] = 1.0) -> Step:
    """Return the step that moves the frames. Raises SceneError if there are too few.

    The force on the most loaded place, in newtons, at the last frame but one.
    """
    times = frame_times(setting)
    held = np.flatnonzero((times >= 0) & (times <= setting.hold_us))
    between = len(held) - 2
    if between < 1:
        raise SceneError(
            "effects.frame.at_force: needs three frames or more from contact to read-out: raise recording.rate_hz or"
            " hold_ms"
        )

    def step(batch: Batch, draw: Draw) -> None:
        if batch.ramp is None:
            return  # The full force is present at once.
        steps = [batch.ramp.reached_us(to_n * number / between) for number in range(1, between + 1)]
        moved = batch.frame_us.copy()
        moved[:, held[:-1]] = np.minimum(np.column_stack([np.zeros(len(batch), np.int64), *steps]), setting.hold_us)
        batch.frame_us = moved

    return step


MEMBER = Effect(
    name="frame.at_force",
    summary="frames come at even steps of the force of initial contact",
    order=410,
    reads=("frame_us", "ramp"),
    writes=("frame_us",),
    timed=True,
    prepare=prepare,
)

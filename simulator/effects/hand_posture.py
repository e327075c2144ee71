"""Joint angles vary from repetition to repetition."""

from typing import Annotated

import numpy as np
from msgspec import Meta

from ..body.hand import DOF, LIMITS_DEG
from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..streams import Draw


def prepare(setting: SceneSetting, *, sd_deg: Annotated[float, Meta(ge=0.0, le=45.0)] = 1.5) -> Step:
    """Return the step that shifts every joint by an independent normal deviate, within its range.

    Standard deviation of each joint angle, independently. The default was fitted to the paper's rates.
    """

    def step(batch: Batch, draw: Draw) -> None:
        shifted = batch.posture_deg + sd_deg * draw.per_repetition(len(DOF)).normal()
        batch.posture_deg = np.clip(shifted, LIMITS_DEG[:, 0], LIMITS_DEG[:, 1])

    return step


MEMBER = Effect(
    name="hand.posture",
    summary="joint angles vary from repetition to repetition",
    order=120,
    reads=("posture_deg",),
    writes=("posture_deg",),
    prepare=prepare,
)

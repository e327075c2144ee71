"""The object's pose in the hand varies from repetition to repetition."""

from typing import Annotated

import numpy as np
from msgspec import Meta

from thenar.compiler.elementary import Floats, add_up, sincos

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..streams import Draw


def prepare(
    setting: SceneSetting,
    *,
    sd_mm: Annotated[float, Meta(ge=0.0, le=50.0)] = 1.5,
    sd_deg: Annotated[float, Meta(ge=0.0, le=45.0)] = 2.5,
) -> Step:
    """Return the step that shifts and rotates the object by normal deviates.

    Standard deviations along and about each axis of the hand. The defaults were fitted to the paper's rates.
    """

    def step(batch: Batch, draw: Draw) -> None:
        deviates = draw.per_repetition(6).normal()
        position = batch.pose[:, :3] + sd_mm * deviates[:, :3]
        turn = sd_deg * np.pi / 180.0 * deviates[:, 3:]
        batch.pose = np.concatenate([position, turned(batch.pose[:, 3:], turn)], axis=1)

    return step


def turned(vectors: Floats, turn: Floats) -> Floats:
    """Return rotation vectors (n, 3), none a whole turn, after a small additional `turn` (n, 3) about hand axes.

    To first order in `turn`, by the inverse left Jacobian of the rotation group (Barfoot 2017, State Estimation for
    Robotics, eq. 7.77), which needs no inverse sine. Its error is at most half the square of the turn in radians: for
    5 degrees 0.2, for 30 degrees 8.
    """
    half = np.sqrt(add_up((vectors * vectors).T)) / 2.0
    sine, cosine = sincos(half)
    small = half < 1e-4
    divisor = np.where(small, 1.0, 4.0 * half * half * sine)
    factor = np.where(small, 1.0 / 12.0, (sine - half * cosine) / divisor)
    across = np.cross(vectors, turn)
    return vectors + turn - across / 2.0 + factor[:, None] * np.cross(vectors, across)


MEMBER = Effect(
    name="hand.object_pose",
    summary="the object lies a little elsewhere in each repetition",
    order=130,
    reads=("pose",),
    writes=("pose",),
    prepare=prepare,
)

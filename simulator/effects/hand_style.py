"""Subjects differ: in habits of posture, general and by grasp type, and in grip force."""

from typing import Annotated

import numpy as np
from msgspec import Meta

from thenar.compiler.elementary import exp

from ..body.hand import DOF, LIMITS_DEG
from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..streams import Draw

_Degrees = Annotated[float, Meta(ge=0.0, le=45.0)]


def prepare(
    setting: SceneSetting,
    *,
    sd_deg: _Degrees = 2.0,
    habit_sd_deg: _Degrees = 3.0,
    log_sd: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.15,
) -> Step:
    """Return the step that applies the subject's style to the posture and the grip of a batch.

    Standard deviations between subjects. All defaults are ours.

    sd_deg        of each joint angle, the same in all grasps of the subject
    habit_sd_deg  additional, of each joint angle, for each grasp type of the subject
    log_sd        of the logarithm of the grip force
    """

    def step(batch: Batch, draw: Draw) -> None:
        own = draw.per_subject(len(DOF) + 1).normal()
        habit = draw.per_type(len(DOF)).normal()
        offset = sd_deg * own[:-1] + habit_sd_deg * habit
        batch.posture_deg = np.clip(batch.posture_deg + offset, LIMITS_DEG[:, 0], LIMITS_DEG[:, 1])
        batch.grip_n = batch.grip_n * exp(log_sd * own[-1:])

    return step


MEMBER = Effect(
    name="hand.style",
    summary="every subject has individual habits of posture, also by grasp type, and grip force",
    order=110,
    reads=("posture_deg", "grip_n"),
    writes=("posture_deg", "grip_n"),
    prepare=prepare,
)

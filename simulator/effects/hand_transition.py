"""From one grasp to the next: the hand leaves the posture of the trial before, opens, and closes on the object.

Joints follow a minimum-jerk path (Flash and Hogan 1985, J. Neurosci. 5: 1688, from point to point). On top of it all
flexion is undone for a while, most at two thirds of the way, where the grip aperture of a reaching hand is largest
(Jeannerod 1984, J. Motor Behav. 16: 235).
"""

from typing import Annotated

import numpy as np
from msgspec import Meta

from thenar.compiler.elementary import Floats

from ..body.cyberglove import sensors_deg
from ..body.hand import DOF, LIMITS_DEG
from ..errors import SceneError
from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, EffectParameters, Setting, Step, frame_times
from ..streams import Draw

_FLEXES = np.array([not name.endswith("abduction") for name in DOF])
_BUMP = 3.0**9 / 2.0**6  # makes t^6 (1 - t)^3 one at its top, t = 2/3


class Parameters(EffectParameters, frozen=True):
    """By how many degrees every joint that flexes opens on the way."""

    opening_deg: Annotated[float, Meta(ge=0.0, le=90.0)] = 20.0


def prepare(parameters: Parameters, setting: Setting) -> Step:
    """Return the step that moves the angles of the frames before contact. Raises SceneError where there are none."""
    if not (frame_times(setting) < 0).any():
        raise SceneError(
            "effects.hand.transition: there is no frame before contact; give the scene a recording.lead_ms of at least "
            f"one, {setting.period_us / 1e3:g} ms"
        )

    def step(batch: Batch, draw: Draw) -> None:
        before = batch.frame_us < 0
        coming = before.any(axis=0)
        way = np.clip(1.0 - batch.frame_us[:, coming] / setting.first_us, 0.0, 1.0)
        angles = path(batch.previous_deg, batch.posture_deg, way, parameters.opening_deg)
        felt = sensors_deg(angles)
        moved = batch.sensors_deg.copy()
        moved[:, coming] = np.where(before[:, coming, None], felt, moved[:, coming])
        batch.sensors_deg = moved

    return step


def path(start_deg: Floats, end_deg: Floats, way: Floats, opening_deg: float) -> Floats:
    """Return the joint angles (n, F, 20) between postures (n, 20) when a share `way` (n, F) of the time has gone.

    Joints open no further than they can, and stand still at both ends.
    """
    t = way[:, :, None]
    cubed = t * t * t
    travelled = cubed * (10.0 - t * (15.0 - 6.0 * t))
    straight = start_deg[:, None] * (1.0 - travelled) + end_deg[:, None] * travelled
    left = 1.0 - t
    opened = straight - np.where(_FLEXES, opening_deg, 0.0) * (_BUMP * cubed * cubed * left * left * left)
    return np.maximum(opened, np.minimum(straight, LIMITS_DEG[:, 0]))


MEMBER = Effect(
    name="hand.transition",
    summary="the hand comes from the grasp before",
    stage="sense",
    place=1,
    reads=("previous_deg", "posture_deg", "frame_us", "sensors_deg"),
    writes=("sensors_deg",),
    timed=True,
    parameters=Parameters,
    prepare=prepare,
)

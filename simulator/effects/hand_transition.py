"""From one grasp to the next: the hand leaves the posture of the previous trial, opens, and closes on the object.

In a scene with rests it comes from its rest, and after the release returns on the same path, in the same time.

Joints follow a minimum-jerk path (Flash and Hogan 1985, J. Neurosci. 5: 1688, from point to point). In addition all
flexion is reduced on the way, most at two thirds of it, where the grip aperture of a reaching hand is largest
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
from ..pipeline.effect import Effect, SceneSetting, Step, frame_times
from ..streams import Draw

_FLEXES = np.array([not name.endswith("abduction") for name in DOF])
_BUMP = 3.0**9 / 2.0**6  # makes t^6 (1 - t)^3 one at its top, t = 2/3


def prepare(setting: SceneSetting, *, opening_deg: Annotated[float, Meta(ge=0.0, le=90.0)] = 20.0) -> Step:
    """Return the step that moves the angles of the frames before contact, and after the release where the hand rests.

    Raises SceneError if there are none before contact.

    The opening of every flexing joint on the way, in degrees.
    """
    if not (frame_times(setting) < 0).any():
        raise SceneError(
            "effects.hand.transition: there is no frame before contact; give the scene a recording.lead_ms of at least "
            f"one, {setting.period_us / 1e3:g} ms"
        )

    def step(batch: Batch, draw: Draw) -> None:
        moved = batch.sensors_deg.copy()
        legs = [(batch.frame_us, batch.previous_deg)]
        if batch.rest_deg is not None:
            legs.append((setting.released_us - batch.frame_us, batch.rest_deg))
        for until_us, open_deg in legs:
            away = until_us < 0
            some = away.any(axis=0)
            way = np.clip(1.0 - until_us[:, some] / setting.first_us, 0.0, 1.0)
            felt = sensors_deg(path(open_deg, batch.posture_deg, way, opening_deg))
            moved[:, some] = np.where(away[:, some, None], felt, moved[:, some])
        batch.sensors_deg = moved

    return step


def path(start_deg: Floats, end_deg: Floats, way: Floats, opening_deg: float) -> Floats:
    """Return the joint angles (n, F, 20) between postures (n, 20) when a share `way` (n, F) of the time has gone.

    Joints stay within their ranges, and are still at both ends.
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
    order=510,
    reads=("previous_deg", "rest_deg", "posture_deg", "frame_us", "sensors_deg"),
    writes=("sensors_deg",),
    timed=True,
    prepare=prepare,
)

"""The CyberGlove's sensors are noisy, from frame to frame, and the glove fits slightly differently in every repetition.

Simulated angles alone distinguish grasp types far too well; the offset of a repetition reduces them to the performance
of the paper's glove: 5, 10 and 15 degrees span its 85 to 100 %.
"""

from typing import Annotated

from msgspec import Meta

from ..body.cyberglove import SENSORS
from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step, drawn_rows
from ..streams import Draw

_Degrees = Annotated[float, Meta(ge=0.0, le=45.0)]


def prepare(setting: SceneSetting, *, sd_deg: _Degrees = 2.0, trial_sd_deg: _Degrees = 0.0) -> Step:
    """Return the step that adds normal noise to every sensor.

    Standard deviations of each sensor: `sd_deg` drawn for every frame, `trial_sd_deg` once per repetition.
    """
    rows = drawn_rows(setting)

    def step(batch: Batch, draw: Draw) -> None:
        deviates = draw.per_repetition(1 + len(rows), len(SENSORS)).normal()
        of_frame = sd_deg * deviates[:, 1 + rows]
        batch.sensors_deg = batch.sensors_deg + (trial_sd_deg * deviates[:, :1] + of_frame)

    return step


MEMBER = Effect(
    name="joint.noise",
    summary="joint sensors are off a little, in every frame and for a whole repetition",
    order=520,
    reads=("sensors_deg",),
    writes=("sensors_deg",),
    prepare=prepare,
)

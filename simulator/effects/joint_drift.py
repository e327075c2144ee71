"""The CyberGlove slips and warms up: its calibration drifts as a session goes on."""

from typing import Annotated

from msgspec import Meta

from ..body.cyberglove import SENSORS
from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..streams import Draw


def prepare(setting: SceneSetting, *, deg_per_session: Annotated[float, Meta(ge=0.0, le=90.0)] = 5.0) -> Step:
    """Return the step that shifts every sensor in proportion to the number of previous trials.

    Standard deviation, over sensors and subjects, of a sensor's drift by the end of the session. Ours.
    """

    def step(batch: Batch, draw: Draw) -> None:
        whole = deg_per_session * draw.per_subject(len(SENSORS)).normal()
        gone = batch.trials / setting.session_trials
        batch.sensors_deg = batch.sensors_deg + (gone[:, None] * whole)[:, None]

    return step


MEMBER = Effect(
    name="joint.drift",
    summary="joint sensors drift, trial by trial, differently for each subject",
    order=530,
    reads=("trials", "sensors_deg"),
    writes=("sensors_deg",),
    prepare=prepare,
)

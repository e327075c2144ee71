"""An effect of a scene that another package brings: the glove sits askew, so its joint sensors are off a whole session.

[project.entry-points."thenar.effects"]
"joint.offset" = "my_package.effect:MEMBER"
"""

from typing import Annotated

from msgspec import Meta

from thenar.simulator.body.cyberglove import SENSORS
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.effect import Effect, EffectParameters, SceneSetting, Step
from thenar.simulator.streams import Draw


class Parameters(EffectParameters, frozen=True):
    """Standard deviation, over sensors and subjects, of how far a sensor is off."""

    sd_deg: Annotated[float, Meta(ge=0.0, le=45.0)] = 4.0


def prepare(parameters: Parameters, setting: SceneSetting) -> Step:
    """Return the step that shifts every sensor, by a different number of degrees for each subject."""

    def step(batch: Batch, draw: Draw) -> None:
        batch.sensors_deg = batch.sensors_deg + parameters.sd_deg * draw.per_subject(len(SENSORS)).normal()

    return step


MEMBER = Effect(
    name="joint.offset",
    summary="joint sensors are off, by the same in all that a subject does",
    order=525,
    reads=("sensors_deg",),
    writes=("sensors_deg",),
    parameters=Parameters,
    prepare=prepare,
)

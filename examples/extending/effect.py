"""An effect of a scene that another package brings: the glove sits askew, so its joint sensors are off a whole session.

[project.entry-points."thenar.effects"]
"joint.offset" = "my_package.effect:MEMBER"
"""

from typing import Annotated

from msgspec import Meta

from thenar.simulator.body.cyberglove import SENSORS
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.effect import Effect, SceneSetting, Step
from thenar.simulator.streams import Draw


def prepare(setting: SceneSetting, *, sd_deg: Annotated[float, Meta(ge=0.0, le=45.0)] = 4.0) -> Step:
    """Return the step that shifts every sensor, by a different number of degrees for each subject.

    Standard deviation, over sensors and subjects, of how far a sensor is off.
    """

    def step(batch: Batch, draw: Draw) -> None:
        batch.sensors_deg = batch.sensors_deg + sd_deg * draw.per_subject(len(SENSORS)).normal()

    return step


MEMBER = Effect(
    name="joint.offset",
    summary="joint sensors are off, by the same in all that a subject does",
    order=525,
    reads=("sensors_deg",),
    writes=("sensors_deg",),
    prepare=prepare,
)

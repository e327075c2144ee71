"""Grip force varies from repetition to repetition."""

from typing import Annotated

from msgspec import Meta

from thenar.compiler.elementary import exp

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..streams import Draw


def prepare(setting: SceneSetting, *, log_sd: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.25) -> Step:
    """Return the step that multiplies the grip by a lognormal factor of median 1.

    Standard deviation of the logarithm of the force: 0.25 is about a quarter. Fitted to the paper's rates.
    """

    def step(batch: Batch, draw: Draw) -> None:
        batch.grip_n = batch.grip_n * exp(log_sd * draw.per_repetition().normal())

    return step


MEMBER = Effect(
    name="hand.grip",
    summary="grip force varies from repetition to repetition",
    order=140,
    reads=("grip_n",),
    writes=("grip_n",),
    prepare=prepare,
)

"""No two pads are alike: each has a gain of its own, and feels nothing until it is pressed hard enough to make contact.

Of Interlink's FSR 400 series (data sheet PDS-10004-C): repeatable from part to part to 6 % of one batch (a standard
deviation), which is published; that a pad's conductance follows the force in a straight line above is the usual
approximation. The same sheet says 0.2 N for the least force that actuates; earlier ones say 0.1 N.
"""

from typing import Annotated

import numpy as np
from msgspec import Meta

from thenar.compiler.elementary import exp

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, EffectParameters, Setting, Step
from ..streams import Draw


class Parameters(EffectParameters, frozen=True):
    """Standard deviation of the logarithm of the gain between the pads of a glove, and below how many newtons a typical
    pad reads nothing: each as much more or less as its gain is low or high.
    """

    log_sd: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.06
    actuates_n: Annotated[float, Meta(ge=0.0, le=5.0)] = 0.1


def prepare(parameters: Parameters, setting: Setting) -> Step:
    """Return the step that scales every pad's force, once it actuates."""

    def step(batch: Batch, draw: Draw) -> None:
        gains = exp(parameters.log_sd * draw.per_glove(batch.taxels_n.shape[2]).normal())
        felt = batch.taxels_n * gains
        batch.taxels_n = np.where(felt >= parameters.actuates_n, felt, 0.0)

    return step


MEMBER = Effect(
    name="taxel.gain",
    summary="each pad has a gain of its own, and actuates at some force",
    stage="sense",
    place=4,
    reads=("taxels_n",),
    writes=("taxels_n",),
    parameters=Parameters,
    prepare=prepare,
)

"""Each pad has its own gain, and reads 0 until it is pressed hard enough to make contact.

For Interlink's FSR 400 series (data sheet PDS-10004-C) the published repeatability from part to part is 6 % within a
batch (a standard deviation); linear conductance above the actuation force is the usual approximation. The same data
sheet gives 0.2 N as actuation force; earlier ones give 0.1 N.
"""

from typing import Annotated

import numpy as np
from msgspec import Meta

from thenar.compiler.elementary import exp

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..streams import Draw


def prepare(
    setting: SceneSetting,
    *,
    log_sd: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.06,
    actuates_n: Annotated[float, Meta(ge=0.0, le=5.0)] = 0.1,
) -> Step:
    """Return the step that scales every pad's force, once it actuates.

    Standard deviation of the logarithm of the gain between the pads of a glove, and the actuation force of a typical
    pad in newtons, which is inversely proportional to the gain.
    """

    def step(batch: Batch, draw: Draw) -> None:
        gains = exp(log_sd * draw.per_glove(batch.taxels_n.shape[2]).normal())
        felt = batch.taxels_n * gains
        batch.taxels_n = np.where(felt >= actuates_n, felt, 0.0)

    return step


MEMBER = Effect(
    name="taxel.gain",
    summary="each pad has its own gain and actuation force",
    order=560,
    reads=("taxels_n",),
    writes=("taxels_n",),
    prepare=prepare,
)

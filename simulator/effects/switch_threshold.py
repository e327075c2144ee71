"""Switches differ: each has its own closing force, around 1.0 N."""

from typing import Annotated

import numpy as np
from msgspec import Meta

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..streams import Draw

# No tact switch closes by itself. Ours.
LEAST_N = 0.2
SD_N = 0.15


def prepare(setting: SceneSetting, *, sd_n: Annotated[float, Meta(ge=0.0, le=5.0)] = SD_N) -> Step:
    """Return the step that shifts every threshold by a normal deviate, drawn per glove.

    Standard deviation of the closing force between the switches of a glove, in newtons. Ours; minimum `LEAST_N`.
    """

    def step(batch: Batch, draw: Draw) -> None:
        deviates = draw.per_glove(len(batch.thresholds_n)).normal()
        batch.thresholds_n = np.maximum(batch.thresholds_n + sd_n * deviates, LEAST_N)

    return step


MEMBER = Effect(
    name="switch.threshold",
    summary="each switch has its own closing force",
    order=310,
    reads=("thresholds_n",),
    writes=("thresholds_n",),
    prepare=prepare,
)

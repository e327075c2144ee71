"""Repeatability of pads: readings of equal forces differ between repetitions, and every reading is noisy.

Published for Interlink's FSR 400 series (data sheet PDS-10004-C): a single part repeats to 2 % (a standard deviation).
The noise of a reading is ours: two counts of 12 bits over 10 N.
"""

from typing import Annotated

from msgspec import Meta

from thenar.compiler.elementary import exp

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step, drawn_rows
from ..streams import Draw


def prepare(
    setting: SceneSetting,
    *,
    trial_log_sd: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.02,
    sd_n: Annotated[float, Meta(ge=0.0, le=5.0)] = 0.005,
) -> Step:
    """Return the step that adds normal noise to every reading.

    Standard deviations: of the logarithm of a pad's gain, drawn for each repetition; of each reading, in newtons.
    """
    rows = drawn_rows(setting)

    def step(batch: Batch, draw: Draw) -> None:
        deviates = draw.per_repetition(1 + len(rows), batch.taxels_n.shape[2]).normal()
        gains = exp(trial_log_sd * deviates[:, :1])
        batch.taxels_n = batch.taxels_n * gains + sd_n * deviates[:, 1 + rows]

    return step


MEMBER = Effect(
    name="taxel.noise",
    summary="pads are off a little, in every frame and for a whole repetition",
    order=600,
    reads=("taxels_n",),
    writes=("taxels_n",),
    prepare=prepare,
)

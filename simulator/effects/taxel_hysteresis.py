"""Hysteresis: during release a pad reads more than during loading; its reading falls only after the force has fallen
by a share.

The model is the play operator (Krasnosel'skii and Pokrovskii 1989), here on the logarithm of the force, so that the
relative width of the loop is the same at any force. Published for Interlink's FSR 400 series (data sheet
PDS-10004-C): +10 % on average. Piezoresistive fabrics have more: 0.2 and above is of their order (ours).
"""

from typing import Annotated

import numpy as np
from msgspec import Meta

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..streams import Draw


def prepare(setting: SceneSetting, *, share: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.1) -> Step:
    """Return the step that lets readings follow the force with play, frame by frame.

    Excess of the reading at falling over rising force, as a share of the force.
    """
    most = 1.0 + share

    def step(batch: Batch, draw: Draw) -> None:
        felt = batch.taxels_n.copy()
        for frame in range(1, felt.shape[1]):
            now = batch.taxels_n[:, frame]
            felt[:, frame] = np.minimum(np.maximum(felt[:, frame - 1], now), most * now)
        batch.taxels_n = felt

    return step


MEMBER = Effect(
    name="taxel.hysteresis",
    summary="pads that are let go read more than pads that are pressed",
    order=570,
    reads=("taxels_n",),
    writes=("taxels_n",),
    timed=True,
    prepare=prepare,
)

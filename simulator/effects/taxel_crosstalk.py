"""Crosstalk of pads in a matrix: the switch that drives a row has a resistance, and the more all pads of the row
conduct, the less voltage is left for each.

The matrix is read against virtual ground, with one amplifier per column, so that there are no sneak paths; the loss at
the row's switch is then exact (D'Alessio 1999, Sensors and Actuators A 72: 71, and Hidalgo-Lopez et al. 2018, J.
Sensors 9735741, name it the main cause of crosstalk): G / (1 + R sum of G over the row). Published: 70 ohms typical of
the multiplexer CD74HC4067 at 4.5 V (its data sheet). Read off the force curve of the FSR 402's data sheet: 10 kilohms
at 1 N, to some tens of percent. A piezoresistive fabric is of the same order (ours).
"""

from typing import Annotated

import numpy as np
from msgspec import Meta

from thenar.compiler.elementary import add_up

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..pipeline.parts import PORT
from ..streams import Draw


def prepare(
    setting: SceneSetting,
    *,
    row_ohm: Annotated[float, Meta(ge=0.0, le=1e5)] = 70.0,
    pad_ohm: Annotated[float, Meta(gt=0.0, le=1e9)] = 10_000.0,
) -> Step:
    """Return the step that lowers every reading by its row's conductance; a row has the places of a port.

    The resistance of the driver of a row, and of a pad at 1 N (its conductance is proportional to the force).
    """
    rows = np.array(setting.taxels, dtype=np.intp) // PORT
    per_n = row_ohm / pad_ohm

    def step(batch: Batch, draw: Draw) -> None:
        felt = np.empty_like(batch.taxels_n)
        for row in np.unique(rows):
            own = np.flatnonzero(rows == row)
            felt[:, :, own] = batch.taxels_n[:, :, own]
            felt[:, :, own] /= 1.0 + per_n * add_up(np.moveaxis(felt[:, :, own], 2, 0))[:, :, None]
        batch.taxels_n = felt

    return step


MEMBER = Effect(
    name="taxel.crosstalk",
    summary="pads of a row of a matrix take from one another",
    order=590,
    reads=("taxels_n",),
    writes=("taxels_n",),
    prepare=prepare,
)

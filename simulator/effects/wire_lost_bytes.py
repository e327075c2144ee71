"""Bytes that never arrive: an overrun receiver, a plug pulled briefly."""

from dataclasses import replace
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step, drawn_rows
from ..streams import Draw


def arrives(chances: NDArray[np.float64], rate: float) -> NDArray[np.bool_]:
    """Return the mask of bytes that arrive, for one uniform number each, any shape."""
    return chances >= rate


def prepare(setting: SceneSetting, *, rate: Annotated[float, Meta(gt=0.0, lt=1.0)] = 1e-4) -> Step:
    """Return the step that loses bytes.

    The share of lost bytes.
    """
    rows = drawn_rows(setting)

    def step(batch: Batch, draw: Draw) -> None:
        traffic = batch.traffic
        chances = draw.per_repetition(*traffic.data.shape[1:]).uniform()[:, rows]
        batch.traffic = replace(traffic, arrives=traffic.arrives & arrives(chances, rate))

    return step


MEMBER = Effect(
    name="wire.lost_bytes",
    summary="bytes are lost on the serial lines",
    order=810,
    reads=("traffic",),
    writes=("traffic",),
    on_wire=True,
    prepare=prepare,
)

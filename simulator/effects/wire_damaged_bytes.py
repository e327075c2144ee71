"""Bytes that arrive with one of their eight bits flipped: noise on a line without parity."""

from dataclasses import replace
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step, drawn_rows
from ..streams import Draw

Bytes = NDArray[np.uint8]


def damaged(data: Bytes, chances: NDArray[np.float64], rate: float) -> Bytes:
    """Return the received bytes, for one uniform number each, any shape: below `rate` it selects the flipped bit."""
    bit = np.minimum(8.0 * chances / rate, 7.0).astype(np.uint8)
    return np.where(chances < rate, data ^ (np.uint8(1) << bit), data)


def prepare(setting: SceneSetting, *, rate: Annotated[float, Meta(gt=0.0, lt=1.0)] = 1e-4) -> Step:
    """Return the step that damages bytes.

    The share of damaged bytes.
    """
    rows = drawn_rows(setting)

    def step(batch: Batch, draw: Draw) -> None:
        traffic = batch.traffic
        chances = draw.per_repetition(*traffic.data.shape[1:]).uniform()[:, rows]
        batch.traffic = replace(traffic, data=damaged(traffic.data, chances, rate))

    return step


MEMBER = Effect(
    name="wire.damaged_bytes",
    summary="bits are turned on the serial lines",
    order=820,
    reads=("traffic",),
    writes=("traffic",),
    on_wire=True,
    prepare=prepare,
)

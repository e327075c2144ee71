"""Frames that do not start on time: the computer's clock is regular, its scheduler is not."""

from typing import Annotated

import numpy as np
from msgspec import Meta

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step, drawn_rows
from ..streams import Draw


def prepare(setting: SceneSetting, *, sd_us: Annotated[float, Meta(gt=0.0, le=1e6)] = 300.0) -> Step:
    """Return the step that moves every frame by an independent normal deviate, and keeps them in order.

    Standard deviation of the start of frames in microseconds.
    """
    rows = drawn_rows(setting)

    def step(batch: Batch, draw: Draw) -> None:
        shift = np.rint(sd_us * draw.per_repetition(len(rows)).normal()[:, rows])
        batch.frame_us = np.sort(batch.frame_us + shift.astype(np.int64), axis=1)

    return step


MEMBER = Effect(
    name="frame.jitter",
    summary="frames start early or late, in order",
    order=420,
    reads=("frame_us",),
    writes=("frame_us",),
    timed=True,
    prepare=prepare,
)

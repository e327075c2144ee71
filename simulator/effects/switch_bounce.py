"""Contacts that bounce when they close or open.

EVQPL series (Panasonic data sheet, 2019): at most 3 ms when it closes, 8 ms when it opens. The pattern within that is
ours: a burst of any length up to the limit, of 2 to 10 edges at decreasing intervals as the contact comes to rest.
"""

from typing import Annotated

import numpy as np
from msgspec import Meta

from thenar.compiler.elementary import Floats

from ..pipeline.batch import Batch, Bits, Integers
from ..pipeline.effect import Effect, SceneSetting, Step
from ..pipeline.ramp import NEVER
from ..streams import Draw

_MOST_PAIRS = 5


def prepare(
    setting: SceneSetting,
    *,
    on_ms: Annotated[float, Meta(ge=0.0, le=1000.0)] = 3.0,
    off_ms: Annotated[float, Meta(ge=0.0, le=1000.0)] = 8.0,
) -> Step:
    """Return the step that flips the bits read while their contact bounces.

    The longest burst when a switch closes, and when it opens, in milliseconds.
    """

    def step(batch: Batch, draw: Draw) -> None:
        chances = draw.per_repetition(batch.on_us.shape[1], 4).uniform()
        on_us, off_us = chances[:, :, 0] * (1e3 * on_ms), chances[:, :, 2] * (1e3 * off_ms)
        closing = _flipped(batch, batch.on_us, batch.off_us, on_us, chances[:, :, 1])
        opening = _flipped(batch, batch.off_us, np.full_like(batch.off_us, NEVER), off_us, chances[:, :, 3])
        batch.bits = batch.bits ^ closing ^ opening

    return step


def _flipped(batch: Batch, edge_us: Integers, next_us: Integers, length_us: Floats, chance: Floats) -> Bits:
    """Return the mask of readings (n, F, s) between an odd edge of a burst and the even one after it.

    A burst begins at edge_us (n, s) and lasts length_us, but not beyond next_us. Its edges lie at
    length * sqrt(k / edges): the last at its end, each gap shorter than the one before.
    """
    row, switch = np.nonzero(edge_us != NEVER)
    read_us = batch.frame_us[row]
    if batch.delay_us is not None:
        read_us = read_us + np.broadcast_to(batch.delay_us, batch.bits.shape)[row, :, switch]
    begin_us, end_us, length = edge_us[row, switch], next_us[row, switch], length_us[row, switch]
    part = (read_us - begin_us[:, None]) / np.maximum(length, 1e-3)[:, None]
    within = (part >= 0.0) & (part < 1.0) & (read_us < end_us[:, None])
    edges = 2.0 * np.floor(1.0 + _MOST_PAIRS * chance[row, switch])
    flipped = np.zeros_like(batch.bits)
    flipped[row, :, switch] = within & (np.floor(edges[:, None] * part * part) % 2.0 == 1.0)
    return flipped


MEMBER = Effect(
    name="switch.bounce",
    summary="closing and opening contacts chatter",
    order=720,
    reads=("bits", "on_us", "off_us", "frame_us", "delay_us"),
    writes=("bits",),
    timed=True,
    prepare=prepare,
)

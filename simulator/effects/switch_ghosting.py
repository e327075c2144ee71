"""Switches in a matrix without diodes: if three corners of a rectangle are closed, the fourth reads closed.

Current takes any path: a switch reads closed if closed ones connect its row and its column, in any number of steps.
This is the ghosting of keyboards; one diode per switch prevents it. Every switch of a frame counts with its state at
the reading of its row: changes from one row to the next (bus.latency) are ignored.
"""

import numpy as np
from numpy.typing import NDArray

from ..pipeline.batch import Batch, Bits
from ..pipeline.effect import Effect, SceneSetting, Step
from ..pipeline.parts import PORT, port_count, port_of
from ..streams import Draw


def prepare(setting: SceneSetting) -> Step:
    """Return the step that closes every switch with a current path.

    No parameters: a row of the matrix is a port, a column one of its sixteen places.
    """

    def step(batch: Batch, draw: Draw) -> None:
        batch.bits = joined(batch.bits)

    return step


def joined(bits: Bits) -> Bits:
    """Return the readings (..., s) of a matrix with closed switches `bits` (..., s)."""
    switches = bits.shape[-1]
    rows, columns = port_of(switches), np.arange(switches) % PORT
    wires = _columns(bits)
    for row in range(len(wires)):
        # Rows that share a column with this one become one net with it. Connected rows join one net at the latest when
        # the first of them is processed, and nets stay joined from then on: after the last row all are joined.
        touching = (wires & wires[row]) != 0
        net = np.bitwise_or.reduce(np.where(touching, wires, 0), axis=0)
        wires = np.where(touching, net, wires)
    return np.moveaxis((wires[rows] >> columns.reshape(-1, *[1] * (bits.ndim - 1))) & 1, 0, -1).astype(np.bool_)


def _columns(bits: Bits) -> NDArray[np.uint16]:
    """Return for each row (rows, ...) its connected columns, one bit each."""
    rows = port_count(bits.shape[-1])
    packed = np.zeros((*bits.shape[:-1], rows * 2), dtype=np.uint8)
    bytes_ = np.packbits(bits, axis=-1, bitorder="little")
    packed[..., : bytes_.shape[-1]] = bytes_
    return np.moveaxis(packed.view("<u2"), -1, 0)


MEMBER = Effect(
    name="switch.ghosting",
    summary="a matrix without diodes closes the fourth corner",
    order=750,
    reads=("bits",),
    writes=("bits",),
    prepare=prepare,
)

"""Baselines from PySensors: sparse sensors for classification (SSPOC), and for reconstruction by pivoted QR."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...samples import Columns
from .base import Bits, Labels, Method, ranked

_SEED = 0
# With PySensors' defaults (no modes, penalty 0.1) SSPOC was 4 to 34 points less accurate on simulated grasps.
_MODES, _PENALTY = 20, 0.01


def sspoc_order(bits: Bits, labels: Labels) -> Columns:
    """Return the inputs of bits (n, d) by their SSPOC weights, in the space of the first 20 modes.

    Brunton, Brunton, Proctor, Kutz, SIAM J. Appl. Math. 76 (2016). Inputs of weight 0 come last, by their numbers.
    """
    from pysensors.basis import SVD
    from pysensors.classification import SSPOC

    modes = min(_MODES, *bits.shape)
    centred = bits - bits.mean(axis=0)
    model = SSPOC(basis=SVD(n_basis_modes=modes, random_state=_SEED), l1_penalty=_PENALTY)
    model.fit(centred, labels, quiet=True, refit=False)
    weights = np.abs(_by_input(model.sensor_coef_, bits.shape[1])).max(axis=1)
    return tuple(np.argsort(-weights, kind="stable").tolist())


def qr_order(bits: Bits, _: Labels) -> Columns:
    """Return the inputs of bits (n, d) in the order of QR's pivots; the labels are ignored.

    Manohar, Brunton, Kutz, Brunton, IEEE Control Systems 38 (2018).
    """
    from pysensors.reconstruction import SSPOR

    model = SSPOR()
    model.fit(bits.astype(np.float64), quiet=True, seed=_SEED, mode="economic")
    return tuple(int(column) for column in model.get_all_sensors())


def _by_input(weights: Any, n_inputs: int) -> NDArray[np.float64]:
    """Return SSPOC's weights as (inputs, classes); for two classes it returns one column, without an axis."""
    return np.asarray(weights, dtype=np.float64).reshape(n_inputs, -1)


MEMBER = (
    Method(
        name="sspoc",
        help="Sparse sensors for classification (PySensors' SSPOC)",
        learn=ranked(sspoc_order),
        nested=True,
        tried="always",
        imports="pysensors",
        install="python-sensors",
        rank=26,
    ),
    Method(
        name="qr",
        help="Sensors for reconstruction by pivoted QR (PySensors), without labels",
        learn=ranked(qr_order),
        nested=True,
        tried="always",
        imports="pysensors",
        install="python-sensors",
        rank=27,
    ),
)

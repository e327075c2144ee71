"""`ensemble.bin`: the stumps that a build was collapsed from, kept so that the build can be verified.

A sealed npz (recordings/arrays.py) of columns (M, K) int32, thresholds (M, K) float64 and values (M, K, 3) float64,
with a JSON header {"n_inputs", "shrinkage"}.
"""

from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta

from thenar.runtime.errors import BuildError
from thenar.runtime.sealed import seal, unseal
from thenar.runtime.tables import MAX_CLASSES, MAX_JOINTS, MAX_SWITCHES

from ..boosting.stumps import Stumps
from ..recordings.arrays import AnyArray, pack, unpack

KIND = b"THNRENSM"
VERSION = 1
MAX_BYTES = 1 << 30

# Some hundred bytes less than these make a gigabyte: a column, a threshold and three values each.
MAX_STUMPS = 29_000_000

_DTYPES = {"columns": "<i4", "thresholds": "<f8", "values": "<f8"}


# Beyond what boosting gives (boost.LARGEST_Z_MAX), and of thresholds beyond every code.
_LARGEST_VALUE, _LARGEST_THRESHOLD = 1e6, 1e6


class _Header(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    n_inputs: Annotated[int, Meta(ge=1, le=MAX_SWITCHES + MAX_JOINTS)]
    shrinkage: Annotated[float, Meta(gt=0.0, le=1.0)]


def ensemble_to_bytes(stumps: Stumps) -> bytes:
    """Return the content of `ensemble.bin`; the same stumps give the same bytes."""
    header = msgspec.json.encode(_Header(stumps.n_inputs, stumps.shrinkage))
    arrays: dict[str, AnyArray] = {
        "columns": stumps.columns,
        "thresholds": stumps.thresholds,
        "values": stumps.values,
    }
    return seal(KIND, VERSION, pack(header, {name: array.astype(_DTYPES[name]) for name, array in arrays.items()}))


def ensemble_from_bytes(data: bytes, what: str = "ensemble.bin") -> Stumps:
    """Return the stumps of an `ensemble.bin`, which messages call `what`.

    Raises SealError for a file that is foreign, truncated, altered or newer, BuildError for one that contradicts
    itself.
    """
    _, payload = unseal(data, KIND, VERSION, what)
    header_bytes, arrays = unpack(payload, what)
    try:
        header = msgspec.json.decode(header_bytes, type=_Header)
    except (ValueError, RecursionError) as wrong:
        raise BuildError(f"{what} is damaged: {wrong}") from None
    if {name: array.dtype for name, array in arrays.items()} != {n: np.dtype(d) for n, d in _DTYPES.items()}:
        raise BuildError(f"{what} is damaged: it holds other arrays than {', '.join(_DTYPES)}")
    columns = arrays["columns"].astype(np.int32)
    if columns.ndim != 2 or not columns.size or not 2 <= columns.shape[1] <= MAX_CLASSES:
        raise BuildError(f"{what} is damaged: it has stumps of shape {columns.shape}, not of rounds and grasp types")
    if ((columns < 0) | (columns >= header.n_inputs)).any():
        raise BuildError(f"{what} is damaged: a stump asks for an input that there is not")
    if arrays["thresholds"].shape != columns.shape or arrays["values"].shape != (*columns.shape, 3):
        raise BuildError(f"{what} is damaged: its arrays are of different ensembles")
    thresholds, values = arrays["thresholds"].astype(np.float64), arrays["values"].astype(np.float64)
    # Written so that what is no number fails as well.
    if not ((np.abs(thresholds) <= _LARGEST_THRESHOLD).all() and (np.abs(values) <= _LARGEST_VALUE).all()):
        raise BuildError(f"{what} is damaged: it holds numbers beyond a million, or that are none")
    return Stumps(header.n_inputs, columns, thresholds, values, header.shrinkage)

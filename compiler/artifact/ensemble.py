"""`ensemble.bin`: the model that a build was collapsed from, kept for verification.

A sealed npz (compiler/arrays.py) in one of two formats.

Format 1, LogitBoost: columns (M, K) int32, thresholds (M, K) float64 and values (M, K, 3) float64, with a JSON header
{"n_inputs", "shrinkage"}.
Format 2, every other trainer: bias (K,), switch_rows (s, K), bins (j,) int64, thresholds (sum of bins - 1,) uint16 and
joint_rows (sum of bins, K); float64 unless stated; term_N_FIELD, the fields of further term N (`Term.arrays`), such as
a line or a grid; and the header {"kinds"}, the kinds of the further terms, if there are any.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from thenar.runtime.errors import BuildError
from thenar.runtime.model.integers import MAX_CLASSES, MAX_JOINTS, MAX_SWITCHES
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.base import HIGHEST_CODE, TERMS, Term
from thenar.runtime.sealed import seal, unseal

from ..arrays import AnyArray, pack, unpack
from ..model.collapse import collapse
from ..trainers.base import Model
from ..trainers.stumps import Stumps

KIND = b"THNRENSM"
STUMPS, TABLES = 1, 2  # formats
MAX_BYTES = 1 << 30

# This many times a column, a threshold and three values are just below a gigabyte.
MAX_STUMPS = 29_000_000

_DTYPES = {
    STUMPS: {"columns": "<i4", "thresholds": "<f8", "values": "<f8"},
    TABLES: {"bias": "<f8", "switch_rows": "<f8", "bins": "<i8", "thresholds": "<u2", "joint_rows": "<f8"},
}

# Larger than any value of boosting (logitboost.LARGEST_Z_MAX); for thresholds, larger than every code.
_LARGEST_VALUE, _LARGEST_THRESHOLD = 1e6, 1e6


class _StumpsHeader(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    n_inputs: Annotated[int, Meta(ge=1, le=MAX_SWITCHES + MAX_JOINTS)]
    shrinkage: Annotated[float, Meta(gt=0.0, le=1.0)]


def ensemble_to_bytes(model: Model) -> bytes:
    """Return the content of `ensemble.bin`; the same model gives the same bytes."""
    arrays: dict[str, AnyArray]
    if isinstance(model, Stumps):
        version, header = STUMPS, msgspec.json.encode(_StumpsHeader(model.n_inputs, model.shrinkage))
        arrays = {"columns": model.columns, "thresholds": model.thresholds, "values": model.values}
    else:
        kinds = [term.name for term in model.further]
        version, header = TABLES, msgspec.json.encode({"kinds": kinds} if kinds else {})
        arrays = {
            "bias": model.bias,
            "switch_rows": model.switch_rows,
            "bins": np.array([len(rows) for rows in model.joint_rows]),
            "thresholds": np.concatenate([np.zeros(0), *model.thresholds]),
            "joint_rows": np.concatenate([np.zeros((0, model.n_classes)), *model.joint_rows]),
        }
        for number, term in enumerate(model.further):
            arrays |= {f"term_{number}_{name}": array for name, array in term.arrays().items()}
    written = {name: array.astype(_DTYPES[version].get(name, array.dtype)) for name, array in arrays.items()}
    return seal(KIND, version, pack(header, written))


def ensemble_from_bytes(data: bytes, what: str = "ensemble.bin") -> Model:
    """Return the model of an `ensemble.bin`; error messages call the file `what`.

    Raises FormatError for a file that is foreign, truncated, altered or newer, and BuildError for an inconsistent one.
    """
    version, payload = unseal(data, KIND, TABLES, what)
    header_bytes, arrays = unpack(payload, what)
    dtypes = _DTYPES.get(version, {})
    found = {name: array.dtype for name, array in arrays.items() if version != TABLES or not name.startswith("term_")}
    if found != {name: np.dtype(dtype) for name, dtype in dtypes.items()}:
        raise BuildError(f"{what} is damaged: its arrays are not {', '.join(dtypes)}")
    try:
        if version == STUMPS:
            return _stumps(msgspec.json.decode(header_bytes, type=_StumpsHeader), arrays, what)
        kinds = msgspec.json.decode(header_bytes, type=dict[Literal["kinds"], tuple[str, ...]]).get("kinds", ())
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as wrong:
        raise BuildError(f"{what} is damaged: {wrong}") from None
    return _tables(arrays, kinds, what)


def model_fault(model: Model, n_switches: int, n_joints: int, n_classes: int) -> str:
    """Return the fault of a model of this many inputs and classes, to follow "a model that"; "" if valid."""
    if isinstance(model, Stumps):
        sizes, wanted = (model.n_inputs, model.n_classes), (n_switches + n_joints, n_classes)
        return (
            "" if sizes == wanted else f"has {sizes[0]} inputs and {sizes[1]} classes, not {wanted[0]} and {wanted[1]}"
        )
    try:
        tables = collapse(model, n_switches)
    except (ValueError, TypeError, IndexError) as wrong:
        return f"has a term that makes no sense: {wrong}"
    shapes = [tables.bias.shape, tables.switch_rows.shape, *(rows.shape for rows in tables.joint_rows)]
    bins = [(len(thresholds) + 1, n_classes) for thresholds in tables.thresholds]
    if len(bins) != n_joints or shapes != [(n_classes,), (n_switches, n_classes), *bins]:
        return f"has tables whose shapes do not fit {n_switches} switches, {n_joints} joints and {n_classes} classes"
    if any(map(_disordered, tables.thresholds)):
        return "has thresholds that are not codes, or not increasing"
    if fault := _lines_fault(tables) or _grids_fault(tables):
        return fault
    # Written so that NaN fails as well.
    if not all(term.largest <= _LARGEST_VALUE for term in tables.core_terms) or not (
        (np.abs(tables.bias) <= _LARGEST_VALUE).all()
    ):
        return "holds numbers beyond a million, or NaN"
    return ""


def _disordered(thresholds: AnyArray) -> bool:
    return thresholds.dtype != np.uint16 or bool((np.diff(thresholds.astype(int)) < 1).any())


def _lines_fault(tables: ScoreTables) -> str:
    joints = [line.joint for line in tables.lines]
    if joints != sorted(set(joints)) or any(not 0 <= joint < tables.n_joints for joint in joints):
        return "has lines of unknown joints, or not in the order of the joints"
    if any(not 0 <= line.low < line.high <= HIGHEST_CODE for line in tables.lines):
        return "has lines whose ends are not codes, or not increasing"
    if any(line.row.shape != tables.bias.shape for line in tables.lines):
        return f"has lines whose rows do not have {tables.n_classes} classes"
    return ""


def _grids_fault(tables: ScoreTables) -> str:
    joints = [joint for grid in tables.grids for joint in grid.joints]
    if not joints:
        return ""
    if tables.lines:
        return "has both lines and grids of joints: only one is allowed"
    if any(not 0 <= a < b < tables.n_joints for a, b in (grid.joints for grid in tables.grids)):
        return "has grids of unknown joints"
    if len(set(joints)) < len(joints) or joints[::2] != sorted(joints[::2]):
        return "has grids that share a joint, or are not in the order of their joints"
    for grid in tables.grids:
        if any(map(_disordered, grid.thresholds)):
            return "has grids whose thresholds are not codes, or not increasing"
        if grid.rows.shape != (*(len(each) + 1 for each in grid.thresholds), tables.n_classes):
            return "has grids whose rows do not fit their thresholds"
    return ""


def _stumps(header: _StumpsHeader, arrays: Mapping[str, AnyArray], what: str) -> Stumps:
    columns = arrays["columns"].astype(np.int32)
    if columns.ndim != 2 or not columns.size or not 2 <= columns.shape[1] <= MAX_CLASSES:
        raise BuildError(f"{what} is damaged: its stumps have shape {columns.shape}, not (rounds, grasp types)")
    if ((columns < 0) | (columns >= header.n_inputs)).any():
        raise BuildError(f"{what} is damaged: a stump uses an input that does not exist")
    if arrays["thresholds"].shape != columns.shape or arrays["values"].shape != (*columns.shape, 3):
        raise BuildError(f"{what} is damaged: its arrays belong to different ensembles")
    thresholds, values = arrays["thresholds"].astype(np.float64), arrays["values"].astype(np.float64)
    if not ((np.abs(thresholds) <= _LARGEST_THRESHOLD).all() and (np.abs(values) <= _LARGEST_VALUE).all()):
        raise BuildError(f"{what} is damaged: it holds numbers beyond a million, or NaN")
    return Stumps(header.n_inputs, columns, thresholds, values, header.shrinkage)


def _tables(arrays: Mapping[str, AnyArray], kinds: Sequence[str], what: str) -> ScoreTables:
    bias, switch_rows, joint_rows = (arrays[name].astype(np.float64) for name in ("bias", "switch_rows", "joint_rows"))
    bins, thresholds = arrays["bins"].astype(np.int64), arrays["thresholds"].astype(np.uint16)
    dimensions = (bias.ndim, switch_rows.ndim, bins.ndim, thresholds.ndim, joint_rows.ndim)
    if dimensions != (1, 2, 1, 1, 2) or not 2 <= len(bias) <= MAX_CLASSES or len(bins) > MAX_JOINTS:
        raise BuildError(f"{what} is damaged: its arrays do not form tables")
    if (bins < 1).any() or sum(bins.tolist()) != len(joint_rows) or len(thresholds) != len(joint_rows) - len(bins):
        raise BuildError(f"{what} is damaged: its arrays belong to different tables")
    ends = np.cumsum(bins)[:-1]
    steps = np.split(thresholds, ends - np.arange(1, len(bins))) if len(bins) else []
    rows = np.split(joint_rows, ends) if len(bins) else []
    tables = ScoreTables.of(bias, switch_rows, steps, rows, _further(arrays, kinds, what))
    if fault := model_fault(tables, len(switch_rows), len(bins), len(bias)):
        raise BuildError(f"{what} is damaged: it {fault}")
    return tables


def _further(arrays: Mapping[str, AnyArray], kinds: Sequence[str], what: str) -> tuple[Term, ...]:
    """Return the further terms of these kinds. Raises SettingError for a kind that no installed package defines."""
    terms, names = list[Term](), set(_DTYPES[TABLES])
    for number, name in enumerate(kinds):
        prefix = f"term_{number}_"
        fields = {key.removeprefix(prefix): array for key, array in arrays.items() if key.startswith(prefix)}
        kind = TERMS.named(name)
        try:
            terms.append(kind.from_arrays(fields))
        except (KeyError, TypeError, ValueError, IndexError) as wrong:
            raise BuildError(f"{what} is damaged: term {number}, {name!r}, makes no sense: {wrong}") from None
        names |= {f"{prefix}{field}" for field in terms[-1].arrays()}
    if strange := sorted(arrays.keys() - names):
        raise BuildError(f"{what} is damaged: {strange[0]} belongs to no term")
    return tuple(terms)

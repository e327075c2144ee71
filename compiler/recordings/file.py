"""The `.grasps` file: a sealed npz (arrays.py) of a JSON header and six arrays.

switches  (n, ceil(s / 8)) uint8    eight switches to the byte, the first in the highest bit
codes     (n, j) uint16
grasps    (n,) uint32               index into the taxonomy's types
subjects, objects (n,) uint32       index into the header's names
trials    (n,) int64
"""

from pathlib import Path
from typing import TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.runtime.errors import SealError
from thenar.runtime.files import read_file, write_atomically
from thenar.runtime.nesting import check_json
from thenar.runtime.sealed import seal, unseal

from .arrays import AnyArray, pack, unpack
from .errors import RecordingError
from .graspset import GraspSet, Joint
from .limits import LARGEST
from .names import check_room
from .taxonomy import Taxonomy

KIND = b"THNRGRSP"
VERSION = 1
# Rows, columns and grasp types of a set.
MOST = 10_000_000

_DTYPES = {"switches": "u1", "codes": "<u2", "grasps": "<u4", "subjects": "<u4", "objects": "<u4", "trials": "<i8"}

AnyGraspSet = TypeVar("AnyGraspSet", bound=GraspSet)


class _Header(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    rows: int
    switches: tuple[str, ...]
    joints: tuple[Joint, ...]
    taxonomy: Taxonomy
    subjects: tuple[str, ...]
    objects: tuple[str, ...]
    simulated: str = ""


def save(grasp_set: GraspSet, path: Path) -> None:
    """Write `grasp_set` to `path`, whole or not at all. Raises OSError as the operating system gives it."""
    write_atomically(path, seal(KIND, VERSION, _pack(grasp_set)))


def load(cls: type[AnyGraspSet], path: Path) -> AnyGraspSet:
    """Read `path`; raises SealError with the reason if it is foreign, cut, altered, too new or inconsistent."""
    _, payload = unseal(read_file(path, LARGEST, SealError), KIND, VERSION, path.name)
    try:
        return _unpack(cls, len(payload), *unpack(payload, path.name))
    except (RecordingError, msgspec.DecodeError, ValueError) as reason:
        raise SealError(f"{path.name} contradicts itself: {reason}") from reason


def _pack(grasp_set: GraspSet) -> bytes:
    subjects, subject = np.unique(grasp_set.subjects, return_inverse=True)
    objects, object_ = np.unique(grasp_set.objects, return_inverse=True)
    header = _Header(
        rows=len(grasp_set),
        switches=grasp_set.switch_names,
        joints=grasp_set.joints,
        taxonomy=grasp_set.taxonomy,
        subjects=tuple(subjects.tolist()),
        objects=tuple(objects.tolist()),
        simulated=grasp_set.simulated,
    )
    arrays: dict[str, AnyArray] = {
        "switches": np.packbits(grasp_set.switches, axis=1),
        "codes": grasp_set.codes,
        "grasps": grasp_set.labels,
        "subjects": subject,
        "objects": object_,
        "trials": grasp_set.trials,
    }
    return pack(msgspec.json.encode(header), {name: array.astype(_DTYPES[name]) for name, array in arrays.items()})


def _unpack(cls: type[AnyGraspSet], size: int, header_bytes: bytes, arrays: dict[str, AnyArray]) -> AnyGraspSet:
    check_json(header_bytes)
    header = msgspec.json.decode(header_bytes, type=_Header)
    _check_arrays(header, arrays)
    # Viewed and frozen, so that the set takes it without a copy.
    switches = np.unpackbits(arrays["switches"].astype(np.uint8, copy=False), axis=1, count=len(header.switches)).view(
        np.bool_
    )
    switches.setflags(write=False)
    return cls(
        switches=switches,
        switch_names=header.switches,
        codes=arrays["codes"].astype(np.uint16),
        joints=header.joints,
        grasps=_names("grasps", header.taxonomy.types, arrays, size),
        taxonomy=header.taxonomy,
        subjects=_names("subjects", header.subjects, arrays, size),
        objects=_names("objects", header.objects, arrays, size),
        trials=arrays["trials"].astype(np.int64),
        simulated=header.simulated,
    )


def _check_arrays(header: _Header, arrays: dict[str, AnyArray]) -> None:
    if max(header.rows, len(header.switches) + len(header.joints), len(header.taxonomy.types)) > MOST:
        raise RecordingError(f"it has more than {MOST} rows, columns or grasp types")
    if arrays.keys() != _DTYPES.keys():
        raise RecordingError(f"it holds the arrays {sorted(arrays)}, not {sorted(_DTYPES)}")
    widths = {"switches": -(-len(header.switches) // 8), "codes": len(header.joints)}
    for name, array in arrays.items():
        shape = (header.rows, widths[name]) if name in widths else (header.rows,)
        if array.dtype != np.dtype(_DTYPES[name]) or array.shape != shape:
            raise RecordingError(f"{name} is {array.dtype} {array.shape}, not {_DTYPES[name]} {shape}")


def _names(what: str, names: tuple[str, ...], arrays: dict[str, AnyArray], size: int) -> NDArray[np.str_]:
    index = arrays[what].astype(np.intp)
    if index.size and int(index.max()) >= len(names):
        raise RecordingError(f"{what} refers to name {int(index.max())} of {len(names)}")
    check_room(max(len(index), len(names)), max(map(len, names), default=0), size)
    found: NDArray[np.str_] = np.array(names, dtype=np.str_)[index]
    found.setflags(write=False)
    return found

"""`GraspSet`: labelled grasps, the input of the rest of the compiler, and their `.grasps` file.

The file is a sealed npz (compiler/arrays.py) of a JSON header and these arrays:

switches  (n, ceil(s / 8)) uint8    eight switches to the byte, the first in the highest bit
codes     (n, j) uint16
grasps    (n,) uint32               index into the taxonomy's types; their number: nothing is held
subjects, objects (n,) uint32       index into the header's names
trials    (n,) int64
sessions  (n,) uint32               index into the header's names; only where there are several, and then in format 2
taxels    (n, t) uint16             only where there are any, and then in format 2
times     (n,) int64                microseconds; only where they are known, and then in format 2
"""

import hashlib
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from thenar.runtime.errors import FormatError
from thenar.runtime.files import read_file, write_atomically
from thenar.runtime.names import LONGEST_NAME, fault, shortened
from thenar.runtime.sealed import seal, unseal

from ..arrays import AnyArray, groups, pack, unpack
from ..text import counted, trials_of_frames
from . import LARGEST, RecordingError, check_names, check_room
from .taxonomy import Taxonomy

CODES = 65536
# Far enough from the limits of doubles that spans and margins of values stay finite, and steps keep all their bits.
LARGEST_VALUE = 1e300


@dataclass(frozen=True, slots=True)
class Joint:
    """One joint of the glove: its name, and the meaning of its integer codes, as two points of a straight line.

    Models are trained on codes; values are for people.

    Parameters
    ----------
    name, unit : str
        The name of the joint, and the unit of its values, such as "deg".
    code_a, code_b : int
        Two different codes from 0 to 65535.
    value_a, value_b : float
        Their values, within +-1e300.

    Raises
    ------
    RecordingError
        If the points do not define a line, or neighbouring codes would be closer than a billionth of the largest value.

    Examples
    --------
    >>> from thenar.compiler import Joint
    >>> thumb = Joint("thumb", "deg", 0, -20.0, 200, 80.0)
    >>> float(thumb.value(40)), float(thumb.code(0.1))
    (0.0, 40.0)
    """

    name: str
    unit: str
    code_a: int
    value_a: float
    code_b: int
    value_b: float

    def __post_init__(self) -> None:
        check_names("joint", [self.name])
        check_names(f"unit of joint {self.name}", [self.unit])
        if self.code_a == self.code_b or not all(0 <= code < CODES for code in (self.code_a, self.code_b)):
            raise RecordingError(
                f"joint {self.name} is calibrated at codes {self.code_a} and {self.code_b}: take two of 0..{CODES - 1}"
            )
        largest = max(abs(self.value_a + (code - self.code_a) * self.step) for code in (0, CODES - 1))
        if not (largest <= LARGEST_VALUE and abs(self.step) > max(1e-9 * largest, 1 / LARGEST_VALUE)):
            raise RecordingError(
                f"joint {self.name} is calibrated to {self.value_a} and {self.value_b} {self.unit}: "
                "its codes cannot be distinguished; take a coarser grid or points further apart"
            )

    @property
    def step(self) -> float:
        """The value of one code step, in `unit`; negative if values fall as codes rise."""
        return (self.value_b - self.value_a) / (self.code_b - self.code_a)

    def value(self, code: ArrayLike) -> NDArray[np.float64]:
        """Return the value in `unit` of a code or an array of codes."""
        return self.value_a + (np.asarray(code, dtype=np.float64) - self.code_a) * self.step

    def code(self, value: ArrayLike) -> NDArray[np.float64]:
        """Return the nearest codes to `value`, as whole floats that may lie outside 0..65535 (even infinite)."""
        with np.errstate(over="ignore"):
            return np.rint(self.code_a + (np.asarray(value, dtype=np.float64) - self.value_a) / self.step)


@dataclass(frozen=True, slots=True, eq=False)
class GraspSet:
    """n recorded grasps with s switches and j joints; arrays are validated and read-only.

    Parameters
    ----------
    switches : (n, s) array of bool
        Which switches were closed.
    switch_names : tuple of str
        The switches' names.
    codes : (n, j) array of uint16
        The joints' integer codes.
    joints : tuple of Joint
        The names of the codes, and their meaning in degrees or another unit.
    grasps : (n,) array of str
        The grasp type of each row, a type of the taxonomy, or "none" if nothing is held.
    taxonomy : Taxonomy
        All possible grasp types, in order.
    subjects, objects : (n,) arrays of str
        Who grasped which object.
    trials : (n,) array of int64
        The number of the repetition. Rows of one subject, grasp type, object, session and number are the frames of one
        trial.
    simulated : str, optional
        The simulator that produced them; empty: they were recorded.
    sessions : (n,) array of str, optional
        Sessions, between which the glove was taken off. None: a single session, "1".
    independent : bool
        Whether the rows are stated to be separate trials; then all `trials` are 1.
    taxels : (n, t) array of uint16, optional
        The codes of analog columns that training turns into switches, with learned thresholds.
    taxel_columns : tuple of Joint
        Their names, and the meaning of their codes.
    times_us : (n,) array of int64, optional
        The time of each row, in microseconds on a clock of its subject and session. None: unknown.

    Attributes
    ----------
    labels : (n,) array of intp
        The index of each grasp in `taxonomy.types`, and the number of types if nothing is held.

    Raises
    ------
    RecordingError
        With a message that names the invalid array and row.

    Examples
    --------
    >>> import numpy as np
    >>> from thenar.compiler.recordings.graspset import GraspSet
    >>> from thenar.compiler.recordings.taxonomy import own
    >>> grasp_set = GraspSet(
    ...     switches=np.array([[True, False], [False, True]]),
    ...     switch_names=("thumb", "index"),
    ...     codes=np.zeros((2, 0), np.uint16),
    ...     joints=(),
    ...     grasps=np.array(["pinch", "hook"]),
    ...     taxonomy=own(["pinch", "hook"]),
    ...     subjects=np.array(["A", "A"]),
    ...     objects=np.array(["pin", "bag"]),
    ...     trials=np.array([1, 2]),
    ... )
    >>> grasp_set
    GraspSet: 2 trials of 2 frames, 2 grasp types (own), 2 switches, 0 joints, 1 subjects, 2 objects
    >>> grasp_set.rows(grasp_set.grasps == "hook").switches
    array([[False,  True]])
    """

    switches: NDArray[np.bool_]
    switch_names: tuple[str, ...]
    codes: NDArray[np.uint16]
    joints: tuple[Joint, ...]
    grasps: NDArray[np.str_]
    taxonomy: Taxonomy
    subjects: NDArray[np.str_]
    objects: NDArray[np.str_]
    trials: NDArray[np.int64]
    labels: NDArray[np.intp] = field(init=False)
    simulated: str = ""
    sessions: NDArray[np.str_] = field(default_factory=lambda: np.empty(0, np.str_))
    independent: bool = False
    taxels: NDArray[np.uint16] = field(default_factory=lambda: np.empty(0, np.uint16))
    taxel_columns: tuple[Joint, ...] = ()
    times_us: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))

    def __post_init__(self) -> None:
        rows = len(self.grasps)
        check_names("column", (*self.element_names, *self.joint_names))
        if not self.element_names and not self.joints:
            raise RecordingError("a set of grasps needs at least one switch or joint")
        if not self.taxels.size:
            object.__setattr__(self, "taxels", np.zeros((rows, len(self.taxel_columns)), np.uint16))
        self._freeze("taxels", np.uint16, (rows, len(self.taxel_columns)))
        self._freeze("switches", np.bool_, (rows, len(self.switch_names)))
        self._freeze("codes", np.uint16, (rows, len(self.joints)))
        if not self.sessions.size:
            object.__setattr__(self, "sessions", np.full(rows, "1"))
        for name in ("grasps", "subjects", "objects", "sessions"):
            self._freeze(name, np.str_, (rows,))
            check_names(name[:-1], np.unique(getattr(self, name)).tolist())
        self._freeze("trials", np.int64, (rows,))
        if self.independent:
            object.__setattr__(self, "trials", np.ones(rows, np.int64))
            self.trials.setflags(write=False)
        self._freeze("times_us", np.int64, (rows if self.times_us.size else 0,))
        if self.simulated and (reason := fault(self.simulated, 2 * LONGEST_NAME)):
            raise RecordingError(f"simulated {shortened(repr(self.simulated))} {reason}")
        object.__setattr__(self, "labels", self._label())
        self.labels.setflags(write=False)

    def _freeze(self, name: str, dtype: type[np.generic], shape: tuple[int, ...]) -> None:
        """Replace array `name` by its read-only copy; a read-only array is used without a copy."""
        given = np.asarray(getattr(self, name))
        if given.shape != shape:
            raise RecordingError(f"{name} has shape {given.shape}, not {shape}")
        textual = given.dtype.kind == "U"
        if given.size and (textual != (dtype is np.str_) or given.dtype.kind not in "biuU"):
            raise RecordingError(f"{name} holds {given.dtype}, not {dtype.__name__.rstrip('_')}")
        array = given.astype(dtype, copy=given.flags.writeable)
        if array.dtype != given.dtype and not np.array_equal(array, given):
            raise RecordingError(f"{name} holds numbers that do not fit into {dtype.__name__.rstrip('_')}")
        array.setflags(write=False)
        object.__setattr__(self, name, array)

    def _label(self) -> NDArray[np.intp]:
        found, where = np.unique(self.grasps, return_inverse=True)
        number = {grasp: label for label, grasp in enumerate(self.taxonomy.names)}
        for grasp in found.tolist():
            if grasp not in number:
                row = int(np.flatnonzero(self.grasps == grasp)[0])
                name = shortened(self.taxonomy.name)
                raise RecordingError(f"row {row}: {shortened(repr(grasp))} is not a type of taxonomy {name}")
        return np.array([number[grasp] for grasp in found.tolist()], dtype=np.intp)[where]

    def __len__(self) -> int:
        return len(self.grasps)

    def __repr__(self) -> str:
        subjects, objects = (len(np.unique(each)) for each in (self.subjects, self.objects))
        types = len(np.unique(self.labels[~self.is_none]))
        what = f"{self.size}, {counted(types, 'grasp type')} ({shortened(self.taxonomy.name)})"
        taxels = f"{len(self.taxel_columns)} taxels, " if self.taxel_columns else ""
        read = f"{len(self.switch_names)} switches, {taxels}{len(self.joints)} joints"
        who = f"{read}, {subjects} subjects, {objects} objects"
        return f"GraspSet: {what}, {who}" + (f"\nsimulated: {shortened(self.simulated)}" if self.simulated else "")

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints' names, in the order of `codes`."""
        return tuple(joint.name for joint in self.joints)

    @property
    def taxel_names(self) -> tuple[str, ...]:
        """The taxels' names, in the order of `taxels`."""
        return tuple(taxel.name for taxel in self.taxel_columns)

    @property
    def element_names(self) -> tuple[str, ...]:
        """The names of the columns that a placement chooses from: the switches, then the taxels."""
        return (*self.switch_names, *self.taxel_names)

    @property
    def trial_ids(self) -> NDArray[np.intp]:
        """The trial of each row, numbered from 0 in the order of first appearance."""
        if self.independent:
            return np.arange(len(self))
        return groups(self.labels, self.subjects, self.objects, self.sessions, self.trials)

    @property
    def n_trials(self) -> int:
        """The number of trials, grasps and rests."""
        return int(self.trial_ids.max(initial=-1)) + 1

    @property
    def rests(self) -> int:
        """The number of trials in which nothing is held."""
        return len(np.unique(self.trial_ids[self.is_none]))

    @property
    def size(self) -> str:
        """The numbers of trials and frames in words: "360 trials (180 grasps, 180 rests) of 2,880 frames"."""
        return trials_of_frames(len(self), self.n_trials, self.rests)

    @property
    def is_none(self) -> NDArray[np.bool_]:
        """Where nothing is held (n,)."""
        return np.asarray(self.labels == len(self.taxonomy.types))

    @property
    def movement_ids(self) -> NDArray[np.intp]:
        """The movement of each row: a trial, and the rows of its number, subject, object and session without a grasp.

        Such rows belong to the trial before them, or to the first. No fold splits the rows of a movement.
        """
        trials, none = self.trial_ids, self.is_none
        if not none.any() or self.independent:
            return trials
        key = groups(self.subjects, self.objects, self.sessions, self.trials)
        order = np.argsort(key, kind="stable")
        place, held = np.arange(len(order)), ~none[order]
        first = np.concatenate([[0], np.flatnonzero(np.diff(key[order])) + 1])
        beyond = np.append(first[1:], len(order))[key[order]]
        before = np.maximum.accumulate(np.where(held, place, -1))
        after = np.minimum.accumulate(np.where(held, place, len(order))[::-1])[::-1]
        chosen = np.where(before >= first[key[order]], before, np.where(after < beyond, after, place))
        joined = trials.copy()
        joined[order] = trials[order[chosen]]
        return groups(joined)

    def without_none(self) -> "GraspSet":
        """Return the set of the rows with a grasp."""
        return self.rows(~self.is_none) if self.is_none.any() else self

    def rows(self, index: ArrayLike) -> "GraspSet":
        """Return the set of the rows selected by `index` (numbers or a mask of n), in that order."""
        pick = np.asarray(index)
        pick = pick if pick.size else pick.astype(np.intp)
        rowed = ("switches", "codes", "taxels", "grasps", "subjects", "objects", "sessions", "trials")
        picked = {name: getattr(self, name)[pick] for name in rowed}
        return replace(self, **picked, times_us=self.times_us[pick] if self.times_us.size else self.times_us)

    def fingerprint(self) -> str:
        """Return the SHA-256 of the content, in hex: equal for equal sets, independent of file and machine."""
        names = (self.switch_names, self.joints, self.taxonomy)
        texts = [array.tolist() for array in (self.grasps, self.subjects, self.objects)]
        digest = hashlib.sha256(msgspec.json.encode((len(self), names, texts)))
        digest.update(np.packbits(self.switches, axis=1).tobytes())
        digest.update(self.codes.astype("<u2").tobytes())
        digest.update(self.trials.astype("<i8").tobytes())
        digest.update(self.simulated.encode())
        if self._format > 1:
            digest.update(msgspec.json.encode((self.sessions.tolist(), self.independent)))
        if self.taxel_columns:
            digest.update(msgspec.json.encode(self.taxel_columns))
            digest.update(self.taxels.astype("<u2").tobytes())
        if self.times_us.size:
            digest.update(self.times_us.astype("<i8").tobytes())
        return digest.hexdigest()

    @property
    def _format(self) -> int:
        """The format of its file: 2 with sessions, taxels, times, rows in which nothing is held, or rows that are
        stated to be independent.
        """
        several = (self.sessions != "1").any() or self.times_us.size > 0 or self.is_none.any()
        return 1 + bool(self.independent or self.taxel_columns or several)

    @staticmethod
    def load(path: str | Path) -> "GraspSet":
        """Read a `.grasps` file; raises FormatError with the reason if it is foreign, truncated, altered, newer or
        invalid.
        """
        name = Path(path).name
        _, payload = unseal(read_file(Path(path), LARGEST, FormatError), KIND, VERSION, name)
        try:
            return _unpack(len(payload), *unpack(payload, name))
        except (RecordingError, msgspec.DecodeError, ValueError, RecursionError) as reason:
            raise FormatError(f"{name} is inconsistent: {reason}") from reason

    def save(self, path: str | Path) -> None:
        """Write a `.grasps` file, completely or not at all; the same set gives the same bytes."""
        write_atomically(Path(path), self.encoded())

    def encoded(self) -> bytes:
        """Return the bytes of its `.grasps` file."""
        return seal(KIND, self._format, _pack(self))


KIND = b"THNRGRSP"
VERSION = 2
# The most rows, columns and grasp types of a set.
MOST = 10_000_000

_DTYPES = {"switches": "u1", "codes": "<u2", "taxels": "<u2", "trials": "<i8", "times": "<i8"}
_TEXTS = ("subjects", "objects", "sessions")
_DTYPES |= dict.fromkeys(("grasps", *_TEXTS), "<u4")


class _Header(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    rows: int
    switches: tuple[str, ...]
    joints: tuple[Joint, ...]
    taxonomy: Taxonomy
    subjects: tuple[str, ...]
    objects: tuple[str, ...]
    simulated: str = ""
    sessions: tuple[str, ...] = ()
    independent: bool = False
    taxels: tuple[Joint, ...] = ()
    times: bool = False


def _pack(grasp_set: GraspSet) -> bytes:
    texts = {name: np.unique(getattr(grasp_set, name), return_inverse=True) for name in _TEXTS}
    subjects, objects, sessions = (tuple(names.tolist()) for names, _ in texts.values())
    header = _Header(
        rows=len(grasp_set),
        switches=grasp_set.switch_names,
        joints=grasp_set.joints,
        taxonomy=grasp_set.taxonomy,
        subjects=subjects,
        objects=objects,
        simulated=grasp_set.simulated,
        sessions=sessions if sessions != ("1",) else (),
        independent=grasp_set.independent,
        taxels=grasp_set.taxel_columns,
        times=grasp_set.times_us.size > 0,
    )
    arrays: dict[str, AnyArray] = {
        "switches": np.packbits(grasp_set.switches, axis=1),
        "codes": grasp_set.codes,
        "grasps": grasp_set.labels,
        "subjects": texts["subjects"][1],
        "objects": texts["objects"][1],
        "trials": grasp_set.trials,
    }
    if header.sessions:
        arrays["sessions"] = texts["sessions"][1]
    if header.taxels:
        arrays["taxels"] = grasp_set.taxels
    if header.times:
        arrays["times"] = grasp_set.times_us
    return pack(msgspec.json.encode(header), {name: array.astype(_DTYPES[name]) for name, array in arrays.items()})


def _unpack(size: int, header_bytes: bytes, arrays: dict[str, AnyArray]) -> GraspSet:
    header = msgspec.json.decode(header_bytes, type=_Header)
    _check_arrays(header, arrays)
    # Read-only views, which the set uses without a copy.
    switches = np.unpackbits(arrays["switches"].astype(np.uint8, copy=False), axis=1, count=len(header.switches)).view(
        np.bool_
    )
    switches.setflags(write=False)
    return GraspSet(
        switches=switches,
        switch_names=header.switches,
        codes=arrays["codes"].astype(np.uint16),
        joints=header.joints,
        grasps=_names("grasps", header.taxonomy.names, arrays, size),
        taxonomy=header.taxonomy,
        subjects=_names("subjects", header.subjects, arrays, size),
        objects=_names("objects", header.objects, arrays, size),
        trials=arrays["trials"].astype(np.int64),
        simulated=header.simulated,
        sessions=_names("sessions", header.sessions, arrays, size) if header.sessions else np.empty(0, np.str_),
        independent=header.independent,
        taxels=arrays["taxels"].astype(np.uint16) if header.taxels else np.empty(0, np.uint16),
        taxel_columns=header.taxels,
        times_us=arrays["times"].astype(np.int64) if header.times else np.empty(0, np.int64),
    )


def _check_arrays(header: _Header, arrays: dict[str, AnyArray]) -> None:
    columns = len(header.switches) + len(header.joints) + len(header.taxels)
    if max(header.rows, columns, len(header.taxonomy.types)) > MOST:
        raise RecordingError(f"it has more than {MOST} rows, columns or grasp types")
    optional = {"sessions": header.sessions, "taxels": header.taxels, "times": header.times}
    absent = {name for name, there in optional.items() if not there}
    expected = _DTYPES.keys() - absent
    if arrays.keys() != expected:
        raise RecordingError(f"it holds the arrays {sorted(arrays)}, not {sorted(expected)}")
    widths = {"switches": -(-len(header.switches) // 8), "codes": len(header.joints), "taxels": len(header.taxels)}
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

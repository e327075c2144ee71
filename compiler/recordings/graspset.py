"""`GraspSet`: labelled grasps, as everything else in the compiler takes them."""

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from thenar.runtime.names import shortened

from .errors import RecordingError
from .names import check_names, check_simulated
from .taxonomy import Taxonomy

CODES = 65536
# So far from the ends of the doubles that spans and margins of values stay finite, and that steps keep all their bits.
LARGEST_VALUE = 1e300


@dataclass(frozen=True, slots=True)
class Joint:
    """One joint of the glove: its name, and what its integer codes mean in `unit`, by two points of a straight line.

    Codes are what is trained on and recognised; values are for people. Raises RecordingError if the two points are no
    line, or if neighbouring codes would be closer than a billionth of the largest value; values lie within +-1e300, and
    steps are above 1e-300.
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
                "its codes cannot be told apart; take a coarser grid or points further apart"
            )

    @property
    def step(self) -> float:
        """What one code is worth, in `unit`; negative when values fall as codes rise."""
        return (self.value_b - self.value_a) / (self.code_b - self.code_a)

    def value(self, code: ArrayLike) -> NDArray[np.float64]:
        """Return the value in `unit` of a code or an array of codes."""
        return self.value_a + (np.asarray(code, dtype=np.float64) - self.code_a) * self.step

    def code(self, value: ArrayLike) -> NDArray[np.float64]:
        """Return the nearest codes of `value`, as whole floats that may lie outside 0..65535 (infinitely far)."""
        with np.errstate(over="ignore"):
            return np.rint(self.code_a + (np.asarray(value, dtype=np.float64) - self.value_a) / self.step)


@dataclass(frozen=True, slots=True, eq=False)
class GraspSet:
    """n recorded grasps; arrays are checked, and cannot be written to.

    switches  (n, s) bool      switch_names  s names
    codes     (n, j) uint16    joints        j Joints, the codes' names and calibration
    grasps    (n,) str         taxonomy      holds every one of them
    subjects, objects (n,) str, trials (n,) int64: who, what with, and the number of the repetition
    labels    (n,) intp        index of each grasp in taxonomy.types
    simulated                  what simulated them; empty: they were recorded

    Raises RecordingError naming the array and the row that does not fit.
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

    def __post_init__(self) -> None:
        rows = len(self.grasps)
        check_names("column", (*self.switch_names, *self.joint_names))
        if not self.switch_names and not self.joints:
            raise RecordingError("a set of grasps needs at least one switch or joint")
        self._freeze("switches", np.bool_, (rows, len(self.switch_names)))
        self._freeze("codes", np.uint16, (rows, len(self.joints)))
        for name in ("grasps", "subjects", "objects"):
            self._freeze(name, np.str_, (rows,))
            check_names(name[:-1], np.unique(getattr(self, name)).tolist())
        self._freeze("trials", np.int64, (rows,))
        check_simulated(self.simulated)
        object.__setattr__(self, "labels", self._label())
        self.labels.setflags(write=False)

    def _freeze(self, name: str, dtype: type[np.generic], shape: tuple[int, ...]) -> None:
        """Replace array `name` by its read-only copy; a read-only array is taken as it is."""
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
        number = {grasp: label for label, grasp in enumerate(self.taxonomy.types)}
        for grasp in found.tolist():
            if grasp not in number:
                row = int(np.flatnonzero(self.grasps == grasp)[0])
                name = shortened(self.taxonomy.name)
                raise RecordingError(f"row {row}: {shortened(repr(grasp))} is not a type of taxonomy {name}")
        return np.array([number[grasp] for grasp in found.tolist()], dtype=np.intp)[where]

    def __len__(self) -> int:
        return len(self.grasps)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints' names, in the order of `codes`."""
        return tuple(joint.name for joint in self.joints)

    def rows(self, index: ArrayLike) -> "GraspSet":
        """Return the set of the rows that `index` picks (numbers or a mask of n), in that order."""
        pick = np.asarray(index)
        pick = pick if pick.size else pick.astype(np.intp)
        return GraspSet(
            switches=self.switches[pick],
            switch_names=self.switch_names,
            codes=self.codes[pick],
            joints=self.joints,
            grasps=self.grasps[pick],
            taxonomy=self.taxonomy,
            subjects=self.subjects[pick],
            objects=self.objects[pick],
            trials=self.trials[pick],
            simulated=self.simulated,
        )

    def fingerprint(self) -> str:
        """Return the SHA-256 of the content, in hex: equal for equal sets, whatever file or machine they come from."""
        names = (self.switch_names, self.joints, self.taxonomy)
        texts = [array.tolist() for array in (self.grasps, self.subjects, self.objects)]
        digest = hashlib.sha256(msgspec.json.encode((len(self), names, texts)))
        digest.update(np.packbits(self.switches, axis=1).tobytes())
        digest.update(self.codes.astype("<u2").tobytes())
        digest.update(self.trials.astype("<i8").tobytes())
        digest.update(self.simulated.encode())
        return digest.hexdigest()

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a `.grasps` file; raises SealError with the reason if it is foreign, truncated, altered or too new."""
        from .file import load

        return load(cls, Path(path))

    def save(self, path: str | Path) -> None:
        """Write a `.grasps` file, whole or not at all; the same set gives the same bytes."""
        from .file import save

        save(self, Path(path))

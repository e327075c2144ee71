"""The rows of a set as plain arrays: samples to train on, and the inputs that a build reads."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError
from thenar.runtime.manifest import Calibration, Manifest, Switch
from thenar.runtime.model.integers import MAX_CLASSES
from thenar.runtime.names import list_names, nearest
from thenar.runtime.recipe import Inputs

from .arrays import groups
from .artifact import CompileError
from .recordings.graspset import GraspSet, Joint
from .text import counted

Columns = tuple[int, ...]

# Copies of each row with an input lost: 8 took twice the time of 4, for half a point less at the worst single loss.
MASKED = 4
# Most frames of a movement to train on: one every 30 to 50 ms of a movement that lasts a second or two.
FRAMES = 32


class TrainingError(ThenarError, ValueError):
    """Rows, settings or limits of a placement from which nothing can be learnt."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Rows of a training set, of one fold or of everything.

    Parameters
    ----------
    switches : ndarray of bool, shape (n, s)
        True for a closed switch.
    codes : ndarray of uint16, shape (n, j)
        The joints' codes. With j = 0 only the switches are used.
    labels : ndarray of intp, shape (n,)
        Class numbers, which index `grasps`.
    grasps : tuple of str
        The grasp types, and with `has_none` NONE as the last. A fold keeps all of them, whether they occur in it or
        not.
    trials, subjects : ndarray of intp, shape (n,), optional
        The number of each row's trial and subject: inner folds must not split them. By default each row is a separate
        trial, of one subject.
    taxels : ndarray of uint16, shape (n, t), optional
        Codes from which a placement learns bits, by thresholds: placement/elements.py.
    movements : ndarray of intp, shape (n,), optional
        The number of each row's movement, which no fold splits: a trial, and the rows of nothing held before and after
        it. By default each trial is one.
    has_none : bool
        Whether the last class means that nothing is held.
    silent : ndarray of bool, shape (n,), optional
        Rows that show which type is held but not whether any is, as in recordings of static grasps: sessions of a
        subject that have no row with nothing held, if other sessions have some. By default there are none.

    Raises
    ------
    TrainingError
        If the arrays do not fit together, or there are no rows.

    Examples
    --------
    >>> from thenar.compiler import GraspSet, Samples
    >>> samples = Samples.of(GraspSet.load("set.grasps"))
    >>> samples.inputs.shape == (len(samples.labels), samples.n_switches + samples.codes.shape[1])
    True
    """

    switches: NDArray[np.bool_]
    codes: NDArray[np.uint16]
    labels: NDArray[np.intp]
    grasps: tuple[str, ...]
    trials: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, np.intp))
    subjects: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, np.intp))
    taxels: NDArray[np.uint16] = field(default_factory=lambda: np.empty(0, np.uint16))
    movements: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, np.intp))
    has_none: bool = False
    silent: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))

    def __post_init__(self) -> None:
        n = len(self.labels)
        trials = self.trials if self.trials.size else np.arange(n)
        usual = {"trials": trials, "subjects": np.zeros(n, np.intp), "taxels": np.empty((n, 0), np.uint16)}
        for name, values in (usual | {"movements": trials, "silent": np.zeros(n, np.bool_)}).items():
            if not getattr(self, name).size:
                object.__setattr__(self, name, values)
        shapes = {"switches": "(n, s)", "codes": "(n, j)", "labels": "(n,)", "trials": "(n,)", "subjects": "(n,)"}
        shapes |= {"taxels": "(n, t)", "movements": "(n,)", "silent": "(n,)"}
        parts = {name: getattr(self, name) for name in shapes}
        rows = set(map(len, parts.values()))
        if len(rows) != 1 or any(parts[name].ndim != 1 + shape.count(" ") for name, shape in shapes.items()):
            sizes = ", ".join(f"{name} {part.shape}" for name, part in parts.items())
            raise TrainingError(f"{sizes} must be {', '.join(shapes.values())} of the same n rows")
        if not rows.pop():
            raise TrainingError("there are no rows to train on: take a set with rows")
        if self.labels.min() < 0 or self.labels.max() >= self.n_classes:
            raise TrainingError(f"labels must be class numbers 0 to {self.n_classes - 1}")
        check_types(self.n_classes, TrainingError)

    @classmethod
    def of(cls, grasp_set: GraspSet, inputs: Inputs = "both") -> "Samples":
        """Return all rows of a set, with the inputs that `inputs` selects, and the grasp types that occur."""
        classes, labels = np.unique(grasp_set.labels, return_inverse=True)
        names = grasp_set.taxonomy.names
        none, session = grasp_set.is_none, groups(grasp_set.subjects, grasp_set.sessions)
        return cls(
            switches=grasp_set.switches[:, : None if inputs != "joints" else 0],
            codes=grasp_set.codes[:, : None if inputs != "switches" else 0],
            labels=labels,
            grasps=tuple(names[label] for label in classes),
            trials=grasp_set.trial_ids,
            subjects=np.unique(grasp_set.subjects, return_inverse=True)[1],
            taxels=grasp_set.taxels[:, : None if inputs != "joints" else 0],
            movements=grasp_set.movement_ids,
            has_none=bool(none.any()),
            silent=none.any() & (np.bincount(session, none) == 0)[session],
        )

    @property
    def n_switches(self) -> int:
        """The number of switches to choose from."""
        return int(self.switches.shape[1])

    @property
    def n_classes(self) -> int:
        """The number of classes: the grasp types, and NONE if it is one."""
        return len(self.grasps)

    @property
    def n_types(self) -> int:
        """The number of grasp types, which is also the class number of rows in which nothing is held."""
        return self.n_classes - self.has_none

    @property
    def is_none(self) -> NDArray[np.bool_]:
        """Whether nothing is held in each row (n,)."""
        return np.asarray(self.labels == self.n_types)

    @property
    def given_held(self) -> NDArray[np.bool_] | None:
        """A mask (n,) of rows that are trained on given that something is held; None if there are none, as when no row
        at all shows nothing held.
        """
        return self.silent if self.is_none.any() and self.silent.any() else None

    def without_none(self) -> "Samples":
        """Return the rows in which something is held, and the grasp types alone."""
        if not self.has_none:
            return self
        return replace(self.rows(~self.is_none), grasps=self.grasps[:-1], has_none=False)

    def balanced(self, most_frames: int = FRAMES) -> NDArray[np.intp]:
        """Return the numbers of the rows to train on: no more with nothing held than with a grasp, and at most
        `most_frames` of a movement, evenly spaced. Frames of a movement resemble their neighbours.
        """
        none, grasps = np.flatnonzero(self.is_none), np.flatnonzero(~self.is_none)
        if len(none) > len(grasps):
            none = none[np.arange(len(grasps)) * len(none) // max(1, len(grasps))]
        rows = np.sort(np.concatenate([grasps, none]))
        if not self.has_none:
            return rows
        rows = rows[np.argsort(self.movements[rows], kind="stable")]
        _, starts, movement, counts = np.unique(
            self.movements[rows], return_index=True, return_inverse=True, return_counts=True
        )
        place, frames, most = (
            np.arange(len(rows)) - starts[movement],
            counts[movement],
            np.minimum(counts, most_frames)[movement],
        )
        return np.sort(rows[(place + 1) * most // frames > place * most // frames])

    def rows(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> "Samples":
        """Return some of the rows, by number or by mask (n,)."""
        return Samples(
            self.switches[chosen],
            self.codes[chosen],
            self.labels[chosen],
            self.grasps,
            self.trials[chosen],
            self.subjects[chosen],
            self.taxels[chosen],
            self.movements[chosen],
            self.has_none,
            self.silent[chosen],
        )

    def keeping(self, columns: Columns) -> "Samples":
        """Return the same rows with the switches `columns` alone, in their order, and all joints."""
        return replace(self, switches=self.switches[:, list(columns)])

    def with_joints(self, joints: Columns) -> "Samples":
        """Return the same rows with the joints `joints` alone, in their order."""
        return replace(self, codes=self.codes[:, list(joints)])

    def masked(self) -> "Samples":
        """Return these rows, and MASKED copies of each with one input lost, replaced by the value in another row.

        On average over other rows, an input adds its mean row, which is the runtime's substitute for a lost one. Each
        input is lost in equally many copies.
        """
        (n, s), j, parts = self.switches.shape, self.codes.shape[1], [self]
        for copy in range(MASKED if s + j else 0):
            random = np.random.default_rng([n, s, j, copy])
            lost, others = random.permutation(np.arange(n) % (s + j)), random.permutation(n)
            switches, codes, rows = self.switches.copy(), self.codes.copy(), np.arange(n)
            for values, places in ((switches, lost), (codes, lost - s)):
                inside = (places >= 0) & (places < values.shape[1])
                values[rows[inside], places[inside]] = values[others[inside], places[inside]]
            parts.append(replace(self, switches=switches, codes=codes))
        switches, codes = (np.concatenate([getattr(part, name) for part in parts]) for name in ("switches", "codes"))
        return replace(self.rows(np.arange(n * len(parts)) % n), switches=switches, codes=codes)

    @property
    def inputs(self) -> NDArray[np.uint16]:
        """The inputs as one matrix (n, s + j): the switches' bits, then the joints' codes. There must be no taxels."""
        if self.taxels.shape[1]:
            raise TrainingError("taxels are no inputs: turn them into bits by thresholds first")
        return np.hstack([self.switches, self.codes], dtype=np.uint16)

    @property
    def varies(self) -> bool:
        """Whether any input differs between the rows: a model of others only knows how frequent the classes are."""
        return bool((self.inputs != self.inputs[0]).any())

    @property
    def most_frequent(self) -> int:
        """The class of most rows, the lowest of several."""
        return int(np.bincount(self.labels).argmax())


def check_types(types: int, raises: type[ThenarError]) -> None:
    """Raise `raises` if there are more grasp types than a build can have."""
    if types > MAX_CLASSES:
        raise raises(f"{types} grasp types, a build has at most {MAX_CLASSES}: join types, or leave some out")


def decided(predicted: NDArray[np.intp], trial: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the label (r, T) of most frames of each trial; of equally many, the lowest.

    predicted  (r, n) labels        trial  (n,) numbers of trials, 0 to T - 1, each with a frame
    """
    labels, numbers = np.unique(predicted, return_inverse=True)
    numbers = numbers.reshape(predicted.shape)
    n_trials = int(trial.max()) + 1
    counts = [np.bincount(trial * len(labels) + row, minlength=n_trials * len(labels)) for row in numbers]
    return np.asarray(labels[np.reshape(counts, (len(numbers), n_trials, -1)).argmax(axis=2)])


def select_inputs(grasp_set: GraspSet, manifest: Manifest) -> tuple[NDArray[np.bool_], NDArray[np.uint16]]:
    """Return the kept switches (n, s) and the joints' codes (n, j) of `grasp_set` in the build's order.

    Raises CompileError naming the inputs that the recordings lack, or joints whose codes have another meaning there.
    """
    elements = {name: column for column, name in enumerate(grasp_set.element_names)}
    recorded_joints = {name: column for column, name in enumerate(grasp_set.joint_names)}
    sources = [*dict.fromkeys(switch.source for switch in manifest.switches)]
    missing = [name for name in sources if name not in elements]
    missing += [joint.name for joint in manifest.joints if joint.name not in recorded_joints]
    if missing:
        names = (*grasp_set.element_names, *grasp_set.joint_names)
        raise CompileError(
            f"the recordings lack {counted(len(missing), 'input')} of the build: {list_names(missing)}"
            f"{nearest(missing[0], names)}; import their table again, with [rename] in the columns.toml for a column "
            "that has another name"
        )
    switches = [elements[switch.source] for switch in manifest.switches]
    joints = [recorded_joints[joint.name] for joint in manifest.joints]
    for calibration, column in zip(manifest.joints, joints, strict=True):
        _check_calibration("joint", calibration, grasp_set.joints[column])
    bits = np.empty((len(grasp_set), len(switches)), np.bool_)
    for place, (switch, column) in enumerate(zip(manifest.switches, switches, strict=True)):
        bits[:, place] = _bits(grasp_set, switch, column)
    return bits, grasp_set.codes[:, joints]


def _bits(grasp_set: GraspSet, switch: Switch, column: int) -> NDArray[np.bool_]:
    """Return the values (n,) of a kept switch, or of a kept level of a taxel."""
    taxel = column - len(grasp_set.switch_names)
    if (taxel < 0) != (switch.threshold is None):
        here, built = ("a switch", "a taxel") if taxel < 0 else ("a taxel", "a switch")
        raise CompileError(
            f"{switch.source} is {here} here, but {built} in the build: import these recordings as the build's were"
        )
    if switch.threshold is None:
        return grasp_set.switches[:, column]
    _check_calibration("taxel", switch.threshold.taxel, grasp_set.taxel_columns[taxel])
    return grasp_set.taxels[:, taxel] > switch.threshold.code


def _check_calibration(kind: str, built: Calibration, recorded: Joint) -> None:
    values = np.array([built.value_a, built.value_b])
    meant = recorded.value([built.code_a, built.code_b])
    same = np.isclose(meant, values, rtol=0, atol=abs(recorded.step) * 1e-6)
    if recorded.unit != built.unit or not same.all():
        point = int(same.argmin())
        code = (built.code_a, built.code_b)[point]
        raise CompileError(
            f"{kind} {built.name} is coded differently here: code {code} is {meant[point]:g} {recorded.unit}, but "
            f"{values[point]:g} {built.unit} in the build; import these recordings with the build's grid and origin"
        )

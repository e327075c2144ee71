"""What is learnt from: the rows of a training set, as plain arrays."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError
from thenar.runtime.manifest import Inputs

from .limits import check_types
from .recordings.graspset import GraspSet
from .recordings.trials import groups

Columns = tuple[int, ...]

# Copies of each row with an input lost: 8 took twice the time of 4, for half a point less at the worst single loss.
MASKED = 4
# Of a movement that is learnt from: a frame every 30 to 50 ms of one that lasts a second or two.
FRAMES = 32


class SamplesError(ThenarError, ValueError):
    """Rows that nothing can be learnt from."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Rows of a training set, of one fold or of everything.

    Parameters
    ----------
    switches : ndarray of bool, shape (n, s)
        True where a switch is closed.
    codes : ndarray of uint16, shape (n, j)
        The joints' codes. With j = 0 the switches alone are to recognise the grasp.
    labels : ndarray of intp, shape (n,)
        Class numbers, that index `grasps`.
    grasps : tuple of str
        The grasp types, and last of all NONE with `has_none`. A fold keeps all of them, whether they occur in it or
        not.
    trials, subjects : ndarray of intp, shape (n,), optional
        The number of each row's trial and subject: what is chosen by inner folds must not part them. None given: each
        row is a trial of its own, of one subject.
    taxels : ndarray of uint16, shape (n, t), optional
        Codes of which a placement makes bits first, by thresholds that it learns: placement/elements.py.
    movements : ndarray of intp, shape (n,), optional
        The number of each row's movement, which no fold parts: a trial, and the rows of nothing held before and after
        it. None given: each trial is one.
    has_none : bool
        Whether the last class is that nothing is held.
    silent : ndarray of bool, shape (n,), optional
        Rows that say which type is held and not whether any is, as those of static grasps do: of a subject's session of
        which no row shows nothing held, where others have such rows. None given: there are none.

    Raises
    ------
    SamplesError
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
        if not self.trials.size:
            object.__setattr__(self, "trials", np.arange(len(self.labels)))
        if not self.subjects.size:
            object.__setattr__(self, "subjects", np.zeros(len(self.labels), np.intp))
        if not self.taxels.size:
            object.__setattr__(self, "taxels", np.empty((len(self.labels), 0), np.uint16))
        if not self.movements.size:
            object.__setattr__(self, "movements", self.trials)
        if not self.silent.size:
            object.__setattr__(self, "silent", np.zeros(len(self.labels), np.bool_))
        shapes = {"switches": "(n, s)", "codes": "(n, j)", "labels": "(n,)", "trials": "(n,)", "subjects": "(n,)"}
        shapes |= {"taxels": "(n, t)", "movements": "(n,)", "silent": "(n,)"}
        parts = {name: getattr(self, name) for name in shapes}
        rows = set(map(len, parts.values()))
        if len(rows) != 1 or any(parts[name].ndim != 1 + shape.count(" ") for name, shape in shapes.items()):
            found = ", ".join(f"{name} {part.shape}" for name, part in parts.items())
            raise SamplesError(f"{found} must be {', '.join(shapes.values())} of the same n rows")
        if not rows.pop():
            raise SamplesError("nothing can be learnt from a set without rows")
        if self.labels.min() < 0 or self.labels.max() >= self.n_classes:
            raise SamplesError(f"labels must be class numbers 0 to {self.n_classes - 1}")
        check_types(self.n_classes, SamplesError)

    @classmethod
    def of(cls, grasp_set: GraspSet, inputs: Inputs = "both") -> "Samples":
        """Return all rows of a set, with those of its inputs that `inputs` allows, and the grasp types that occur."""
        found, labels = np.unique(grasp_set.labels, return_inverse=True)
        none, session = grasp_set.is_none, groups(grasp_set.subjects, grasp_set.sessions)
        return cls(
            switches=grasp_set.switches[:, : None if inputs != "joints" else 0],
            codes=grasp_set.codes[:, : None if inputs != "switches" else 0],
            labels=labels,
            grasps=tuple(grasp_set.taxonomy.names[label] for label in found),
            trials=grasp_set.trial_ids,
            subjects=np.unique(grasp_set.subjects, return_inverse=True)[1],
            taxels=grasp_set.taxels[:, : None if inputs != "joints" else 0],
            movements=grasp_set.movement_ids,
            has_none=bool(none.any()),
            silent=none.any() & (np.bincount(session, none) == 0)[session],
        )

    @property
    def n_switches(self) -> int:
        """The number of switches there are to choose from."""
        return int(self.switches.shape[1])

    @property
    def n_classes(self) -> int:
        """The number of classes: grasp types, and NONE where it is one."""
        return len(self.grasps)

    @property
    def n_types(self) -> int:
        """The number of grasp types, and the class of rows in which nothing is held."""
        return self.n_classes - self.has_none

    @property
    def is_none(self) -> NDArray[np.bool_]:
        """Whether nothing is held in each row (n,)."""
        return np.asarray(self.labels == self.n_types)

    @property
    def given_held(self) -> NDArray[np.bool_] | None:
        """The rows (n,) that are learnt from as if it were known that something is held; None: no row is, as where no
        row at all shows nothing held.
        """
        return self.silent if self.is_none.any() and self.silent.any() else None

    def without_none(self) -> "Samples":
        """Return the rows in which something is held, and the grasp types alone."""
        if not self.has_none:
            return self
        return replace(self.rows(~self.is_none), grasps=self.grasps[:-1], has_none=False)

    def balanced(self) -> NDArray[np.intp]:
        """Return the numbers of rows of which no more show nothing than a grasp, and of a movement no more than FRAMES:
        of more, as many, evenly spaced. Frames of a movement resemble their neighbours.
        """
        none, held = np.flatnonzero(self.is_none), np.flatnonzero(~self.is_none)
        if len(none) > len(held):
            none = none[np.arange(len(held)) * len(none) // max(1, len(held))]
        rows = np.sort(np.concatenate([held, none]))
        if not self.has_none:
            return rows
        rows = rows[np.argsort(self.movements[rows], kind="stable")]
        _, starts, own, counts = np.unique(
            self.movements[rows], return_index=True, return_inverse=True, return_counts=True
        )
        place, frames, most = np.arange(len(rows)) - starts[own], counts[own], np.minimum(counts, FRAMES)[own]
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
        """Return these rows, and MASKED copies of each with one of the inputs lost: what another row has stands there.

        On average over other rows, an input adds its mean row, which is what stands in for a lost one. Each input is
        lost in as many copies.
        """
        (n, s), j, parts = self.switches.shape, self.codes.shape[1], [self]
        for copy in range(MASKED if s + j else 0):
            random = np.random.default_rng([n, s, j, copy])
            lost, others = random.permutation(np.arange(n) % (s + j)), random.permutation(n)
            switches, codes, rows = self.switches.copy(), self.codes.copy(), np.arange(n)
            for values, places in ((switches, lost), (codes, lost - s)):
                own = (places >= 0) & (places < values.shape[1])
                values[rows[own], places[own]] = values[others[own], places[own]]
            parts.append(replace(self, switches=switches, codes=codes))
        switches, codes = (np.concatenate([getattr(part, name) for part in parts]) for name in ("switches", "codes"))
        return replace(self.rows(np.arange(n * len(parts)) % n), switches=switches, codes=codes)

    @property
    def inputs(self) -> NDArray[np.uint16]:
        """The inputs as one matrix (n, s + j): the switches' bits, then the joints' codes. There may be no taxels."""
        if self.taxels.shape[1]:
            raise SamplesError("taxels are no inputs: make bits of them by thresholds first")
        return np.hstack([self.switches, self.codes], dtype=np.uint16)

    def kept(self, columns: Columns) -> NDArray[np.uint16]:
        """Return what is trained on, (n, kept + j): the switches `columns` in their order, then the joints' codes."""
        return self.keeping(columns).inputs


def decided(predicted: NDArray[np.intp], trial: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the label (r, T) that most frames of each trial are given, the lowest of several.

    predicted  (r, n) labels        trial  (n,) numbers of trials, 0 to T - 1, each with a frame
    """
    labels, given = np.unique(predicted, return_inverse=True)
    given = given.reshape(predicted.shape)
    n_trials = int(trial.max()) + 1
    counts = [np.bincount(trial * len(labels) + one, minlength=n_trials * len(labels)) for one in given]
    return np.asarray(labels[np.reshape(counts, (len(given), n_trials, -1)).argmax(axis=2)])

"""The rows that a frontier is computed from, and the folds in which it is."""

import hashlib
from dataclasses import dataclass
from functools import cached_property

import msgspec
import numpy as np
from numpy.typing import NDArray

from ..evaluation.folds import Fold, Rows, check_cut, leave_one_out, weka_folds
from ..limits import check_inputs, check_memory, check_types
from ..placement.ports import PortCosts
from ..recordings.graspset import GraspSet
from ..samples import Samples
from .points import FrontierError
from .settings import Search


@dataclass(frozen=True, eq=False)
class Material:
    """Rows: switches (n, s), codes (n, j), labels (n,) that index `grasps`, subjects (n,); what ports cost to read."""

    switches: NDArray[np.bool_]
    codes: NDArray[np.uint16]
    labels: NDArray[np.intp]
    subjects: NDArray[np.str_]
    switch_names: tuple[str, ...]
    grasps: tuple[str, ...]
    fingerprint: str
    ports: PortCosts | None

    @classmethod
    def of(cls, grasp_set: GraspSet, ports: PortCosts | None) -> "Material":
        """Return the rows of a set. Raises FrontierError if there is nothing to tell apart."""
        found, labels = np.unique(grasp_set.labels, return_inverse=True)
        if len(found) < 2:
            raise FrontierError(f"the recordings hold {len(found)} grasp type(s): there is nothing to tell apart")
        check_types(len(found), FrontierError)
        # All switches at once are tried as well.
        check_inputs(len(found), len(grasp_set.switch_names), len(grasp_set.joints), FrontierError)
        check_memory(len(grasp_set), len(found), FrontierError)
        grasps = tuple(grasp_set.taxonomy.types[label] for label in found)
        return cls(
            grasp_set.switches,
            grasp_set.codes,
            labels,
            grasp_set.subjects,
            grasp_set.switch_names,
            grasps,
            grasp_set.fingerprint(),
            ports,
        )

    @property
    def wired(self) -> str:
        """What identifies in a store what ports cost: a digest, "" where that is not known."""
        return "" if self.ports is None else hashlib.sha256(msgspec.json.encode(self.ports)).hexdigest()[:16]

    @property
    def n_subjects(self) -> int:
        """How many people recorded."""
        return len(np.unique(self.subjects))

    def learning(self, rows: Rows, joints: bool) -> Samples:
        """Return rows to choose a placement from, with the joints or without."""
        codes = self.codes[rows] if joints else self.codes[rows, :0]
        return Samples(self.switches[rows], codes, self.labels[rows], self.grasps)

    def inputs(self, columns: tuple[int, ...], joints: bool) -> NDArray[np.uint16]:
        """Return what is trained on, (n, kept + j): the kept switches in their order, then the joints' codes."""
        kept = self.switches[:, list(columns)].astype(np.uint16)
        return np.hstack([kept, self.codes]) if joints else kept


@dataclass(frozen=True, eq=False)
class Cuts:
    """All ways in which rows are parted: repeats of stratified folds, and each subject against the others."""

    repeats: tuple[tuple[Fold, ...], ...]
    subjects: tuple[Fold, ...]
    everything: Fold

    @classmethod
    def of(cls, material: Material, search: Search) -> "Cuts":
        """Return them. Raises EvaluationError if there are too few rows."""
        check_cut(len(material.labels), search.folds, "rows")
        repeats = tuple(
            tuple(weka_folds(material.labels, search.folds, search.seed + repeat)) for repeat in range(search.repeats)
        )
        several = material.n_subjects > 1
        rows = np.arange(len(material.labels))
        return cls(
            repeats=repeats,
            subjects=tuple(leave_one_out(material.subjects, "subject")) if several else (),
            everything=Fold(rows, rows[:0], "all"),
        )

    @property
    def screening(self) -> tuple[Fold, ...]:
        """The folds of the first repeat."""
        return self.repeats[0]

    @property
    def all(self) -> tuple[Fold, ...]:
        """Every fold that is tested."""
        return (*(fold for folds in self.repeats for fold in folds), *self.subjects)

    @cached_property
    def names(self) -> dict[Fold, str]:
        """What identifies a fold in a store: a digest of which rows train and which test."""
        return {fold: _digest(fold) for fold in (*self.all, self.everything)}


def _digest(fold: Fold) -> str:
    rows = (np.asarray(part, dtype="<i8").tobytes() for part in (fold.train, fold.test))
    return hashlib.sha256(b"|".join(rows)).hexdigest()[:16]

"""What `compile` trains: a placement by ID3, then an ensemble on the kept switches and the joints."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...runtime.manifest import Options
from ..boosting.boost import boost
from ..boosting.stumps import Stumps
from ..placement.id3 import grow_id3
from ..recordings.graspset import GraspSet
from .errors import CompileError

Report = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """Rows to train on: switches (n, s), codes (n, j), labels (n,) that index `grasps`, the types that occur."""

    switches: NDArray[np.bool_]
    codes: NDArray[np.uint16]
    labels: NDArray[np.intp]
    grasps: tuple[str, ...]

    def rows(self, index: NDArray[np.intp]) -> "Material":
        """Return the material of some rows; the grasp types stay all."""
        return Material(self.switches[index], self.codes[index], self.labels[index], self.grasps)


@dataclass(frozen=True, slots=True, eq=False)
class Trained:
    """The kept switches in the order in which they were chosen, what each brought (bits), and at how many decisions of
    their tree none gained anything alone; the ensemble, and whether the tolerance ended its training.
    """

    columns: tuple[int, ...]
    gains: tuple[float, ...]
    zero_gain_nodes: int
    stumps: Stumps
    stopped_early: bool

    def kept(self, material: Material) -> NDArray[np.bool_]:
        """Return the kept switches (n, kept) of `material`."""
        return material.switches[:, list(self.columns)]


def material_of(grasp_set: GraspSet, options: Options) -> Material:
    """Return what of `grasp_set` the option `inputs` allows. Raises CompileError if that is nothing to learn from."""
    wanted = options.inputs
    for kind, names in (("switches", grasp_set.switch_names), ("joints", grasp_set.joint_names)):
        if wanted == kind and not names:
            raise CompileError(f"the recordings have no {kind}: choose other inputs than {kind!r}")
    found, labels = np.unique(grasp_set.labels, return_inverse=True)
    if len(found) < 2:
        raise CompileError(f"the recordings hold {len(found)} grasp type(s): there is nothing to tell apart")
    return Material(
        switches=grasp_set.switches[:, : None if wanted != "joints" else 0],
        codes=grasp_set.codes[:, : None if wanted != "switches" else 0],
        labels=labels,
        grasps=tuple(grasp_set.taxonomy.types[label] for label in found),
    )


def train(material: Material, options: Options, report: Report | None = None) -> Trained:
    """Choose the switches and boost on them and the joints. Raises CompileError if no input tells grasps apart."""
    tree = grow_id3(material.switches, material.labels, min_samples=options.prune)
    columns = tree.inputs
    if not columns and not material.codes.shape[1]:
        raise CompileError("no switch is worth keeping: lower --prune, or record switches that differ between grasps")
    X = np.hstack([material.switches[:, list(columns)], material.codes])
    stumps, history = boost(
        X,
        material.labels,
        len(material.grasps),
        rounds=options.rounds,
        shrinkage=options.shrinkage,
        tolerance=options.tolerance,
        max_bins=options.max_bins,
        on_round=report,
    )
    if not stumps.n_rounds:
        raise CompileError("no input differs between rows: there is nothing to tell grasp types apart by")
    return Trained(columns, tree.gains, tree.n_zero_gain, stumps, history.stopped_early)

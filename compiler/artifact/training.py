"""What `compile` trains: a placement, then an ensemble on the kept switches and the joints."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.manifest import Options

from ..boosting.boost import boost
from ..boosting.stumps import Stumps
from ..limits import check_inputs, check_memory, check_types
from ..placement.methods.base import METHODS, PAPERS
from ..placement.placement import choose
from ..placement.ports import PortCosts
from ..placement.tree import Tree
from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples
from .ensemble import MAX_STUMPS
from .errors import CompileError

Report = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, eq=False)
class Trained:
    """The kept switches in the order in which they were chosen, and what each brought (bits): to the tree of ID3, which
    is None where another method chose, and alone otherwise; the ensemble, and whether the tolerance ended its training.
    """

    columns: Columns
    gains: tuple[float, ...]
    tree: Tree | None
    stumps: Stumps
    stopped_early: bool

    @property
    def zero_gain_nodes(self) -> int:
        """At how many decisions of the tree no switch gained anything alone."""
        return 0 if self.tree is None else self.tree.n_zero_gain

    def kept(self, samples: Samples) -> NDArray[np.bool_]:
        """Return the kept switches (n, kept) of `samples`."""
        return samples.switches[:, list(self.columns)]


def material_of(grasp_set: GraspSet, options: Options) -> Samples:
    """Return what of `grasp_set` the option `inputs` allows. Raises CompileError if that is nothing to learn from."""
    wanted = options.inputs
    for kind, names in (("switches", grasp_set.switch_names), ("joints", grasp_set.joint_names)):
        if wanted == kind and not names:
            raise CompileError(f"the recordings have no {kind}: choose other inputs than {kind!r}")
    if (found := len(np.unique(grasp_set.labels))) < 2:
        raise CompileError(f"the recordings hold {found} grasp type(s): there is nothing to tell apart")
    samples = Samples.of(grasp_set, wanted)
    _check_size(found, min(options.keep or 0, samples.n_switches), samples.codes, options.rounds)
    return samples


def _check_size(types: int, kept: int, codes: NDArray[np.uint16], rounds: int) -> None:
    check_types(types, CompileError)
    check_inputs(types, kept, codes.shape[1], CompileError)
    check_memory(len(codes), types, CompileError)
    if rounds * types > MAX_STUMPS:
        raise CompileError(
            f"{rounds} rounds of {types} grasp types are {rounds * types} stumps, a build has at most {MAX_STUMPS}: "
            "boost for fewer rounds"
        )


def train(samples: Samples, options: Options, report: Report | None = None, ports: PortCosts | None = None) -> Trained:
    """Choose the switches and boost on them and the joints. Raises CompileError if no input tells grasps apart.

    ports  what reading switches costs, for methods that ask
    """
    # Without switches the tree is a leaf.
    method = options.placement if samples.n_switches else PAPERS
    parameter = options.keep or 0 if METHODS.named(method).by_number else options.prune
    chosen = choose(samples, method, float(parameter), ports)
    columns = chosen.columns
    if not columns and not samples.codes.shape[1]:
        raise CompileError("no switch is worth keeping: lower --prune, or record switches that differ between grasps")
    check_inputs(len(samples.grasps), len(columns), samples.codes.shape[1], CompileError)
    X = np.hstack([samples.switches[:, list(columns)], samples.codes])
    stumps, history = boost(
        X,
        samples.labels,
        len(samples.grasps),
        rounds=options.rounds,
        shrinkage=options.shrinkage,
        tolerance=options.tolerance,
        max_bins=options.max_bins,
        on_round=report,
    )
    if not stumps.n_rounds:
        raise CompileError("no input differs between rows: there is nothing to tell grasp types apart by")
    return Trained(columns, chosen.gains, chosen.tree, stumps, history.stopped_early)


def check_placement(options: Options) -> None:
    """Raise MemberError unless `options` name a method that there is, CompileError unless with its own parameter."""
    by_number = METHODS.named(options.placement).by_number
    if by_number and options.keep is None:
        raise CompileError(f"placement {options.placement!r} needs --keep: how many switches")
    if by_number and options.prune:
        raise CompileError(f"placement {options.placement!r} knows no --prune: say with --keep how many switches")
    if not by_number and options.keep is not None:
        raise CompileError(f"placement {options.placement!r} is pruned by --prune: it cannot --keep a given number")

"""The placement: which switches of a set of grasps a method keeps, in its order, and with which result."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import accumulate
from math import inf
from typing import Any

import msgspec
import numpy as np
from msgspec.structs import replace

from ..elementary import LN_2
from ..limits import check_types
from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples
from ..sensors import SensorCount
from .constraints import Bound, Limits
from .cooccurrence import Cooccurrence
from .elements import Elements, bits_of, elements_of, names_of, ports_of
from .gain import entropy_bits
from .id3 import grow_id3
from .inputs import PlacementError
from .joints import kept_joints
from .methods.base import METHODS, PAPERS, Method
from .ports import PortCosts
from .robust import most_robust
from .tree import Tree

Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class Chosen:
    """The columns that a method keeps, in its order, and their gains in bits: in the tree of the paper's ID3, or each
    column's alone for another method, which has no tree.
    """

    columns: Columns
    gains: tuple[float, ...]
    tree: Tree | None


def choose(
    samples: Samples,
    method: str = PAPERS,
    parameter: float = 0.0,
    ports: PortCosts | None = None,
    limits: Bound | None = None,
    *,
    robust: bool = False,
) -> Chosen:
    """Choose switches of `samples` by a method of `METHODS`, whose parameter is S or a number of switches.

    `ports` are the costs for methods that use them, `limits` hold for all methods; `robust` looks for the placement
    that loses least with its worst lost switch. Raises MemberError for an unknown method, PlacementError if it cannot
    choose.
    """
    tree, columns = None, Columns()
    if method == PAPERS:
        rows = samples if limits is None else limits.without(samples)
        tree = grow_id3(rows.switches, rows.labels, min_samples=int(parameter))
        columns = tree.inputs
    if robust or limits is not None or tree is None:
        pick = partial(_picked, method=METHODS.named(method), parameter=parameter, ports=ports, limits=limits)
        columns = most_robust(samples, pick) if robust else pick(samples)
    if tree is not None and tree.inputs == columns:
        return Chosen(columns, tree.gains, tree)
    return Chosen(columns, information_alone(samples, columns), None)


def _picked(
    samples: Samples, method: Method, parameter: float, ports: PortCosts | None, limits: Bound | None
) -> Columns:
    if limits is None:
        return method.chooser(samples, ports)(parameter)
    most = max(int(parameter), 0) if method.by_number else inf
    if method.nested:
        return limits.obeyed(method.chooser(limits.without(samples), ports)(samples.n_switches), most)
    refused: list[int] = []
    while True:
        order = method.chooser(limits.without(samples, refused), ports)(parameter)
        kept = limits.obeyed(order, most)
        if len(kept) == most or set(order) <= set(kept):
            return kept
        refused += set(order) - set(kept)


def information_alone(samples: Samples, columns: Columns) -> tuple[float, ...]:
    """Return the information (bits) about the grasp type in each of the switches `columns` alone."""
    counts = Cooccurrence(samples.switches, samples.labels, samples.n_classes)
    alone = counts.information() / (len(samples.labels) * LN_2)
    return tuple(float(alone[column]) for column in columns)


class Kept(msgspec.Struct, frozen=True, omit_defaults=True):
    """A kept element: its number in the set, where switches come first, and its name; for ID3 also its gain in bits,
    and the cumulative share of the grasp types' entropy; for a level, the taxel's code above which it is set.
    """

    number: int
    name: str
    gain_bits: float | None = None
    cumulative_share: float | None = None
    above: int | None = None


@dataclass(frozen=True, slots=True)
class Placement:
    """The kept switches of a set, and how they were found.

    parameter  S, or how many switches to keep at most; joints: whether the method used the joints
    kept_joints  the names of the kept joints, if some were to be chosen
    n_switches, n_taxels, n_joints  the numbers of those in the set
    all_names  the names of all elements: switches, and levels of taxels; grasps: the types that occur, which the
               tree's classes index
    tree       of the paper's ID3
    """

    method: str
    parameter: float
    joints: bool
    switches: tuple[Kept, ...]
    rows: int
    fingerprint: str
    all_names: tuple[str, ...]
    grasps: tuple[str, ...]
    tree: Tree | None = None
    kept_joints: tuple[str, ...] = ()
    n_switches: int = 0
    n_taxels: int = 0
    n_joints: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the kept elements."""
        return tuple(kept.name for kept in self.switches)

    @property
    def sensors(self) -> SensorCount:
        """The kept sensors, of all in the set."""
        pads = [kept.number for kept in self.switches if kept.above is not None]
        return SensorCount(
            switches=(len(self.switches) - len(pads), self.n_switches),
            pads=(len(set(pads)), self.n_taxels),
            joints=(len(self.kept_joints), self.n_joints) if self.kept_joints else (0, 0),
            levels=len(pads),
        )

    @property
    def how(self) -> str:
        """How the method chooses, in a sentence."""
        return METHODS.named(self.method).help

    @property
    def gain_bits(self) -> float:
        """The total gain of all switches in the tree."""
        return sum(kept.gain_bits or 0.0 for kept in self.switches)

    @property
    def entropy_bits(self) -> float:
        """The entropy of the tree's grasp types."""
        return 0.0 if self.tree is None else entropy_bits(list(self.tree.nodes[0].counts))

    def document(self) -> dict[str, Any]:
        """Return the JSON document of `thenar place`.

        zero_gain_nodes are decisions at which no switch gains anything alone: the lowest-numbered that varies is used;
        undecided_leaves are those of several grasp types whose rows agree in every switch.
        """
        found = {
            "method": self.method,
            "what": self.how,
            "parameter": self.parameter,
            "joints": self.joints,
            "switches": self.switches,
            "n_elements": len(self.all_names),
            "sensors": self.sensors,
            "rows": self.rows,
            "fingerprint": self.fingerprint,
        }
        if self.kept_joints:
            found["kept_joints"] = self.kept_joints
        if self.tree is not None:
            found |= {
                "kept_share": len(self.switches) / len(self.all_names),
                "entropy_bits": self.entropy_bits,
                "zero_gain_nodes": self.tree.n_zero_gain,
                "undecided_leaves": self.tree.n_undecided,
                "decision_nodes": len(self.tree.nodes) - self.tree.n_leaves,
                "leaves": self.tree.n_leaves,
                "depth": self.tree.depth,
                "prune": self.tree.min_samples,
            }
        return found


def place(
    grasp_set: GraspSet,
    parameter: float = 0.0,
    *,
    method: str = PAPERS,
    joints: bool = False,
    ports: PortCosts | None = None,
    levels: int | None = None,
    keep_joints: int | None = None,
    limits: Limits | None = None,
    robust: bool = False,
) -> Placement:
    """Choose elements of all rows of a set: switches, and levels of taxels.

    Parameters
    ----------
    grasp_set : GraspSet
        The training rows; rows in which nothing is held are left out. A tie between grasp types goes to the first of
        them in the taxonomy.
    parameter : float
        The paper's S (rows below which a node decides nothing), or how many switches to keep at most, as the method
        takes it.
    method : str
        A name in `METHODS`.
    joints : bool
        Choose the switches that help most in addition to the joints. Only elimination uses the joints.
    ports : PortCosts or None
        Costs of reading each switch and taxel, for methods that use them; None: all cost the same.
    levels : int, optional
        How many levels of a taxel there are to choose from, at most.
    keep_joints : int, optional
        How many joints to keep, in addition to the kept switches; None: joints are not chosen.
    limits : Limits, optional
        Constraints on the placement.
    robust : bool
        Choose the placement that loses least with its worst lost switch.

    Raises
    ------
    MemberError
        If there is no such method.
    PlacementError
        If the set has no switches, no rows, or more grasp types than a build can hold.
    """
    fingerprint, grasp_set = grasp_set.fingerprint(), grasp_set.without_none()
    read = _samples_of(grasp_set, joints=joints or keep_joints is not None)
    elements = elements_of(read, levels)
    read = bits_of(read, elements)
    samples = read if joints else read.with_joints(())
    own = None if ports is None else ports_of(ports, elements)
    bound = None if limits is None else limits.on(elements, own)
    chosen = choose(samples, method, parameter, own, bound, robust=robust)
    name = partial(_kept_of, grasp_set, elements)
    return Placement(
        method=method,
        parameter=parameter,
        joints=joints,
        switches=_with_gains(name(chosen.columns), chosen),
        rows=len(grasp_set),
        fingerprint=fingerprint,
        all_names=names_of(grasp_set, elements),
        n_switches=len(grasp_set.switch_names),
        n_taxels=len(grasp_set.taxel_columns),
        n_joints=len(grasp_set.joints),
        grasps=samples.grasps,
        tree=chosen.tree,
        kept_joints=() if keep_joints is None else _joints_kept(grasp_set, read, chosen.columns, keep_joints, limits),
    )


def _with_gains(kept: tuple[Kept, ...], chosen: Chosen) -> tuple[Kept, ...]:
    """Return the kept elements with their gains in the tree, if there is one."""
    if chosen.tree is None:
        return kept
    entropy = entropy_bits(list(chosen.tree.nodes[0].counts))
    together = accumulate(chosen.gains)
    return tuple(
        replace(one, gain_bits=gain, cumulative_share=so_far / entropy)
        for one, gain, so_far in zip(kept, chosen.gains, together, strict=True)
    )


def place_by_subject(grasp_set: GraspSet, prune: int, on_done: Progress) -> list[tuple[str, Placement]]:
    """Return the paper's placement from the rows of each subject, by name, and from all rows, "pooled", if there are
    several subjects; `on_done(done, all)` is called before each of them.
    """
    grasp_set = grasp_set.without_none()
    subjects = np.unique(grasp_set.subjects).tolist()
    groups = [(subject, grasp_set.rows(grasp_set.subjects == subject)) for subject in subjects]
    if len(subjects) != 1:
        groups.append(("pooled", grasp_set))
    found = []
    for done, (title, rows) in enumerate(groups):
        on_done(done, len(groups))
        found.append((title, place(rows, prune)))
    return found


def _samples_of(grasp_set: GraspSet, *, joints: bool) -> Samples:
    """Return the rows of a set to choose switches from, with the joints' codes or without."""
    if not grasp_set.element_names:
        raise PlacementError("the set has no switches to place: it holds joints only")
    if not len(grasp_set):
        raise PlacementError("there are no rows: a placement needs at least one labelled grasp")
    check_types(len(np.unique(grasp_set.labels)), PlacementError)
    return Samples.of(grasp_set, "both" if joints else "switches")


def _kept_of(grasp_set: GraspSet, elements: Elements, columns: Columns) -> tuple[Kept, ...]:
    """Return the elements at `columns`, with their names."""
    kept, n_switches = tuple(elements[column] for column in columns), len(grasp_set.switch_names)
    return tuple(
        Kept(one.column, name, above=None if one.column < n_switches else one.code)
        for one, name in zip(kept, names_of(grasp_set, kept), strict=True)
    )


def _joints_kept(
    grasp_set: GraspSet, samples: Samples, columns: Columns, most: int, limits: Limits | None
) -> tuple[str, ...]:
    """Return the names of the joints to keep in addition to the switches `columns`."""
    if not grasp_set.joints:
        raise PlacementError("the set has no joints to choose from: leave ``keep_joints`` out")
    return tuple(grasp_set.joint_names[joint] for joint in kept_joints(samples.keeping(columns), most, limits))

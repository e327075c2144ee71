"""The placement: which switches of a set of grasps a method keeps, in its order, and with which result."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import accumulate
from math import inf
from typing import Any, Self

import msgspec
import numpy as np
from msgspec import structs

from thenar.runtime.model.quantise import quantise
from thenar.runtime.recipe import Recipe, changed

from ..elementary import LN_2
from ..facts import SensorCount
from ..model.faults import count_faults
from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples, TrainingError, check_types
from ..trainers.logit import fit_logit
from .constraints import Bound, Limits
from .elements import Elements, bits_of, elements_of, names_of, ports_of
from .gain import Cooccurrence, entropy_bits
from .methods.base import METHODS, PAPERS, Method, by_sensors, check_placement
from .methods.elimination import joint_order
from .ports import PortCosts
from .sensors import SENSORS, SENSORS_HELP, select_sensors
from .tree import Tree, grow_id3

Progress = Callable[[int, int], None]

# Shares of the switches that are lost in each training row; the accuracy that a placement may cost without a fault.
SHARES = (0.05, 0.1, 0.2)
MOST_LOSS = 0.01
_PENALTY = 1.0


@dataclass(frozen=True, slots=True)
class InputSelection:
    """The elements and joints that a recipe keeps.

    elements  those that there were to choose from: switches, and levels of taxels
    columns   the kept ones among them, in the method's order
    joints    the columns of the kept joints
    gains     of `columns`, and tree: see `choose`
    """

    elements: Elements
    columns: Columns
    joints: Columns
    gains: tuple[float, ...] = ()
    tree: Tree | None = None

    @classmethod
    def of(cls, kept: Elements, joints: Columns) -> Self:
        """Return the selection of these elements and joints, of which all are kept."""
        return cls(kept, tuple(range(len(kept))), joints)

    @property
    def kept(self) -> Elements:
        """The kept elements, in the method's order."""
        return tuple(self.elements[column] for column in self.columns)

    def read(self, samples: Samples) -> Samples:
        """Return these samples as a glove with only the kept elements and joints reads them."""
        return bits_of(samples.with_joints(self.joints), self.kept)


def select(
    samples: Samples, recipe: Recipe, ports: PortCosts | None = None, limits: Limits | None = None
) -> InputSelection:
    """Choose elements and joints of `samples`, rows in which something is held, as a recipe says.

    Parameters
    ----------
    samples : Samples
        The rows to choose from. A method that uses joints uses those that they have.
    recipe : Recipe
        The method, and how many elements, levels and joints to keep.
    ports : PortCosts, optional
        The costs of reading switches and taxels, for methods that use them; None: all cost the same.
    limits : Limits, optional
        Constraints on the placement.

    Raises
    ------
    SettingError
        If there is no such method.
    TrainingError
        If it cannot choose.
    """
    if by_sensors(recipe):
        elements, columns, joints = select_sensors(samples, recipe, limits)
        return InputSelection(elements, columns, joints, information_alone(bits_of(samples, elements), columns))
    elements = elements_of(samples, recipe.levels)
    bits = bits_of(samples, elements)
    # Without switches the tree is a single leaf.
    method = METHODS.named(recipe.placement if bits.n_switches else PAPERS)
    parameter = float(recipe.keep or 0 if method.by_number else recipe.prune)
    costs = None if ports is None else ports_of(ports, elements)
    bound = None if limits is None else limits.on(elements, costs)
    columns, gains, tree = choose(bits, method.name, parameter, costs, bound, robust=recipe.robust)
    joints = kept_joints(bits.keeping(columns), recipe.keep_joints, limits)
    return InputSelection(elements, columns, joints, gains, tree)


def choose(
    samples: Samples,
    method: str = PAPERS,
    parameter: float = 0.0,
    ports: PortCosts | None = None,
    limits: Bound | None = None,
    *,
    robust: bool = False,
) -> tuple[Columns, tuple[float, ...], Tree | None]:
    """Choose switches of `samples` by a method of `METHODS`, whose parameter is S or a number of switches.

    Return their columns in the method's order, and their gains in bits: in the tree of the paper's ID3, which is
    returned too, or each column's alone for another method.
    `ports` are the costs for methods that use them, `limits` hold for all methods; `robust` looks for the placement
    that loses least with its worst lost switch. Raises SettingError for an unknown method, TrainingError if it cannot
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
        return columns, tree.gains, tree
    return columns, information_alone(samples, columns), None


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


def spread(samples: Samples, share: float) -> Samples:
    """Return the rows with this share of the switches lost in each, replaced by another row's values."""
    n, switches = len(samples.labels), samples.switches.copy()
    random = np.random.default_rng([n, round(1000 * share)])
    for column in switches.T:
        lost, others = random.random(n) < share, random.permutation(n)
        column[lost] = column[others[lost]]
    return replace(samples, switches=switches)


def most_robust(samples: Samples, pick: Callable[[Samples], Columns]) -> Columns:
    """Return the placement whose worst single lost switch costs least: that of `pick` on these rows, or on rows in
    which some switches are lost, from which a method also keeps switches that can stand in for them.

    The best share of lost switches depends on the rows and on how many switches are kept. So several are tried, and
    evaluated by cross-validation on halves of the trials. Of the placements about as accurate as the best, the one with
    the highest accuracy under its worst lost switch is taken.
    """
    plain = pick(samples)
    tried = [plain, *(pick(spread(samples, share))[: len(plain)] for share in SHARES)]
    tried = list(dict.fromkeys(tried))
    if len(tried) == 1 or len(np.unique(samples.trials)) < 2:
        return plain
    counted = [_left(samples, columns) for columns in tried]
    enough = max(correct for correct, _ in counted) - MOST_LOSS * len(np.unique(samples.trials))
    return tried[max(range(len(tried)), key=lambda one: (counted[one][0] >= enough, counted[one][1], -one))]


def _left(samples: Samples, columns: Sequence[int]) -> tuple[int, int]:
    """Return how many trials the switches `columns`, and the joints, predict rightly in held-out halves; and how many
    with the worst switch lost.
    """
    _, first, trial = np.unique(samples.trials, return_index=True, return_inverse=True)
    # Every other trial of each class.
    half = np.empty(len(first), np.intp)
    half[np.argsort(samples.labels[first], kind="stable")] = np.arange(len(first)) % 2
    half = half[trial]
    kept, correct, lost = samples.keeping(tuple(columns)), 0, np.zeros(len(columns), np.int64)
    for tested in (0, 1):
        learnt, test = kept.rows(half != tested), kept.rows(half == tested)
        rows = learnt.masked()
        tables = fit_logit(rows.inputs, rows.labels, rows.n_classes, penalty=_PENALTY).score_tables(kept.n_switches)
        integers = quantise(tables, learnt.switches, learnt.codes)
        found = count_faults(integers, test.switches, test.codes, test.labels, test.trials)
        correct += found.correct
        lost += found.lost[: len(columns)]
    return correct, int(lost.min(initial=correct))


def information_alone(samples: Samples, columns: Columns) -> tuple[float, ...]:
    """Return the information (bits) about the grasp type in each of the switches `columns` alone."""
    counts = Cooccurrence(samples.switches, samples.labels, samples.n_classes)
    alone = counts.information() / (len(samples.labels) * LN_2)
    return tuple(float(alone[column]) for column in columns)


def kept_joints(samples: Samples, most: int | None, limits: Limits | None = None) -> Columns:
    """Return at most `most` joints to keep, ascending, given the switches of these rows; None: all that `limits` allow.

    Raises TrainingError if the limits require more joints.
    """
    every: Columns = tuple(range(samples.codes.shape[1]))
    if not every:
        return ()
    keep, never, most = ((), (), most or len(every)) if limits is None else limits.on_joints(most)
    every = tuple(joint for joint in every if joint not in never)
    if most >= len(every) or not most:
        return every[:most]
    order = dict.fromkeys((*keep, *joint_order(samples)))
    return tuple(sorted([joint for joint in order if joint not in never][:most]))


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
        return SENSORS_HELP if self.method == SENSORS else METHODS.named(self.method).help

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
    recipe: Recipe | None = None,
    *,
    ports: PortCosts | None = None,
    limits: Limits | None = None,
    **changes: Any,
) -> Placement:
    """Choose elements of all rows of a set, switches and levels of taxels, as `compile_build` does.

    Parameters
    ----------
    grasp_set : GraspSet
        The training rows; rows in which nothing is held are left out. A tie between grasp types goes to the first of
        them in the taxonomy.
    recipe : Recipe, optional
        The method, and how many elements, levels and joints to keep.
    ports : PortCosts, optional
        Costs of reading each switch and taxel, for methods that use them; None: all cost the same.
    limits : Limits, optional
        Constraints on the placement.
    **changes
        Single choices, such as `prune=13`, which override those of `recipe`.

    Returns
    -------
    Placement
        The kept elements, in the method's order.

    Raises
    ------
    SettingError
        If there is no such method.
    TrainingError
        If the set has no switches, no rows, or more grasp types than a build can hold, or if the method lacks the
        number that it takes.

    Examples
    --------
    >>> from thenar.compiler import GraspSet, place
    >>> len(place(GraspSet.load("set.grasps"), placement="elimination", keep=4).switches)
    4
    """
    recipe = changed(recipe or Recipe(), changes)
    check_placement(recipe)
    method, sensors = METHODS.named(recipe.placement), by_sensors(recipe)
    fingerprint, grasp_set = grasp_set.fingerprint(), grasp_set.without_none()
    samples = _samples_of(grasp_set, recipe)
    selection = select(samples, recipe, ports, limits)
    return Placement(
        method=SENSORS if sensors else method.name,
        parameter=float(
            recipe.sensors or recipe.price or recipe.keep or 0 if sensors or method.by_number else recipe.prune
        ),
        joints=not sensors and method.uses_joints and samples.codes.shape[1] > 0,
        switches=_kept_of(grasp_set, selection),
        rows=len(grasp_set),
        fingerprint=fingerprint,
        all_names=names_of(grasp_set, selection.elements),
        n_switches=len(grasp_set.switch_names),
        n_taxels=len(grasp_set.taxel_columns),
        n_joints=len(grasp_set.joints),
        grasps=samples.grasps,
        tree=selection.tree,
        kept_joints=()
        if recipe.keep_joints is None and not sensors
        else tuple(grasp_set.joint_names[joint] for joint in selection.joints),
    )


def _samples_of(grasp_set: GraspSet, recipe: Recipe) -> Samples:
    """Return the rows of a set to choose from, with the recipe's inputs."""
    if not by_sensors(recipe) and (not grasp_set.element_names or recipe.inputs == "joints"):
        why = "``inputs`` are the joints" if grasp_set.element_names else "the set holds joints only"
        raise TrainingError(f"there are no switches to place: {why}")
    if not len(grasp_set):
        raise TrainingError("there are no rows: a placement needs at least one labelled grasp")
    if recipe.keep_joints is not None and (not grasp_set.joints or recipe.inputs == "switches"):
        raise TrainingError("there are no joints to choose from: leave ``keep_joints`` out")
    check_types(len(np.unique(grasp_set.labels)), TrainingError)
    return Samples.of(grasp_set, recipe.inputs)


def _kept_of(grasp_set: GraspSet, selection: InputSelection) -> tuple[Kept, ...]:
    """Return the kept elements with their names, and with their gains in the tree, if there is one."""
    n_switches, kept = len(grasp_set.switch_names), selection.kept
    found = [
        Kept(one.column, name, above=None if one.column < n_switches else one.code)
        for one, name in zip(kept, names_of(grasp_set, kept), strict=True)
    ]
    if selection.tree is None:
        return tuple(found)
    entropy, together = entropy_bits(list(selection.tree.nodes[0].counts)), accumulate(selection.gains)
    return tuple(
        structs.replace(one, gain_bits=gain, cumulative_share=so_far / entropy)
        for one, gain, so_far in zip(found, selection.gains, together, strict=True)
    )

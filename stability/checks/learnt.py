"""All that is learnt from a set: ID3's tree, the ensemble and its losses, score tables, integer tables."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import Stumps
from thenar.compiler.placement.id3 import grow_id3
from thenar.compiler.placement.tree import Tree
from thenar.compiler.tables.collapse import ScoreTables, collapse
from thenar.compiler.tables.quantise import quantise
from thenar.runtime.tables import IntegerTables

from ..inputs.hard_data import HardSet

ROUNDS = 30


@dataclass(frozen=True, slots=True, eq=False)
class Learnt:
    """What `learn` returns."""

    tree: Tree
    stumps: Stumps
    losses: tuple[float, ...]
    tables: ScoreTables
    integers: IntegerTables


def learn(hard: HardSet, rounds: int = ROUNDS) -> Learnt:
    """Learn from `hard` all that there is to learn. ID3 knows no weights."""
    stumps, falling = boost(hard.X, hard.labels, hard.n_classes, rounds=rounds, weights=hard.weights)
    tables = collapse(stumps, hard.n_switches)
    integers = quantise(tables, hard.bits, hard.codes)
    return Learnt(grow_id3(hard.X, hard.labels), stumps, falling, tables, integers)


def numbers(learnt: Learnt, inputs: Sequence[int], classes: Sequence[int]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield name and array of everything learnt but thresholds, of `inputs` and `classes` as if they were numbered so.

    A stump or node of any other input has number -1.
    """
    place = {column: number for number, column in enumerate(inputs)}
    tables, integers, order = learnt.tables, learnt.integers, list(classes)
    n_switches = len(tables.switch_rows)
    switches = [column for column in inputs if column < n_switches]
    joints = [column - n_switches for column in inputs if column >= n_switches]
    columns = np.vectorize(lambda column: place.get(column, -1), otypes=[np.intp])(learnt.stumps.columns)
    yield "columns", columns[:, order]
    yield "answers", learnt.stumps.values[:, order]
    yield "losses", np.array(learnt.losses)
    yield "tree", np.array([place.get(-1 if node.input is None else node.input, -1) for node in learnt.tree.nodes])
    yield "counts", _counts(learnt.tree, order)
    yield "bias", tables.bias[order]
    yield "switch rows", tables.switch_rows[switches][:, order]
    yield "joint rows", _stacked([tables.joint_rows[joint][:, order] for joint in joints], tables.bias)
    yield "scale", np.array(integers.scale)
    yield "integer bias", integers.bias[order]
    yield "integer switch rows", integers.switch_rows[switches][:, order]
    yield "integer joint rows", _stacked([integers.joint_rows[joint][:, order] for joint in joints], integers.bias)
    yield "integer means", np.concatenate([integers.switch_means[switches], integers.joint_means[joints]])[:, order]


def _counts(tree: Tree, order: list[int]) -> NDArray[np.int64]:
    """Return the rows by class at every node; a tree numbers only the classes that have rows."""
    counts = np.zeros((len(tree.nodes), len(order)), np.int64)
    counts[:, np.array(tree.classes, np.intp)] = [node.counts for node in tree.nodes]
    return counts[:, order]


def _stacked(rows: list[NDArray[Any]], like: NDArray[Any]) -> NDArray[Any]:
    return np.concatenate([np.zeros((0, like.size), like.dtype), *rows])

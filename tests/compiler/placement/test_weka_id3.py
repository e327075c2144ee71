"""Weka's Id3 walked node by node: what it took has, in exact arithmetic, the largest gain."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler.placement.gain import CellCounter, NodeCounts, best_position, compare, gain_bits

LARGEST = "paper14_bits"
SETS = ("bin14", "bin16", "bin3", "dup", "multi", LARGEST, "rare")


class Walk:
    """Follows one tree of Weka's through the rows it was grown from."""

    def __init__(self, X: Any, y: Any) -> None:
        self.X, self.y, self.classes = X, y, int(y.max()) + 1
        self.counter = CellCounter(X, y, self.classes)
        self.decisions = self.unique = 0

    def visit(self, weka: dict[str, Any], rows: Any) -> None:
        totals = np.bincount(self.y[rows], minlength=self.classes)
        if "att" not in weka:
            self._leaf(weka, rows, totals)
            return
        node = NodeCounts(totals, self.counter.count(rows), self.counter.starts)
        self._decision(node, weka["att"])
        for value, child in enumerate(weka["sub"]):
            self.visit(child, rows[self.X[rows, weka["att"]] == value])

    def _decision(self, node: NodeCounts, taken: int) -> None:
        columns = self.counter.columns
        position = best_position(node, columns)
        assert position is not None
        best, theirs = node.table(position), node.table(columns.tolist().index(taken))
        assert compare(best, best.sum(axis=0), theirs, theirs.sum(axis=0)) == 0
        tables, sizes = node.tables(np.arange(len(columns))), best.sum(axis=0)
        equals = [
            c for c, own in zip(columns.tolist(), tables, strict=True) if not compare(own, own.sum(axis=0), best, sizes)
        ]
        assert columns[position] == min(equals)
        self.decisions += 1
        if len(equals) == 1:
            self.unique += 1
            assert columns[position] == taken

    def _leaf(self, weka: dict[str, Any], rows: Any, totals: Any) -> None:
        if not len(rows):
            assert weka["leaf"] is None
            return
        assert weka["leaf"] == int(np.argmax(totals))
        node = NodeCounts(totals, self.counter.count(rows), self.counter.starts)
        position = best_position(node, self.counter.columns)
        # Weka stops below 1e-6 bits.
        assert position is None or gain_bits(node.table(position)) < 1e-6


@pytest.mark.parametrize("half", [False, True], ids=["all", "half"])
@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name == LARGEST)) for name in SETS])
def test_weka_took_an_input_of_the_largest_gain_at_every_node(weka_data: Path, name: str, half: bool) -> None:
    with np.load(weka_data / "id3" / f"id3_{name}.npz") as file:
        data = {key: file[key] for key in file.files}
    weka = json.loads((weka_data / "id3" / f"id3_{name}.json").read_text())
    rows = data["train_idx"] if half else np.arange(len(data["y"]))
    walk = Walk(data["X"], data["y"].astype(np.intp))
    walk.visit(weka["half" if half else "all"]["tree"], rows)
    assert walk.decisions > 5
    assert walk.unique > 0


def test_every_set_is_walked(weka_data: Path) -> None:
    assert sorted(path.stem.removeprefix("id3_") for path in (weka_data / "id3").glob("*.json")) == sorted(SETS)

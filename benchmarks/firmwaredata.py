"""The rows for measuring firmware: 33 switches and 16 joints of simulated grasps, as bytes; folds and rates.

Switches are placed on the training rows of each fold: test rows are never seen before.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from sklearn.model_selection import LeaveOneGroupOut, StratifiedKFold

from thenar.compiler.placement.tree import grow_id3
from thenar.compiler.samples import Samples
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import simulate

SWITCHES, JOINTS, FOLDS, SEED = 33, 16, 4, 1
PORTS = -(-SWITCHES // 8)
CUTS = ("four-fold", "subject left out")

Rows = NDArray[np.uint8]
Labels = NDArray[np.intp]
Predictor = Callable[[Rows], Labels]


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """Rows to train on and rows to predict: switches first, then joints, as bytes (n, 49); labels (n,)."""

    X: Rows
    y: Labels
    asked: Rows
    truth: Labels
    grasps: tuple[str, ...] = ()

    def samples(self, *, joints: bool) -> Samples:
        """Return the training rows for a trainer."""
        return Samples(*split(self.X, joints=joints), self.y, self.grasps)


def folds(console: Console) -> Mapping[str, list[Fold]]:
    """Return the folds of each of CUTS, the same for all models.

    Joint codes of half a degree become bytes of one degree, as sent by an 8-bit glove.
    """
    grasp_set = simulate(load_scene("kamakura")).grasp_set
    grasps, y = np.unique(grasp_set.labels, return_inverse=True)
    codes = grasp_set.codes[:, :JOINTS].astype(np.int64)
    degrees = np.clip((codes - codes.min()) // 2 + 1, 1, 255).astype(np.uint8)
    stratified = StratifiedKFold(FOLDS, shuffle=True, random_state=SEED).split(degrees, y)
    cuts = zip(CUTS, (stratified, LeaveOneGroupOut().split(degrees, y, grasp_set.subjects)), strict=True)
    found: dict[str, list[Fold]] = {}
    for cut, parts in cuts:
        found[cut] = []
        for train, test in track(list(parts), f"placement, {cut}", console=console):
            kept = list(grow_id3(grasp_set.switches[train], y[train]).inputs[:SWITCHES])
            rows = np.hstack([grasp_set.switches[:, kept], degrees]).astype(np.uint8)
            found[cut].append(Fold(rows[train], y[train], rows[test], y[test], tuple(map(str, grasps))))
    return found


def split(X: Rows, *, joints: bool = True) -> tuple[NDArray[np.bool_], NDArray[np.uint16]]:
    """Return switches and codes of rows."""
    return X[:, :SWITCHES].astype(bool), X[:, SWITCHES : SWITCHES + JOINTS * joints].astype(np.uint16)


def raw(X: Rows) -> Rows:
    """Return rows in their wire format (n, 21): eight switches per byte, then a byte per joint."""
    return np.hstack([np.packbits(X[:, :SWITCHES], axis=1, bitorder="little"), X[:, SWITCHES:]])


def rates(cuts: Mapping[str, list[Fold]], train: Callable[[Fold], Predictor]) -> tuple[float, ...]:
    """Return the accuracy by rows in percent, for each cut."""
    found = []
    for parts in cuts.values():
        right = sum(int(np.count_nonzero(train(fold)(fold.asked) == fold.truth)) for fold in parts)
        found.append(100 * right / sum(len(fold.truth) for fold in parts))
    return tuple(found)

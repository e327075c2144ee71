"""The rows on which firmware is measured: 33 switches and 16 joints of simulated grasps, a byte each; folds, tables."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from sklearn.model_selection import StratifiedKFold

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import Stumps
from thenar.compiler.placement.id3 import grow_id3
from thenar.compiler.tables.collapse import collapse
from thenar.compiler.tables.quantise import quantise
from thenar.runtime.tables import IntegerTables
from thenar.simulator.running.simulation import simulate
from thenar.simulator.scenes.decode import load_scene

SWITCHES, JOINTS, ROUNDS, FOLDS, SEED = 33, 16, 100, 4, 1
# Bins a joint: with more, recognition is the same, and tables are larger.
MAX_BINS = 8

Rows = NDArray[np.uint8]
Labels = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """Rows to train on and rows to answer: switches first, then joints, as bytes (n, 49); labels (n,)."""

    X: Rows
    y: Labels
    asked: Rows
    truth: Labels


def material() -> tuple[Rows, Labels]:
    """Return the rows (n, 49) and their labels.

    Joint codes of half a degree become bytes of one degree: what a glove of 8 bits sends.
    """
    grasp_set = simulate(load_scene("kamakura")).grasp_set
    labels = np.unique(grasp_set.labels, return_inverse=True)[1]
    kept = grow_id3(grasp_set.switches, labels).inputs[:SWITCHES]
    codes = grasp_set.codes[:, :JOINTS].astype(np.int64)
    degrees = np.clip((codes - codes.min()) // 2 + 1, 1, 255)
    return np.hstack([grasp_set.switches[:, list(kept)], degrees]).astype(np.uint8), labels


def folds(X: Rows, y: Labels) -> list[Fold]:
    """Return the stratified folds, the same for everybody."""
    cut = StratifiedKFold(FOLDS, shuffle=True, random_state=SEED).split(X, y)
    return [Fold(X[train], y[train], X[test], y[test]) for train, test in cut]


def split(X: Rows, *, joints: bool = True) -> tuple[NDArray[np.bool_], NDArray[np.uint16]]:
    """Return switches and codes of rows."""
    return X[:, :SWITCHES].astype(bool), X[:, SWITCHES : SWITCHES + JOINTS * joints].astype(np.uint16)


def boosted(fold: Fold, *, joints: bool = True) -> Stumps:
    """Return LogitBoost's stumps of the fold."""
    bits, codes = split(fold.X, joints=joints)
    return boost(np.hstack([bits, codes]), fold.y, int(fold.y.max()) + 1, rounds=ROUNDS, max_bins=MAX_BINS)[0]


def tables(stumps: Stumps, fold: Fold, entry_bits: int, *, joints: bool = True) -> IntegerTables:
    """Return the stumps as integer tables."""
    return quantise(collapse(stumps, SWITCHES), *split(fold.X, joints=joints), entry_bits=entry_bits)


def scores(integers: IntegerTables, X: Rows) -> NDArray[np.int64]:
    """Return the integer scores (n, K) of rows."""
    bits, codes = split(X, joints=integers.n_joints > 0)
    found: NDArray[np.int64] = integers.bias.astype(np.int64) + bits @ integers.switch_rows.astype(np.int64)
    for column, thresholds, rows in zip(
        codes.T, integers.thresholds, integers.joint_rows, strict=integers.n_joints > 0
    ):
        found += rows[np.searchsorted(thresholds, column)]
    return found


def rates(cut: list[Fold], console: Console) -> dict[str, float]:
    """Return the recognition rates over all folds: of ours as floats, as 16 and as 8 bits, and of switches alone."""
    right = dict.fromkeys(("float", "16", "8", "switches"), 0)
    for fold in track(cut, "LogitBoost", console=console):
        stumps = boosted(fold)
        right["float"] += _right(stumps.scores(np.hstack(split(fold.asked))), fold)
        for bits in (16, 8):
            right[str(bits)] += _right(scores(tables(stumps, fold, bits), fold.asked), fold)
        alone = tables(boosted(fold, joints=False), fold, 16, joints=False)
        right["switches"] += _right(scores(alone, fold.asked), fold)
    return {what: 100 * count / sum(len(fold.truth) for fold in cut) for what, count in right.items()}


def _right(scores: NDArray[np.generic], fold: Fold) -> int:
    return int(np.count_nonzero(scores.argmax(axis=1) == fold.truth))


def two_changed(fold: Fold, changes: int, *, joints: bool) -> Rows:
    """Return rows of which each differs from the one before in two switches, seeded."""
    rng = np.random.default_rng(SEED)
    rows = [fold.asked[0]]
    for _ in range(changes):
        row = rows[-1].copy()
        row[rng.choice(SWITCHES, 2, replace=False)] ^= 1
        rows.append(row)
    return np.array(rows)[:, : SWITCHES + JOINTS * joints]

"""Sets with one row, column or class, a class with one row or none, as many classes as rows, no kept switch."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.compiler.artifact.compile import compile_build
from thenar.compiler.elementary import softmax
from thenar.compiler.trainers.logitboost import boost
from thenar.compiler.trainers.stumps import Stumps
from thenar.runtime.build import Build
from thenar.runtime.model.tables import winners

from ..finding import Finding
from ..inputs.small_sets import make_set
from ..reference.numbers import precisely, ulps

# The output is sum P / sum P (1 - P), with one P throughout: it keeps the rounding of P in 1 - P, at most one rounding
# of 1 - P, then that of 1 - P itself, of the product, of either sum (two each, on its two grids) and of the quotient: 8
# times 2^-53 of the output, each less than an ulp. If clamped, 1/3 replaces P there, and there are 7 roundings.
_VALUE_ULPS = 8

_FRAMES = [[0, 0], [0, 1], [1, 0], [1, 1]]
_ONE_ROW = make_set(["a"], [[1, 0]], [[3]])
_ONE_CLASS = make_set(["a"] * 8, _FRAMES * 2, [[3], [4], [5], [6]] * 2)
_CONSTANT = make_set(["a"] + ["b"] * 11, [[1, 1]] * 12, [[65535]] * 12)

UNSOLVABLE = {"one row": _ONE_ROW, "one class": _ONE_CLASS, "constants": _CONSTANT}
# Sets whose rows a sum of stumps can separate.
SOLVABLE = {
    "two rows": make_set(["a", "b"], [[1, 0], [0, 1]]),
    "one switch": make_set(["a", "b"] * 4, [[0], [1]] * 4),
    "one joint": make_set(["a", "b"] * 4, codes=[[7], [8]] * 4),
    "a class of one row": make_set(["a"] * 6 + ["b"] * 5 + ["c"], [[0, 0]] * 6 + [[0, 1]] * 5 + [[1, 0]]),
    "a type without rows": make_set(["a", "b"] * 4, [[0, 1], [1, 1]] * 4, types=["a", "b", "c"]),
    "no switch that varies": make_set(["a", "b"] * 4, [[1, 0]] * 8, [[200], [100]] * 4),
}
for _n in (2, 9, 33):
    _types = [f"type {number:02}" for number in range(_n)]
    SOLVABLE[f"{_n} types of one row each"] = make_set(_types, np.eye(_n, dtype=int).tolist())


def findings(full: bool) -> Iterator[Finding]:
    """Build such sets, and compare the first round's values with their closed forms."""
    yield _recognised()
    yield _one_class(50 if full else 10)
    classes = range(2, 34) if full else (2, 3, 4, 7, 33)
    yield from _first_round(classes)
    yield _never_predicted(classes, 200 if full else 20)


def _recognised() -> Finding:
    """A build of a separable set predicts every row of it correctly."""
    rows = Finding.of("rows that their build predicts wrongly", "their labels", 0, "rows")
    for name, grasp_set in SOLVABLE.items():
        with TemporaryDirectory() as folder:
            built = compile_build(grasp_set, Path(folder) / "build", rounds=20, folds=0)
            build = Build.load(built.folder)
        kept = [switch.column for switch in built.manifest.switches]
        frames = zip(grasp_set.switches[:, kept], grasp_set.codes, grasp_set.grasps, strict=True)
        wrong = sum(build.classify(bits, codes) != grasp for bits, codes, grasp in frames)
        rows.see(wrong, name, tried=len(grasp_set))
    return rows


def _one_class(rounds: int) -> Finding:
    """With one class every share is exactly 1 and every loss exactly 0 in every round."""
    off = Finding.of("share, score and loss of the only class", "1, 0 and 0", 0, "score")
    for grasp_set in (_ONE_ROW, _ONE_CLASS):
        X = np.hstack([grasp_set.switches, grasp_set.codes])
        stumps, falling = boost(X, grasp_set.labels, 1, rounds=rounds)
        scores = stumps.scores(X)
        shares = softmax(np.ascontiguousarray(scores.T))
        error = max(float(np.abs(shares - 1).max()), float(np.abs(scores).max()), *falling)
        off.see(error, f"{len(X)} rows", tried=len(falling))
    return off


def _first_round(classes: Sequence[int]) -> Iterator[Finding]:
    """At the start all K shares are 1/K: a class's own row has output K, clamped to 3, others -K/(K - 1)."""
    own = Finding.of("first outputs, as many classes as rows", "min(K, 3) and -K/(K - 1)", _VALUE_ULPS, "ulp")
    empty = Finding.of("first outputs of a class without rows", "-K/(K - 1)", _VALUE_ULPS, "ulp")
    for k in classes:
        with precisely():
            others = -mpf(k) / (k - 1)
        stumps, _ = boost(np.eye(k), np.arange(k), k, rounds=1)
        # With two classes, both use the first column: a class's own row lies right of it, or left.
        low, high = np.sort(stumps.values[0, :, :2], axis=1).T
        own.see(max(_error(low, others), _error(high, mpf(min(k, 3)))), f"{k} classes", tried=2 * k)
        empty.see(_error(_without_the_last(k, 1).values[0, -1], others), f"{k} classes", tried=3)
    yield from (own, empty)


def _error(values: NDArray[np.float64], truth: mpf) -> float:
    return max(ulps(value, truth) for value in values.tolist())


def _without_the_last(k: int, rounds: int) -> Stumps:
    """Train k classes, the last without rows."""
    labels = np.arange(4 * k) % (k - 1)
    X = np.stack([labels, np.arange(4 * k) % 3], axis=1)
    return boost(X, labels, k, rounds=rounds)[0]


def _never_predicted(classes: Sequence[int], rounds: int) -> Finding:
    """A class without rows is never predicted, not even for unseen frames."""
    wins = Finding.of("frames that a class without rows wins", "every frame there is", 0, "frames")
    for k in classes:
        frames = np.array([[code, other] for code in range(-1, k + 1) for other in range(-1, 4)])
        scores = _without_the_last(k, rounds).scores(frames)
        wins.see(int((winners(scores) == k - 1).sum()), f"{k} classes", tried=len(frames))
    return wins

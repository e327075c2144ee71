"""Ours beside Weka's on the same separable set, under the JVM's two exp(): who parts from whom, and in which round."""

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import Stumps, winners
from thenar.compiler.elementary import softmax

from .program import EXP_IN_JAVA, EXP_OF_THE_PROCESSOR, Weka, WekaError

Floats = NDArray[np.float64]

# Distributions further apart than this have parted: what docs/weka-parity.md calls agreement.
PARTED = 1e-9

ROUNDS = 100
CLASSES, ROWS_A_CLASS, SWITCHES, JOINTS = 10, 8, 16, 3
_SEED = 6
_FLIPPED = 0.12  # of the switches
_SHUFFLES = 10


class Differences(msgspec.Struct, frozen=True):
    """The largest difference between two answers' held-out distributions, after each round; None: they never part."""

    largest: tuple[float, ...]
    parts: int | None


class Beside(msgspec.Struct, frozen=True, tag="run"):
    """What came of running Weka and thenar side by side."""

    weka: str  # its version
    rounds: int
    classes: int
    inputs: int
    rows: int
    held_out: int
    learned: int | None  # the round from which on thenar has all training rows right
    weka_itself: Differences  # Weka under the JVM's one exp() and the other
    ours_processor: Differences  # thenar and Weka under the processor's exp()
    ours_java: Differences
    weka_changed: int  # held-out rows whose class in Weka hangs on the choice of exp()
    weka_value: float  # the largest branch value of Weka's stumps under either
    our_value: float
    shuffles: int  # orders of the rows in which thenar was trained again
    our_shuffled: float  # the largest difference between its held-out distributions then


class NotRun(msgspec.Struct, frozen=True, tag="not run"):
    """Why there is nothing to compare."""

    why: str


def beside_weka() -> Beside | NotRun:
    """Return what came of it, or why nothing did."""
    try:
        return _compare(Weka.installed())
    except WekaError as reason:
        return NotRun(str(reason))


def separable_set() -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Return X (n, d) of 0/1 switches and joint codes, and labels (n,): twice ROWS_A_CLASS of each class in turn.

    Each class has its own pattern of switches, of which a few flip in each row, and its own posture of the joints,
    which sways a little. The first half of the rows is trained on; stumps learn it by heart. The seed is one that shows
    in full what other draws show in part.
    """
    random = np.random.default_rng(_SEED)
    patterns = random.integers(0, 2, (CLASSES, SWITCHES))
    postures = random.integers(40, 200, (CLASSES, JOINTS))
    labels = np.arange(2 * CLASSES * ROWS_A_CLASS) % CLASSES
    switches = patterns[labels] ^ (random.random((len(labels), SWITCHES)) < _FLIPPED)
    joints = postures[labels] + random.integers(-15, 16, (len(labels), JOINTS))
    return np.hstack([switches, joints]), labels


def _compare(weka: Weka) -> Beside:
    X, labels = separable_set()
    half = len(labels) // 2
    training, held_out = (X[:half], labels[:half]), X[half:]
    processor, java = (
        weka.boost(*training, CLASSES, ROUNDS, options) for options in (EXP_OF_THE_PROCESSOR, EXP_IN_JAVA)
    )
    ours, _ = boost(*training, CLASSES, rounds=ROUNDS)
    answers = {name: _staged(stumps, held_out) for name, stumps in (("p", processor), ("j", java), ("o", ours))}
    return Beside(
        weka=weka.version(),
        rounds=ROUNDS,
        classes=CLASSES,
        inputs=X.shape[1],
        rows=half,
        held_out=len(held_out),
        learned=_learned(ours, *training),
        weka_itself=_differences(answers["p"], answers["j"]),
        ours_processor=_differences(answers["o"], answers["p"]),
        ours_java=_differences(answers["o"], answers["j"]),
        weka_changed=int(np.count_nonzero(winners(processor.scores(held_out)) != winners(java.scores(held_out)))),
        weka_value=float(max(np.abs(processor.values).max(), np.abs(java.values).max())),
        our_value=float(np.abs(ours.values).max()),
        shuffles=_SHUFFLES,
        our_shuffled=_shuffled(answers["o"], *training, held_out),
    )


def _staged(stumps: Stumps, X: NDArray[np.int64]) -> Floats:
    """Return the distributions (M, K, n) after each round."""
    return np.array([softmax(np.ascontiguousarray(scores.T)) for scores in stumps.staged_scores(X)])


def _differences(one: Floats, other: Floats) -> Differences:
    largest = np.abs(one - other).max(axis=(1, 2))
    apart = np.flatnonzero(largest > PARTED)
    return Differences(tuple(largest.tolist()), int(apart[0]) + 1 if apart.size else None)


def _learned(stumps: Stumps, X: NDArray[np.int64], labels: NDArray[np.intp]) -> int | None:
    wrong = [bool((winners(scores) != labels).any()) for scores in stumps.staged_scores(X)]
    last = max((round_ for round_, is_wrong in enumerate(wrong, 1) if is_wrong), default=0)
    return last + 1 if last < len(wrong) else None


def _shuffled(answer: Floats, X: NDArray[np.int64], labels: NDArray[np.intp], held_out: NDArray[np.int64]) -> float:
    random = np.random.default_rng(_SEED)
    orders = (random.permutation(len(labels)) for _ in range(_SHUFFLES))
    again = (_staged(boost(X[order], labels[order], CLASSES, rounds=ROUNDS)[0], held_out) for order in orders)
    return max(float(np.abs(answer - other).max()) for other in again)

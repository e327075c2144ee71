"""Weka 3.6, run as a program on the same separable set as thenar, with both exp() of the JVM.

Weka is not part of thenar: if java or Weka's jar is missing, the comparison is not run, and the report says so.
"""

import re
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats, softmax
from thenar.compiler.trainers.logitboost import boost
from thenar.compiler.trainers.stumps import Stumps
from thenar.runtime.model.tables import winners

JAR = Path("/usr/share/java/weka.jar")  # where Debian's package puts it

# The JVM has two exp(): the processor's, its default, and a portable one, which this option selects.
EXP_OF_THE_PROCESSOR: tuple[str, ...] = ()
EXP_IN_JAVA = ("-XX:+UnlockDiagnosticVMOptions", "-XX:-UseLibmIntrinsic")

_LONGEST_S = 120.0
_BRANCHES = tuple(re.compile(rf"^x(\d+) {branch} : (\S+)$", re.M) for branch in (r"<= (\S+)", r"> (\S+)", "is missing"))

# Distributions further apart than this have diverged, as in docs/project/weka-parity.md.
DIVERGED = 1e-9

ROUNDS = 100
CLASSES, ROWS_A_CLASS, SWITCHES, JOINTS = 10, 8, 16, 3
_SEED = 6
_FLIPPED = 0.12  # of the switches


def run_weka(*arguments: str, options: tuple[str, ...] = ()) -> str:
    """Return the output of a Weka class under JVM `options`. Raises RuntimeError if Weka is missing or fails."""
    java = shutil.which("java")
    if java is None or not JAR.is_file():
        raise RuntimeError("java or Weka is not installed")
    command = [java, *options, "-cp", str(JAR), *arguments]
    try:
        return subprocess.run(command, check=True, capture_output=True, text=True, timeout=_LONGEST_S).stdout
    except subprocess.CalledProcessError as reason:
        said = (reason.stderr or reason.stdout).strip().partition("\n")[0]
        raise RuntimeError(f"java ended with code {reason.returncode}: {said}") from reason
    except subprocess.TimeoutExpired as reason:
        raise RuntimeError(f"Weka was not finished after {_LONGEST_S:g} s") from reason


def weka_stumps(
    X: NDArray[np.int64], labels: NDArray[np.intp], n_classes: int, rounds: int, options: tuple[str, ...]
) -> Stumps:
    """Train Weka's LogitBoost on X (n, d) of integers and labels (n,) under JVM `options`; return its stumps.

    They have full precision: Java prints a double so that it reads back unchanged. Raises RuntimeError.
    """
    with TemporaryDirectory(prefix="thenar-weka-") as folder:
        table = Path(folder) / "set.arff"
        table.write_text(_arff(X, labels, n_classes))
        arguments = ("-I", str(rounds), "-no-cv", "-v", "-t", str(table))
        printed = run_weka("weka.classifiers.meta.LogitBoost", *arguments, options=options)
    return read_stumps(printed, rounds, n_classes, X.shape[1])


def read_stumps(printed: str, rounds: int, n_classes: int, n_inputs: int) -> Stumps:
    """Parse the stumps of a model in Weka's output, with columns x0, x1, ... Raises RuntimeError for another model."""
    left, right, missing = (pattern.findall(printed) for pattern in _BRANCHES)
    if not len(left) == len(right) == len(missing) == rounds * n_classes:
        raise RuntimeError(f"Weka printed {len(left)} stumps, not {rounds} rounds of {n_classes}")
    shape = rounds, n_classes
    columns = np.array([int(column) for column, _, _ in left], dtype=np.int32).reshape(shape)
    if columns.max() >= n_inputs:
        raise RuntimeError(f"Weka split column {columns.max()} of {n_inputs}")
    values = np.array([[float(line[-1]) for line in lines] for lines in (left, right, missing)])
    thresholds = np.array([float(threshold) for _, threshold, _ in left]).reshape(shape)
    return Stumps(n_inputs, columns, thresholds, values.T.reshape(*shape, 3), shrinkage=1.0)


def _arff(X: NDArray[np.int64], labels: NDArray[np.intp], n_classes: int) -> str:
    classes = ",".join(f"c{number}" for number in range(n_classes))
    lines = ["@relation separable", *(f"@attribute x{column} numeric" for column in range(X.shape[1]))]
    lines += [f"@attribute class {{{classes}}}", "@data"]
    lines += [",".join([*map(str, row), f"c{label}"]) for row, label in zip(X.tolist(), labels.tolist(), strict=True)]
    return "\n".join([*lines, ""])


class Differences(msgspec.Struct, frozen=True):
    """The largest difference between two models' held-out distributions, after each round; None: they never diverge."""

    largest: tuple[float, ...]
    parts: int | None


class WekaComparison(msgspec.Struct, frozen=True):
    """The comparison of Weka and thenar."""

    weka: str  # its version
    rounds: int
    classes: int
    rows: int
    held_out: int
    weka_itself: Differences  # Weka with the JVM's two exp()
    ours_processor: Differences  # thenar and Weka with the processor's exp()
    ours_java: Differences
    weka_changed: int  # held-out rows whose class in Weka depends on the choice of exp()


def compare_with_weka() -> WekaComparison | str:
    """Run the comparison, or return the reason why it cannot run."""
    X, labels = separable_set()
    half = len(labels) // 2
    training, held_out = (X[:half], labels[:half]), X[half:]
    try:
        processor, java = (
            weka_stumps(*training, CLASSES, ROUNDS, options) for options in (EXP_OF_THE_PROCESSOR, EXP_IN_JAVA)
        )
        version = run_weka("weka.core.Version").partition("\n")[0].strip()
    except RuntimeError as reason:
        return str(reason)
    ours, _ = boost(*training, CLASSES, rounds=ROUNDS)
    # The distributions (M, K, n) after each round.
    by_processor, by_java, by_us = (
        np.array([softmax(np.ascontiguousarray(scores.T)) for scores in stumps.staged_scores(held_out)])
        for stumps in (processor, java, ours)
    )
    return WekaComparison(
        weka=version,
        rounds=ROUNDS,
        classes=CLASSES,
        rows=half,
        held_out=len(held_out),
        weka_itself=_differences(by_processor, by_java),
        ours_processor=_differences(by_us, by_processor),
        ours_java=_differences(by_us, by_java),
        weka_changed=int(np.count_nonzero(winners(processor.scores(held_out)) != winners(java.scores(held_out)))),
    )


def separable_set() -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Return X (n, d) of 0/1 switches and joint codes, and labels (n,): twice ROWS_A_CLASS of each class in turn.

    Each class has its own pattern of switches, of which a few flip in each row, and its own posture of the joints with
    small deviations. The first half of the rows is for training; stumps overfit it. The seed shows in full an effect
    that other draws show in part.
    """
    random = np.random.default_rng(_SEED)
    patterns = random.integers(0, 2, (CLASSES, SWITCHES))
    postures = random.integers(40, 200, (CLASSES, JOINTS))
    labels = np.arange(2 * CLASSES * ROWS_A_CLASS) % CLASSES
    switches = patterns[labels] ^ (random.random((len(labels), SWITCHES)) < _FLIPPED)
    joints = postures[labels] + random.integers(-15, 16, (len(labels), JOINTS))
    return np.hstack([switches, joints]), labels


def _differences(one: Floats, other: Floats) -> Differences:
    largest = np.abs(one - other).max(axis=(1, 2))
    apart = np.flatnonzero(largest > DIVERGED)
    return Differences(tuple(largest.tolist()), int(apart[0]) + 1 if apart.size else None)

"""The real Weka run beside thenar, its model read back as it is, and a plain sentence where there is no Weka."""

import re
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.elementary import softmax
from thenar.stability import weka as module
from thenar.stability.weka import (
    CLASSES,
    DIVERGED,
    EXP_IN_JAVA,
    EXP_OF_THE_PROCESSOR,
    WekaComparison,
    compare_with_weka,
    read_stumps,
    separable_set,
    weka_stumps,
)

PRINTED = """\
Iteration 1
\tClass 1 (class=c0)

x1 <= 0.5 : -1.5
x1 > 0.5 : 2.360655737704919
x1 is missing : 3.700743415417193E-16

\tClass 2 (class=c1)

x0 <= 117.0 : 3.0
x0 > 117.0 : -0.1
x0 is missing : 0.0
"""


@pytest.fixture(scope="module")
def compared(weka: Callable[..., str]) -> WekaComparison:
    """What came of it where Weka is installed."""
    found = compare_with_weka()
    assert isinstance(found, WekaComparison), found
    return found


def test_a_printed_model_is_read_to_the_last_digit() -> None:
    stumps = read_stumps(PRINTED, rounds=1, n_classes=2, n_inputs=2)
    assert stumps.columns.tolist() == [[1, 0]]
    assert stumps.thresholds.tolist() == [[0.5, 117.0]]
    assert stumps.values.tolist() == [[[-1.5, 2.360655737704919, 3.700743415417193e-16], [3.0, -0.1, 0.0]]]


@pytest.mark.parametrize("left_out", ["x0 > 117.0", "x1 is missing", "x1 <= 0.5"])
def test_a_model_that_lacks_a_branch_is_refused(left_out: str) -> None:
    with pytest.raises(RuntimeError, match=r"Weka printed . stumps, not 1 rounds of 2"):
        read_stumps(PRINTED.replace(left_out, "?"), rounds=1, n_classes=2, n_inputs=2)


def test_without_java_it_is_not_run_and_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert compare_with_weka() == "java or Weka is not installed"


def test_a_jvm_that_refuses_is_quoted(weka: Callable[..., str]) -> None:
    X, labels = separable_set()
    with pytest.raises(RuntimeError, match="java ended with code 1: Unrecognized VM option 'UseNothingOfTheKind'"):
        weka_stumps(X, labels, CLASSES, 1, ("-XX:-UseNothingOfTheKind",))


@pytest.mark.slow
def test_the_stumps_read_give_wekas_own_probabilities(weka: Callable[..., str], tmp_path: Path) -> None:
    X, labels = separable_set()
    half = len(X) // 2
    table = tmp_path / "all.arff"
    table.write_text(module._arff(X, labels, CLASSES))
    printed = weka(
        *("weka.classifiers.meta.LogitBoost", "-I", "10", "-no-cv", "-t", str(table)), *("-p", "0", "-distribution")
    )
    lines = [line.split() for line in printed.splitlines() if re.match(r" +\d+ +\d+:", line)]
    theirs = np.array([[float(share.lstrip("*")) for share in line[-1].split(",")] for line in lines])
    stumps = weka_stumps(X, labels, CLASSES, 10, EXP_OF_THE_PROCESSOR)
    ours = softmax(np.ascontiguousarray(stumps.scores(X).T)).T
    assert theirs.shape == (2 * half, CLASSES)
    assert np.abs(ours - theirs).max() <= 0.0005 + 1e-9  # Weka prints three digits
    assert (ours.argmax(axis=1) == theirs.argmax(axis=1)).all()


@pytest.mark.slow
def test_weka_parts_from_itself_and_thenar_from_weka_not_before(compared: WekaComparison) -> None:
    parts = compared.weka_itself.parts
    assert parts is not None
    assert max(compared.weka_itself.largest[: parts - 1]) < DIVERGED < compared.weka_itself.largest[parts - 1]
    for ours in (compared.ours_processor, compared.ours_java):
        assert max(ours.largest[: parts - 1]) < DIVERGED
    assert compared.weka_changed > 0


def test_weka_leaves_nothing_behind(weka: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    X, labels = separable_set()
    weka_stumps(X, labels, CLASSES, 1, EXP_IN_JAVA)
    assert list(tmp_path.iterdir()) == []

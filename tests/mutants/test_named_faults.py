"""Faults to fear most, by name: each is made in a throw-away copy, where the tests named beside it must catch it.

`make mutants` draws its faults; these are chosen, among them what no tool thinks of.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]


class Fault(NamedTuple):
    """In `file`, `sound` reads `broken`; the tests in `caught_by` notice."""

    name: str
    file: str
    sound: str
    broken: str
    caught_by: str


FAULTS = (
    Fault(
        "the working response has the other sign",
        "compiler/trainers/logitboost.py",
        "np.where(member, complement, -probability)",
        "np.where(member, -complement, probability)",
        "tests/compiler/boosting/test_boost.py",
    ),
    Fault(
        "working responses are not clamped",
        "compiler/trainers/logitboost.py",
        "np.maximum(np.where(member, probability, complement), 1.0 / z_max)",
        "np.where(member, probability, complement)",
        "tests/stability/test_catalogue.py::test_a_case_holds_quickly[targets]",
    ),
    Fault(
        "branches answer with more than z_max",
        "compiler/trainers/stumps.py",
        "np.clip(values, -z_max, z_max).T",
        "values.T",
        "tests/compiler/test_drawn_numbers.py::test_no_stump_explains_more_and_branches_answer_with_their_means",
    ),
    Fault(
        "an empty branch counts as one of next to no weight",
        "compiler/trainers/stumps.py",
        "EMPTY_SHARE = 2.0**-38",
        "EMPTY_SHARE = 0.0",
        "tests/compiler/boosting/test_stumps.py",
    ),
    Fault(
        "the grid of sums is four times too fine",
        "compiler/elementary.py",
        "SUM_BITS = 52",
        "SUM_BITS = 54",
        "tests/compiler/boosting/test_exactsums.py",
    ),
    Fault(
        "weights and responses are summed in single precision",
        "compiler/elementary.py",
        "units = np.rint(scaled)",
        "units = np.rint(scaled).astype(np.float32).astype(np.float64)",
        "tests/compiler/boosting/test_exactsums.py",
    ),
    Fault(
        "the centring factor (K - 1)/K is missing",
        "compiler/trainers/stumps.py",
        "g *= k - 1\n    g /= k",
        "",
        "tests/stability/test_catalogue.py::test_a_case_holds_quickly[scoretables]",
    ),
    Fault(
        "of tied classes the ensemble takes the last",
        "runtime/model/tables.py",
        "(scores >= scores.max(axis=1, keepdims=True) - TIE).argmax(axis=1)",
        "scores.shape[1] - 1 - (scores >= scores.max(axis=1, keepdims=True) - TIE)[:, ::-1].argmax(axis=1)",
        "tests/compiler/boosting/test_stumps.py",
    ),
    Fault(
        "of tied classes the build takes the last",
        "runtime/build.py",
        "self.classes[scores.index(max(scores))]",
        "self.classes[len(scores) - 1 - scores[::-1].index(max(scores))]",
        "tests/runtime/test_build.py",
    ),
    Fault(
        "gains that floating point cannot tell apart are not compared exactly",
        "compiler/placement/gain.py",
        "close = close[np.argsort(columns[close])]",
        "return int(scores.argmax())",
        "tests/compiler/placement/test_gain.py",
    ),
    Fault(
        "exp is taken of scores as they are, not less the greatest",
        "compiler/elementary.py",
        "odds = exp(scores - top)",
        "odds = exp(scores)",
        "tests/compiler/test_elementary.py",
    ),
    Fault(
        "a code at a threshold goes right, in the float tables",
        "runtime/model/terms/bins.py",
        "self.rows[np.searchsorted(self.thresholds, values[0])]",
        'self.rows[np.searchsorted(self.thresholds, values[0], side="right")]',
        "tests/compiler/model/test_collapse.py",
    ),
    Fault(
        "a code at a threshold goes right, in the build",
        "runtime/scores.py",
        "self._rows[bisect_left(self._thresholds, code)]",
        "self._rows[__import__('bisect').bisect_right(self._thresholds, code)]",
        "tests/runtime/test_scorer.py",
    ),
    Fault(
        "halves are rounded up, not to even",
        "runtime/model/terms/base.py",
        "np.rint(rows / grid) * grid",
        "np.floor(rows / grid + 0.5) * grid",
        "tests/compiler/model/test_quantise.py",
    ),
    Fault(
        "tables that could overflow are loaded",
        "runtime/model/integers.py",
        "if self.bound > LIMIT:",
        "if self.bound > 2 * LIMIT:",
        "tests/runtime/test_tables.py",
    ),
    Fault(
        "mean rows are left out of the overflow bound",
        "runtime/model/integers.py",
        "np.stack([tables.switch_rows, tables.switch_means])",
        "np.stack([tables.switch_rows, tables.switch_rows])",
        "tests/runtime/test_tables.py",
    ),
    Fault(
        "what stands in for all switches at once is not fitted",
        "compiler/model/faults.py",
        "if switches and (joints != joints[0]).any():",
        "if False:",
        "tests/stability/test_catalogue.py::test_a_case_holds_quickly[missing]",
    ),
)


@pytest.fixture(scope="module")
def staged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package, its links followed, and of the tests, which is imported before the installed thenar."""
    folder, leave_out = tmp_path_factory.mktemp("staged"), shutil.ignore_patterns("__pycache__")
    for name, place in {"thenar": "src/thenar", "tests": "tests"}.items():
        shutil.copytree(ROOT / place, folder / name, ignore=leave_out)
    shutil.copy(ROOT / "pyproject.toml", folder)
    # Bytecode that names its source by content: what is as long as before, and of the same second, is compiled again.
    compiling = ("-m", "compileall", "-q", "--invalidation-mode", "checked-hash", folder / "thenar")
    subprocess.run([sys.executable, *compiling], check=True)
    return folder


def run(staged: Path, *tests: str) -> "subprocess.CompletedProcess[str]":
    environment = {**os.environ, "PYTHONPATH": str(staged), "THENAR_MUTATED": "1"}
    options = ["-x", "-q", "-pno:cacheprovider", "-m", "not slow", "--tb=no"]
    command = [sys.executable, "-m", "pytest", *options, *tests]
    return subprocess.run(command, cwd=staged, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_in_a_sound_copy_the_tests_pass(staged: Path) -> None:
    passed = run(staged, *sorted({fault.caught_by for fault in FAULTS}))
    assert passed.returncode == 0, passed.stdout


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS, ids=[fault.name for fault in FAULTS])
def test_it_is_caught(staged: Path, fault: Fault) -> None:
    file = staged / "thenar" / fault.file
    text = file.read_text()
    assert text.count(fault.sound) == 1, f"{fault.file} no longer says {fault.sound!r}, or says it twice"
    file.write_text(text.replace(fault.sound, fault.broken))
    try:
        ran = run(staged, fault.caught_by)
    finally:
        file.write_text(text)
    assert ran.returncode == 1, ran.stdout  # 1: tests failed; anything else: they did not run
    assert " failed" in ran.stdout
    assert " error" not in ran.stdout.splitlines()[-1]

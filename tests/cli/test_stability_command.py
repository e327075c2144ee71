import json
import re
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from thenar.stability import cases
from thenar.stability import report as catalogue
from thenar.stability.finding import Case

from .conftest import thenar

CASE = """
from thenar.stability.finding import Finding
def findings(full):
    yield Finding("sums", "the rule itself", {error}, 1.0, "ulp", 3, "the {name} row")
"""
RAISING = CASE + "    raise ArithmeticError('lost')\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of cases in place of the shipped catalogue: a sound one, one beyond its bound, one that raises."""
    folder = tmp_path / "cases"
    folder.mkdir()
    (folder / "sound.py").write_text(CASE.format(name="sound", error=0.5))
    (folder / "exceeding.py").write_text(CASE.format(name="exceeding", error=1.5))
    (folder / "raising.py").write_text(RAISING.format(name="raising", error=0.5))
    monkeypatch.setattr(cases, "__path__", [str(folder)])
    names = ("sound", "exceeding", "raising")
    shown = {name: Case(f"a {name} case", f"the {name} danger") for name in names}
    monkeypatch.setattr(catalogue, "CASES", shown)
    yield folder
    for name in names:
        sys.modules.pop(f"{cases.__name__}.{name}", None)


# Judges the cases of `folder`.
judged = partial(thenar, "stability", "--jobs", 1)


def test_cases_that_hold_exit_with_0_and_print_error_bound_and_verdict() -> None:
    done = judged("sound")
    assert (done.returncode, done.stderr) == (0, "")
    assert "What could go wrong: the sound danger" in done.stdout
    assert ["sums", "the", "rule", "itself", "3", "0.5", "1", "ulp", "holds"] in (
        line.replace("│", "").split() for line in done.stdout.splitlines()
    )
    assert done.stdout.splitlines()[-1] == "1 case quickly, 1 check on 3 inputs: all hold"


def test_a_bound_that_does_not_hold_exits_with_1_and_says_where() -> None:
    done = judged("sound", "exceeding")
    assert done.returncode == 1
    assert done.stdout.splitlines()[-2] == (
        "exceeding: sums: 1.5 ulp against a bound of 1 ulp; worst: the exceeding row"
    )
    assert done.stdout.splitlines()[-1] == "2 cases quickly, 2 checks on 6 inputs: NOT all hold, see exceeding"


def test_a_case_that_raises_is_a_line_and_hides_no_other() -> None:
    done = judged("raising", "sound")
    assert done.returncode == 1
    assert "FAILED: ArithmeticError in raising.py, line 5: lost" in done.stdout
    assert "Traceback" not in done.stdout + done.stderr
    assert "a sound case" in done.stdout


def test_json_holds_every_number_and_the_verdicts() -> None:
    done = judged("exceeding", "sound", "--json")
    report = json.loads(done.stdout)
    assert (done.returncode, report["holds"], report["full"], report["weka"]) == (1, False, False, None)
    assert [(case["name"], case["holds"]) for case in report["cases"]] == [("sound", True), ("exceeding", False)]
    finding = report["cases"][1]["findings"][0]
    assert (finding["error"], finding["holds"]) == (1.5, False)


def test_a_narrow_terminal_cuts_no_word_number_or_verdict(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check = "intervals of compensated averages that leave 0 to 1, or their own mean, in the worst of all"
    finding = f"yield Finding({check!r}, 'products of whole numbers', 2.4375e-16, 2.2214e-15, 'x rounding', 235929)"
    (folder / "sound.py").write_text(CASE.format(name="sound", error=0.5) + f"    {finding}\n")
    for name, value in {"COLUMNS": "60", "FORCE_COLOR": "1", "NO_COLOR": "1", "TERM": "xterm"}.items():
        monkeypatch.setenv(name, value)
    plain = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", judged("sound").stdout)
    assert max(map(len, plain.splitlines())) <= 60
    words = {word for line in plain.splitlines() for word in line.split()}
    assert "\u2026" not in plain
    assert words >= {*check.split(), "reference", "numbers", "235,929", "2.44e-16", "2.22e-15", "rounding", "verdict"}


def test_without_java_the_table_says_what_was_not_run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "not run: java or Weka is not installed" in judged().stdout

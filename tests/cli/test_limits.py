"""Limits and --robust of `place` and `compile`."""

import html
import json
import re
import shlex
from pathlib import Path

import numpy as np

from thenar.runtime.manifest_file import manifest_from_bytes

from .conftest import refusal, works

LAYOUT = """
[places]
s0 = [0.0, 0.0]
s1 = [5.0, 0.0]
s2 = [20.0, 0.0]
s3 = [0.0, 20.0]
s4 = [3.0, 20.0]
s5 = [40.0, 40.0]
"""


def layout(folder: Path) -> Path:
    (folder / "layout.toml").write_text(LAYOUT)
    return folder / "layout.toml"


def test_a_placement_obeys_its_limits(set_file: Path, tmp_path: Path) -> None:
    asked = ["--method", "cmim", "--keep", 4, "--have", "s4", "--never", "s2,s5", "--apart-mm", 6]
    done = works("place", set_file, *asked, "--layout", layout(tmp_path), "--json")
    found = json.loads(done.stdout)
    names = {each["name"] for each in found["switches"]}
    assert "s4" in names
    assert names in ({"s4", "s0"}, {"s4", "s1"})


def test_what_contradicts_or_is_not_known_is_refused(set_file: Path, tmp_path: Path) -> None:
    where = ("--layout", layout(tmp_path))
    for asked, reason in (
        (("--have", "s4,s3", "--apart-mm", 6, *where), "s4,s3 are 3.0 mm apart, --apart-mm requires 6"),
        (("--have", "s4", "--never", "s4"), "--have and --never both name s4"),
        (("--never", "s9"), "no input 's9'"),
        (("--apart-mm", 6), "the position of s0, s1, s2, s3, s4 and 1 more is unknown"),
        (("--budget-us", 0), "--never and --budget-us leave nothing"),
        (("--at-most", 3, "pads"), "'pads' is not"),
        (where, "--layout gives positions for --draw, or for --apart-mm with a --method"),
    ):
        assert reason in refusal("place", set_file, *asked)


def test_a_build_states_its_limits_and_its_report_the_command(set_file: Path, tmp_path: Path) -> None:
    build = tmp_path / "build"
    asked = "--method elimination --keep 3 --never s2 --have s5,s0 --at-most 4 taxels --budget-us 300 --robust"
    asked += " --width 12 --max-bins 5"
    done = works("compile", set_file, "-o", build, "--rounds", 4, "--folds", 2, *asked.split())
    options = manifest_from_bytes((build / "build.json").read_bytes()).options
    assert (options.never, options.have, options.at_most_taxels) == (("s2",), ("s5", "s0"), 4)
    assert options.robust
    assert "--budget-us limits only the scan of switches and taxels" in done.stderr
    assert {"s5", "s0"} <= {each.name for each in manifest_from_bytes((build / "build.json").read_bytes()).switches}
    page = html.unescape((build / "report.html").read_text())
    line = next(each for each in re.findall(r"thenar compile SET.grasps -o build/ .*", page) if "--prune" in each)
    again = tmp_path / "again"
    words = shlex.split(line)[5:]
    assert words[words.index("--at-most") :][:3] == ["--at-most", "4", "taxels"]
    works("compile", set_file, "-o", again, *words)
    assert (again / "build.json").read_bytes() == (build / "build.json").read_bytes()


def test_rows_with_lost_inputs_are_trained_on_and_never_tested(set_file: Path, tmp_path: Path) -> None:
    rates = []
    for name, more in (("plain", ()), ("robust", ("--robust",))):
        works("compile", set_file, "-o", tmp_path / name, "--rounds", 6, "--folds", 2, "--no-report", *more)
        rates.append(manifest_from_bytes((tmp_path / name / "build.json").read_bytes()).rates)
    assert [[rate.total for rate in each] for each in rates] == [[60, 60], [60, 60]]
    assert (tmp_path / "plain" / "tables.bin").read_bytes() != (tmp_path / "robust" / "tables.bin").read_bytes()
    assert not np.array_equal([rate.correct for rate in rates[0]], [0, 0])

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

Thenar = Callable[..., subprocess.CompletedProcess[str]]


def test_compile_writes_a_build_and_says_what_it_is(thenar: Thenar, set_file: Path, tmp_path: Path) -> None:
    done = thenar("compile", set_file, "-o", tmp_path / "build", "--rounds", 10)
    assert done.returncode == 0, done.stderr
    assert "3 grasp types from" in done.stdout
    assert "of 6 switches and 2 joints" in done.stdout
    assert "in 4 folds, placement and all:" in done.stdout
    assert sorted(path.name for path in (tmp_path / "build").iterdir()) == ["build.json", "ensemble.bin", "tables.bin"]


def test_json_prints_what_build_json_says(thenar: Thenar, set_file: Path, tmp_path: Path) -> None:
    done = thenar("compile", set_file, "-o", tmp_path / "build", "--rounds", 3, "--inputs", "switches", "--json")
    document = json.loads(done.stdout)
    assert document == json.loads((tmp_path / "build" / "build.json").read_bytes())
    assert document["options"]["inputs"] == "switches"
    assert document["joints"] == []


def test_compiling_again_gives_the_same_bytes(thenar: Thenar, set_file: Path, tmp_path: Path) -> None:
    seen = []
    for _ in range(2):
        assert thenar("compile", set_file, "-o", tmp_path / "build", "--rounds", 3).returncode == 0
        seen.append({path.name: path.read_bytes() for path in (tmp_path / "build").iterdir()})
    assert seen[0] == seen[1]


def test_help_has_an_example(thenar: Thenar) -> None:
    assert "Example:\n      thenar compile set.grasps -o build/" in thenar("compile", "--help").stdout


def test_every_option_reaches_the_build(thenar: Thenar, set_file: Path, tmp_path: Path) -> None:
    options = {"prune": 2, "rounds": 3, "inputs": "both", "shrinkage": 0.5, "folds": 2, "seed": 7}
    given = [word for name, value in options.items() for word in (f"--{name}", value)]
    done = thenar("compile", set_file, "-o", tmp_path / "build", *given, "--json")
    assert json.loads(done.stdout)["options"] == options

import json
import re
from pathlib import Path

from .conftest import thenar, works


def test_compile_writes_a_build_and_says_what_it_is(set_file: Path, tmp_path: Path) -> None:
    done = works("compile", set_file, "-o", tmp_path / "build", "--rounds", 10)
    assert done.stderr == ""
    assert "3 grasp types from" in done.stdout
    assert "of 6 switches and 2 of 2 joints" in done.stdout
    assert re.search(
        r"^accuracy, within subject: \d+\.\d % \[\d+\.\d, \d+\.\d\], \d+ of 60 trials in 4 nested folds$",
        done.stdout,
        re.M,
    )
    assert "\nfirmware: for atmega328p: about " in done.stdout
    made = {path.name for path in (tmp_path / "build").iterdir()}
    files = ("build.json", "ensemble.bin", "hand.json", "report.html", "tables.bin")
    assert made == {*files, "firmware", "spec"}
    core, glove = ("thenar.c", "thenar.h", "thenar_block.h"), ("glove.c", "glove.h", "glove_codes.c", "glove_codes.h")
    made = {path.name for path in (tmp_path / "build" / "firmware").iterdir()}
    assert made == {*core, *(f"thenar_{name}" for name in glove)}


def test_json_prints_what_build_json_says(set_file: Path, tmp_path: Path) -> None:
    given = ("--rounds", 3, "--inputs", "switches", "--no-report", "--json")
    done = thenar("compile", set_file, "-o", tmp_path / "build", *given)
    document = json.loads(done.stdout)
    assert document == json.loads((tmp_path / "build" / "build.json").read_bytes())
    assert document["options"]["inputs"] == "switches"
    assert document["joints"] == []


def test_every_option_reaches_the_build(set_file: Path, tmp_path: Path) -> None:
    options = {"prune": 2, "rounds": 3, "inputs": "both", "shrinkage": 0.5, "folds": 2, "seed": 7, "tolerance": 1e-9}
    options |= {"table_bits": 8, "max_bins": 4, "width": 15, "refuse": 0.125}
    given = [word for name, value in options.items() for word in (f"--{name.replace('_', '-')}", value)]
    done = thenar("compile", set_file, "-o", tmp_path / "build", *given, "--no-report", "--json")
    assert json.loads(done.stdout)["options"] == options


def test_a_tolerance_ends_the_training_and_the_build_says_so(set_file: Path, tmp_path: Path) -> None:
    given = ("compile", set_file, "-o", tmp_path / "build", "--no-report", "--rounds", 500, "--folds", 0)
    done = thenar(*given, "--tolerance", 0.01)
    rounds = json.loads((tmp_path / "build" / "build.json").read_bytes())["stopped_after"]
    assert 1 < rounds < 500
    assert f"stopped after {rounds} of 500 rounds: the last changed the mean loss by less than 0.01" in done.stdout
    assert thenar(*given, "--tolerance", "nan").returncode == 2

"""Every example runs as its docstring says, beside an emulated glove, and fits on a card."""

import ast
import csv
import os
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import nbformat
import numpy as np
import pytest
from sklearn.model_selection import GroupKFold, StratifiedKFold, cross_val_score
from sklearn.neighbors import KNeighborsClassifier
from sklearn.preprocessing import StandardScaler

from thenar.compiler import GraspSet
from thenar.runtime import Build

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
TABLE = EXAMPLES / "home_glove.csv"
NOTEBOOK = EXAMPLES / "your_own_table.py"
NAMES = sorted(path.name for path in EXAMPLES.glob("*.py") if path.stem not in {TABLE.stem, NOTEBOOK.stem})
MOST_LINES = 25
THENAR = [sys.executable, "-m", "thenar.cli"]
HARNESS = """\
name = "bench"
[cyberglove]
port = "/dev/ttyUSB0"
[[stream]]
port = "/dev/ttyACM0"
switches = [{}]
"""

slow = pytest.mark.slow


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with recorded grasps, a build of them, and the harness of a glove that both fit."""
    folder = tmp_path_factory.mktemp("bench")
    run(folder, *THENAR, "simulate", "quick", "-o", "quick.grasps")
    run(folder, *THENAR, "compile", "quick.grasps", "-o", "build", "--rounds", "10", "--folds", "0")
    switches = Build.load(folder / "build").manifest.switches
    (folder / "bench.toml").write_text(HARNESS.format(", ".join(f'"{switch.name}"' for switch in switches)))
    return folder


def run(folder: Path, *command: str) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def emulated(*command: str) -> tuple[str, ...]:
    """Return a command beside an emulated glove that takes another grasp every 300 ms, again and again."""
    play = ("emulate", "quick.grasps", "--glove", "bench.toml", "--period-ms", "300", "--repeat", "--")
    return (*THENAR, *play, *command)


def example(name: str, *arguments: str) -> tuple[str, ...]:
    return (sys.executable, str(EXAMPLES / name), *arguments)


@pytest.fixture
def port() -> str:
    """Return a free port."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        return str(free.getsockname()[1])


@pytest.fixture
def live(bench: Path, port: str) -> Iterator["subprocess.Popen[str]"]:
    """Return a live run that serves the port, and goes on until the test ends."""
    sinks = ("--sink", "jsonl:-", "--sink", f"tcp:{port}")
    command = emulated(*THENAR, "run", "build", "--glove", "{glove}", *sinks)
    with subprocess.Popen(command, cwd=bench, stdout=subprocess.PIPE, text=True) as process:
        yield process
        process.terminate()


@pytest.mark.parametrize("name", NAMES)
def test_an_example_fits_on_a_card_and_says_how_to_run_it(name: str) -> None:
    text = (EXAMPLES / name).read_text()
    assert len(text.splitlines()) <= MOST_LINES
    assert f"python {name}" in (ast.get_docstring(ast.parse(text)) or "")


@slow
def test_run_build_says_what_is_recognised(bench: Path) -> None:
    command = emulated(*example("run_build.py", "build", "{glove}"))
    with subprocess.Popen(command, cwd=bench, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        sure = 0
        while sure < 50:
            grasp, share, health, *_preshape = process.stdout.readline().split()
            assert share.endswith("%")
            sure += health == "ok" and grasp != "unknown"
        process.terminate()
        process.stdout.read()
    assert process.returncode == 0


@slow
def test_subscribe_prints_a_line_a_frame_from_where_it_came(
    bench: Path, port: str, live: "subprocess.Popen[str]"
) -> None:
    assert live.stdout is not None
    live.stdout.readline()  # by now the port is there
    with subprocess.Popen(example("subscribe.py", port), cwd=bench, stdout=subprocess.PIPE, text=True) as reader:
        assert reader.stdout is not None
        numbers = [int(reader.stdout.readline().split()[0]) for _ in range(20)]
        reader.terminate()
    assert numbers == list(range(numbers[0], numbers[0] + 20))


@slow
def test_barrett_preshape_says_where_eight_joints_shall_stand(bench: Path) -> None:
    command = emulated(*THENAR, "run", "build", "--glove", "{glove}", "--sink", "jsonl:-", "--frames", "700")
    with subprocess.Popen(command, cwd=bench, stdout=subprocess.PIPE) as runs:
        chosen = subprocess.run(
            example("barrett_preshape.py"), stdin=runs.stdout, capture_output=True, text=True, check=True
        )
    preshapes = [line.split() for line in chosen.stdout.splitlines()]
    assert preshapes
    for name, *joints in preshapes:
        assert name in ("cylindrical", "spherical", "precision-tip", "hook")
        assert len(joints) == 8
        assert joints[0].startswith("finger_1/prox_joint=")
    assert all(before != after for before, after in pairwise(preshapes))


@slow
def test_replay_recognises_a_recording_as_it_was(bench: Path) -> None:
    live = (*THENAR, "run", "build", "--glove", "{glove}", "--sink", "jsonl:frames", "--frames", "200")
    run(bench, *emulated(*live, "--record", "run.mcap"))
    assert run(bench, *example("replay.py", "build", "run.mcap")).endswith(
        "200 of 200 frames recognised as they were recorded\n"
    )


def test_the_sample_table_is_what_its_script_makes(tmp_path: Path) -> None:
    run(tmp_path, *example("home_glove.py", "made.csv"))
    assert (tmp_path / "made.csv").read_bytes() == TABLE.read_bytes()
    assert TABLE.stat().st_size < 400_000


@slow
def test_the_notebook_runs_and_prints_the_accuracies_of_the_tutorial(tmp_path: Path) -> None:
    page = (EXAMPLES.parent / "docs" / "tutorials" / "your-own-table.md").read_text(encoding="utf-8")
    printed = run(tmp_path, sys.executable, str(NOTEBOOK))
    for composition in ("I", "IV"):
        (rate,) = re.findall(rf"^{composition} +(\S+)%$", printed, re.MULTILINE)
        assert f"{rate} %" in page
    assert "Medium Wrap predicted, Medium Wrap recorded" in printed


def test_jupytext_makes_a_valid_notebook_of_it(tmp_path: Path) -> None:
    made = tmp_path / "made.ipynb"
    run(tmp_path, sys.executable, "-m", "jupytext", "--to", "ipynb", "-o", str(made), str(NOTEBOOK))
    notebook = nbformat.read(made, as_version=4)
    nbformat.validate(notebook)
    code = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    for source in code:
        compile(source, made.name, "exec")
    assert len(code) > 4
    text = NOTEBOOK.read_text(encoding="utf-8")
    assert all(source in text for source in code)


@slow
def test_the_home_made_glove_takes_ten_commands_to_firmware(tmp_path: Path) -> None:
    script = (EXAMPLES / "home_glove.sh").read_text()
    commands = [line for line in script.splitlines() if line.startswith("thenar ")]
    assert len(commands) <= 10
    # Of the table three people's first two trials, three frames each.
    folder = tmp_path / "home_glove"
    folder.mkdir()
    with TABLE.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    few = [row for row in rows if row[0] in ("Ana", "Ben", "Chloe") and row[3] != "3" and int(row[4]) <= 3]
    with (folder / "table.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([header, *few])
    found = tmp_path / "bin"
    found.mkdir()
    (found / "thenar").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m thenar.cli "$@"\n')
    (found / "thenar").chmod(0o755)
    path = f"{found}:{os.environ['PATH']}"
    done = subprocess.run(
        ["sh", str(EXAMPLES / "home_glove.sh")],
        cwd=tmp_path, env={**os.environ, "PATH": path}, capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    grasp_set, build = GraspSet.load(folder / "set.grasps"), Build.load(folder / "build")
    assert (len(grasp_set.taxel_columns), len(grasp_set.joints), len(grasp_set)) == (24, 5, len(few))
    kept = build.manifest.switches
    assert len(kept) == 16
    assert all(switch.threshold is not None for switch in kept)
    lines = (folder / "grasps.jsonl").read_text().splitlines()
    assert len(lines) >= len(few)
    subprocess.run(["make", "-C", str(folder / "firmware-host"), "check"], check=True, capture_output=True)
    assert list((folder / "firmware-avr").glob("*.c"))


@pytest.fixture(scope="module")
def home_glove(tmp_path_factory: pytest.TempPathFactory) -> GraspSet:
    """Return the set that an import of the sample table makes without a word about its columns."""
    folder = tmp_path_factory.mktemp("home")
    run(folder, *THENAR, "import", str(TABLE), "-o", "set.grasps", "--yes")
    return GraspSet.load(folder / "set.grasps")


def test_the_sample_table_imports_as_it_is(home_glove: GraspSet) -> None:
    assert (len(home_glove.element_names), len(home_glove.joints)) == (24, 5)
    assert (home_glove.taxonomy.name, len({*home_glove.grasps.tolist()})) == ("feix33", 8)
    people, things = ({*column.tolist()} for column in (home_glove.subjects, home_glove.objects))
    assert (len(people), len(things)) == (6, 16)
    assert np.bincount(home_glove.trial_ids).tolist() == [8] * (6 * 16 * 3)


def test_folds_that_split_trials_flatter_on_the_sample_table(home_glove: GraspSet) -> None:
    X = StandardScaler().fit_transform(home_glove.codes)
    frames, trials, people = (
        cross_val_score(KNeighborsClassifier(1), X, home_glove.labels, cv=folds, groups=groups).mean()
        for folds, groups in (
            (StratifiedKFold(4, shuffle=True, random_state=1), None),
            (GroupKFold(4), home_glove.trial_ids),
            (GroupKFold(6), home_glove.subjects),
        )
    )
    assert frames > 0.95
    assert max(trials, people) < 0.65

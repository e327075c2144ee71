import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from thenar.compiler import GraspSet
from thenar.runtime import Build

Thenar = Callable[..., subprocess.CompletedProcess[str]]
FORBIDDEN = """
import sys
class Forbidden:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("sklearn", "scipy", "joblib", "matplotlib", "jinja2"):
            raise AssertionError(f"imports {name}")
sys.meta_path.insert(0, Forbidden())
from thenar.cli import run
sys.exit(run(sys.argv[1:]))
"""


def test_every_frame_gives_one_line(thenar: Thenar, small_set: GraspSet, set_file: Path, build_folder: Path) -> None:
    done = thenar("run", build_folder, "--replay", set_file, "--period-us", 500)
    assert done.returncode == 0, done.stderr
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    build = Build.load(build_folder)
    kept = [switch.column for switch in build.manifest.switches]
    frames = zip(small_set.switches[:, kept], small_set.codes, strict=True)
    assert [line["grasp"] for line in lines] == [build.classify(bits, codes) for bits, codes in frames]
    assert [line["time_us"] for line in lines] == list(range(0, 500 * 60, 500))
    assert [line["recorded"] for line in lines] == small_set.grasps.tolist()
    assert list(lines[0]) == ["time_us", "grasp", "probability", "margin", "degraded", "recorded"]
    assert all(1 / 3 <= line["probability"] <= 1 and line["margin"] >= 0 and not line["degraded"] for line in lines)
    correct = sum(line["grasp"] == line["recorded"] for line in lines)
    assert f"{correct} of 60 frames recognised as recorded" in done.stderr


def test_it_runs_with_the_base_dependencies_alone(set_file: Path, build_folder: Path) -> None:
    command = [sys.executable, "-c", FORBIDDEN, "run", str(build_folder), "--replay", str(set_file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 60


def test_a_reader_that_goes_away_leaves_no_traceback(set_file: Path, build_folder: Path) -> None:
    command = [sys.executable, "-m", "thenar.cli", "run", str(build_folder), "--replay", str(set_file)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        complaint = process.stderr.read().decode()
    assert "Traceback" not in complaint
    assert "Error" not in complaint


@pytest.mark.parametrize(
    ("frames", "option", "values"),
    [
        ("--glove", "--period-us", ("500",)),
        ("run.mcap", "--period-us", ("500",)),
        ("run.mcap", "--status", ()),
        ("run.mcap", "--frames", ("3",)),
        ("set.grasps", "--record", ("more.mcap",)),
        ("set.grasps", "--preshape", ("barrett_bh8",)),
        ("set.grasps", "--full-scan", ()),
        ("set.grasps", "--status", ()),
        ("set.grasps", "--lead", ("1",)),
        ("set.grasps", "--error-rate", ("0.1",)),
    ],
)
def test_an_option_that_would_change_nothing_is_refused(
    thenar: Thenar, build_folder: Path, tmp_path: Path, frames: str, option: str, values: tuple[str, ...]
) -> None:
    file = tmp_path / ("glove.toml" if frames == "--glove" else frames)
    file.touch()
    kind = ("--glove",) if frames == "--glove" else ("--replay",)
    given = [str(tmp_path / value) if value.endswith(".mcap") else value for value in values]
    done = thenar("run", build_folder, *kind, file, option, *given)
    assert done.returncode == 2
    assert f"{option} changes nothing" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_sequential_test_takes_no_settings_of_the_hysteresis(
    thenar: Thenar, build_folder: Path, tmp_path: Path
) -> None:
    (tmp_path / "run.mcap").touch()
    done = thenar("run", build_folder, "--replay", tmp_path / "run.mcap", "--error-rate", 0.1, "--dwell-ms", 20)
    assert done.returncode == 2
    assert "--dwell-ms changes nothing beside --error-rate" in done.stderr


def test_a_recording_has_the_ending_that_replay_knows_it_by(thenar: Thenar, build_folder: Path, tmp_path: Path) -> None:
    (tmp_path / "glove.toml").write_text('[cyberglove]\nport = "none"\n')
    done = thenar("run", build_folder, "--glove", tmp_path / "glove.toml", "--record", tmp_path / "run.dat")
    assert done.returncode == 2
    assert "run.dat: a file to write here ends in .mcap" in done.stderr
    assert not (tmp_path / "run.dat").exists()

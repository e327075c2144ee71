import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from thenar.compiler import GraspSet
from thenar.runtime import Build
from thenar.runtime.preshape import PreshapeSelector, load_preshapes
from thenar.runtime.published import LiveGrasp
from thenar.runtime.sinks import GraspLine

from .conftest import refusal, thenar, works
from .test_teach_command import GRIPPER


def test_every_frame_gives_one_line(small_set: GraspSet, set_file: Path, build_folder: Path) -> None:
    done = works("run", build_folder, "--replay", set_file)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    build = Build.load(build_folder)
    kept = [switch.column for switch in build.manifest.switches]
    frames = zip(small_set.switches[:, kept], small_set.codes, strict=True)
    assert [line["grasp"] for line in lines] == [build.classify(bits, codes) for bits, codes in frames]
    assert [line["time_us"] for line in lines] == list(range(0, 10_000 * 60, 10_000))
    assert [line["recorded"] for line in lines] == small_set.grasps.tolist()
    assert list(lines[0]) == ["time_us", "grasp", "probability", "margin", "degraded", "recorded"]
    assert all(1 / 3 <= line["probability"] <= 1 and line["margin"] >= 0 and not line["degraded"] for line in lines)


@pytest.mark.parametrize(
    ("frames", "option", "values"),
    [
        ("run.mcap", "--status", ()),
        ("set.grasps", "--record", ("more.mcap",)),
        ("set.grasps", "--status", ()),
        ("set.grasps", "--lead", ("1",)),
        ("set.grasps", "--lag-ms", ("100",)),
        ("run.mcap", "--web", ()),
        ("set.grasps", "--web", ("127.0.0.1:0",)),
    ],
)
def test_an_option_that_would_change_nothing_is_refused(
    build_folder: Path, tmp_path: Path, frames: str, option: str, values: tuple[str, ...]
) -> None:
    (tmp_path / frames).touch()
    given = [str(tmp_path / value) if value.endswith(".mcap") else value for value in values]
    assert f"{option} has no effect" in refusal("run", build_folder, "--replay", tmp_path / frames, option, *given)


@pytest.fixture
def gripper(tmp_path: Path) -> Path:
    path = tmp_path / "gripper.toml"
    path.write_text(GRIPPER.replace(', "rod"', ""))
    return path


def preshapes_of(gripper: Path, lines: list[dict[str, Any]], period_us: int) -> list[str | None]:
    """Return the names of the preshapes that a live run would give the grasps in these lines."""
    selector = PreshapeSelector(load_preshapes(gripper))
    moments = (
        LiveGrasp(n * period_us, 0, n, line["grasp"], line["grasp"], line["probability"], 0, "ok", None, None, 0)
        for n, line in enumerate(lines)
    )
    found = [selector.update(moment) for moment in moments]
    return [None if shape is None else shape.name for shape in found]


def test_a_replayed_set_takes_sinks_and_preshapes_as_a_live_run_does(
    set_file: Path, build_folder: Path, gripper: Path, tmp_path: Path
) -> None:
    run = ("run", build_folder, "--replay", set_file, "--preshape", gripper, "--frames", 50)
    done = works(*run)
    assert "none for rod: nothing is sent to the hand for those" in done.stderr
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    shapes = [line["preshape"] and line["preshape"]["name"] for line in lines]
    assert shapes == preshapes_of(gripper, lines, 10_000)
    done = thenar(*run, "--sink", f"jsonl:{tmp_path / 'one'}", "--sink", f"jsonl:{tmp_path / 'two'}")
    assert (done.returncode, done.stdout) == (0, "")
    for name in ("one", "two"):
        sent = msgspec.json.Decoder(GraspLine).decode_lines((tmp_path / name).read_bytes())
        assert [line.preshape and line.preshape.name for line in sent] == shapes
        assert [line.grasp for line in sent] == [line["grasp"] for line in lines]


def test_preshapes_follow_the_times_of_the_rows(
    small_set: GraspSet, build_folder: Path, gripper: Path, tmp_path: Path
) -> None:
    held = small_set.rows([*np.repeat(np.flatnonzero(small_set.labels == 0)[:1], 15), *[1] * 15])
    held.save(tmp_path / "held.grasps")
    done = thenar("run", build_folder, "--replay", tmp_path / "held.grasps", "--preshape", gripper)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [line["preshape"] and line["preshape"]["name"] for line in lines] == preshapes_of(gripper, lines, 10_000)
    assert {line["grasp"] for line in lines} == {"cup", "pen"}
    # A hand changes after 100 ms of the same call.
    assert [line["preshape"] is None for line in lines] == [True] * 10 + [False] * 20
    assert [line["preshape"]["name"] for line in lines[10:]] == ["wide"] * 15 + ["narrow"] * 5


def test_a_preshape_table_without_the_builds_grasp_types_is_refused(set_file: Path, build_folder: Path) -> None:
    assert "none of the build's grasp types (cup, pen, rod) is among the table's" in refusal(
        "run", build_folder, "--replay", set_file, "--preshape", "parallel_gripper"
    )

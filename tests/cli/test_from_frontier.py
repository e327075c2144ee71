"""A frontier.json that no thenar wrote, or a point that cannot be built: refused before the training."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from thenar.cli import run
from thenar.compiler import GraspSet
from thenar.compiler.frontier.points import (
    FrontierPoint,
    PlacementChoice,
    frontier_to_bytes,
)
from thenar.compiler.glove.propose import propose_harness
from thenar.runtime.harness.writing import harness_to_toml

Captured = pytest.CaptureFixture[str]
Change = Callable[[FrontierPoint], FrontierPoint]


def _setting(**changes: Any) -> Change:
    return lambda point: replace(point, setting=replace(point.setting, **changes))


@pytest.fixture
def compiled(examples: Any, set_file: Path, tmp_path: Path, capsys: Captured) -> Callable[..., tuple[int, str]]:
    """Return what compiles a point of a frontier of the set: exit code, and what was complained of."""
    grasp_set = GraspSet.load(set_file)

    def compile_point(change: Change, *options: str) -> tuple[int, str]:
        found = examples.example_frontier(fingerprint=grasp_set.fingerprint())
        point = replace(found.points[0], switches=grasp_set.switch_names[:6])
        document = replace(found, points=(change(point),), picked=1)
        (tmp_path / "frontier.json").write_bytes(frontier_to_bytes(document))
        asked = ["compile", str(set_file), "-o", str(tmp_path / "build"), "--from", str(tmp_path / "frontier.json")]
        return run([*asked, "--no-report", "--folds", "0", *options]), " ".join(capsys.readouterr().err.split())

    return compile_point


def test_a_glove_that_the_point_is_not_wired_as_is_named(
    compiled: Callable[..., tuple[int, str]], set_file: Path, tmp_path: Path
) -> None:
    """A point with chips of its own is built for these; the glove says what its ports cost."""
    names = GraspSet.load(set_file).switch_names
    (tmp_path / "glove.toml").write_text(harness_to_toml(propose_harness(names, "pca9555", name="mine")))
    code, complaint = compiled(lambda point: point, "--glove", str(tmp_path / "glove.toml"))
    assert code == 0
    assert "the scan map uses the wiring that point 1 was found with, not" in complaint
    assert compiled(lambda point: point)[1].count("scan map") == 0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (_setting(placement=PlacementChoice("nonsense", 6.0)), "has an unknown method: 'nonsense'"),
        (
            _setting(placement=PlacementChoice("elimination", 0.0)),
            "has 0.0 as its method's parameter: it must be an integer from 1 on",
        ),
        (
            _setting(placement=PlacementChoice("id3", 0.5)),
            "has 0.5 as its method's parameter: it must be an integer from 0 on",
        ),
        (_setting(placement=PlacementChoice("id3", -1.0)), "is not a frontier's"),
        (_setting(clock_hz=0), "has switches without a wiring or its clock"),
        (_setting(clock_hz=1), "runs its mcp23017 at 1 Hz, which it cannot"),
        (_setting(clock_hz=12_000_000), "runs its mcp23017 at 12000000 Hz, which it cannot"),
        (_setting(wiring="nonsense"), "has an unknown wiring: 'nonsense'"),
        (_setting(rounds=0), "is not a frontier's"),
        (_setting(width=99), "is not a frontier's"),
        (_setting(inputs="joints"), "keeps 6 switches for inputs 'joints'"),
        (lambda point: replace(point, switches=("nobody",) * 1), "keeps switches that the recordings do not have"),
        (lambda point: replace(point, switches=point.switches * 2), "keeps a switch twice"),
        (lambda point: replace(point, number=2), "does not number its points 1, 2, 3"),
        (lambda point: replace(point, frame=replace(point.frame, us=1e308)), "is not a frontier's"),
    ],
)
def test_what_cannot_be_built_is_refused_before_the_training(
    compiled: Callable[[Change], tuple[int, str]],
    change: Change,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delattr("thenar.compiler.recogniser.choose_training")
    code, complaint = compiled(change)
    assert (code, said in complaint, "Traceback" in complaint) == (2, True, False), complaint
    assert not (tmp_path / "build").exists()


def test_a_point_that_lists_other_switches_than_its_placement_keeps_is_refused(
    compiled: Callable[[Change], tuple[int, str]], tmp_path: Path
) -> None:
    code, complaint = compiled(lambda point: replace(point, switches=point.switches[1:]))
    assert (code, "lists 5 switches, but its placement keeps 6" in complaint) == (2, True), complaint
    assert not (tmp_path / "build").exists()

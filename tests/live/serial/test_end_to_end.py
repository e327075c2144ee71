from collections.abc import Callable
from pathlib import Path
from time import time_ns
from typing import Any

import pytest
from msgspec.structs import replace

from thenar.runtime.frames import now_us
from thenar.runtime.live.replay import replayed
from thenar.runtime.policy import Policy

MakeRun = Callable[..., Any]

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("inputs", "part"), [("joints", "glove"), ("switches", "board")], ids=["glove", "board"])
def test_what_is_recognised_is_the_offline_classification_frame_by_frame(run: MakeRun, inputs: str, part: str) -> None:
    running = run(inputs, part)
    scene = running.scene
    rows = range(len(scene.truth.performance))
    for row in rows:
        scene.show(row)
        scene.settled(row)
    assert {shown.row for shown in scene.shown} == set(rows)
    assert len({scene.truth.answer(row) for row in rows}) > 5
    assert scene.check() >= len(rows)


def test_a_grasp_comes_with_the_health_of_all_devices(run: MakeRun) -> None:
    health = run("both", "glove", "board").first_health
    assert [device.connected for device in health.devices] == [True, True]


def test_a_recorded_run_replays_to_the_same_grasps_to_the_last_bit(run: MakeRun, tmp_path: Path) -> None:
    running = run("both", "glove", "board", record=tmp_path / "run.mcap")
    for row in range(10):
        running.scene.show(row)
        running.scene.settled(row)
    running.bench.lines[0].unplug()
    running.scene.grasps.wait(lambda grasp: grasp.health != "ok", running.scene.shown[-1].done_us)
    running.end()
    running.recorder.close()
    pairs = list(replayed(running.system.build, tmp_path / "run.mcap", running.system.policy))
    assert [then for then, _ in pairs] == running.scene.grasps.all
    assert all(then == now for then, now in pairs)
    assert len({then.health for then, _ in pairs}) > 1


def test_a_decision_with_hysteresis_follows_every_frame_that_lasts(run: MakeRun) -> None:
    """The usual policy: a change takes its dwell, and then stands."""
    running = run("both", "glove", "board")
    recognizer, taken = replace(running.system, policy=Policy()).recognizer(), list[str]()
    running.end()
    for row in range(5):
        running.scene.show(row)
        taken.append(_decided(running, recognizer, running.scene.shown[-1].done_us + Policy().hold_us))
    assert taken == [running.scene.truth.answer(row) for row in range(5)]


def _decided(running: Any, recognizer: Any, until_us: int) -> str:
    """Return the answer once the hold of the last change must be over."""
    while True:
        taken = running.sources.take()
        grasp = recognizer.step(now_us(), time_ns() // 1000, taken.switches, taken.glove).grasp
        if grasp.time_us > until_us and grasp.health == "ok":
            return str(grasp.grasp)

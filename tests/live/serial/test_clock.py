"""A date that is changed under a run. (The monotonic clock cannot be.)"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from thenar.runtime.live.replay import replayed
from thenar.runtime.recording.reader import Reader

MakeRun = Callable[..., Any]
SetDate = Callable[[float], None]

pytestmark = pytest.mark.slow

YEAR_S = 365 * 86400.0


@pytest.fixture
def step_date(monkeypatch: pytest.MonkeyPatch) -> SetDate:
    """Return what steps the date by seconds, for everything in this process that asks Python for it."""
    real_ns, ahead_s = time.time_ns, [0.0]

    def time_ns() -> int:
        return real_ns() + int(ahead_s[0] * 1e9)

    stepped = {id(time.time): lambda: time_ns() / 1e9, id(real_ns): time_ns}
    ours = [module for name, module in sys.modules.items() if name.startswith(("thenar.", "serial", "smbus2"))]
    for module in (time, *ours):
        for name in [name for name, value in vars(module).items() if id(value) in stepped]:
            monkeypatch.setattr(module, name, stepped[id(getattr(module, name))])

    def step(seconds: float) -> None:
        ahead_s[0] += seconds

    return step


@pytest.mark.parametrize("step_s", [3600.0, -3600.0, -60 * YEAR_S, 1e-3], ids=["later", "earlier", "1960s", "ntp"])
def test_a_date_that_steps_changes_no_answer_no_age_and_no_recording(
    run: MakeRun, step_date: SetDate, tmp_path: Path, step_s: float
) -> None:
    path = tmp_path / "run.mcap"
    running = run("both", "glove", "board", record=path)
    scene = running.scene
    scene.settled(0)
    before = scene.grasps.all[-1]
    step_date(step_s)
    stepped_us = running.now_us()
    for row in (3, 8):
        scene.show(row)
        scene.settled(row)
    since = scene.grasps.since(stepped_us)
    assert abs(since[-1].unix_us - before.unix_us - (since[-1].time_us - before.time_us) - step_s * 1e6) < 50_000
    ages = [age for grasp in since for age in (grasp.switch_age_us, grasp.glove_age_us)]
    assert all(age is not None and 0 <= age < 500_000 for age in ages)
    assert sum(grasp.health == "ok" for grasp in since) > 0.9 * len(since)
    assert scene.check() > 0
    assert set(running.opened()) == {1}
    running.end()
    running.recorder.close()
    assert running.recorder.failure is None
    pairs = list(replayed(running.system.build, path, running.system.policy))
    assert [now.grasp for _, now in pairs] == [then for then, _ in pairs] == scene.grasps.all
    reader = Reader(path)
    assert len(list(reader)) > len(pairs)
    assert not reader.altered

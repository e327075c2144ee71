"""Records that are asked for only where the switches cannot decide: every answer is that of everything read."""

from collections.abc import Callable
from typing import Any

import pytest

pytestmark = pytest.mark.slow
SETTLED_US = 150_000


def test_records_are_asked_for_where_they_matter_and_every_answer_is_the_offline_one(run: Callable[..., Any]) -> None:
    running = run("both", "glove", "scanner", glove='mode = "demand"')
    scene, seen = running.scene, 0
    rows = range(len(scene.truth.performance))
    for row in rows:
        scene.show(row)
        after_us = scene.shown[-1].done_us + SETTLED_US
        # Every further answer is right as well: some rest on switches alone, some on a record of now.
        scene.grasps.wait(lambda grasp, us=after_us: grasp.time_us >= us + SETTLED_US, after_us)
        told = [grasp for grasp in scene.grasps.since(after_us) if grasp.health == "ok"]
        seen += bool(told)
        assert {grasp.candidate for grasp in told} <= {scene.truth.answer(row)}
    assert seen > 0.9 * len(rows)
    assert not running.bench.glove.box.streaming
    assert 0 < running.bench.glove.records < len(scene.grasps.all)

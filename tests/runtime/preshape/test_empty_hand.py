"""Whole movements of a simulated hand, recognised frame by frame: how often a preshape changes on an empty hand."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler import GraspSet, compile_build
from thenar.runtime import Build
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.live.recogniser import LiveRecognizer
from thenar.runtime.preshape import PreshapeSelector, PreshapeTable
from thenar.runtime.published import NONE, LiveGrasp, Preshape
from thenar.simulator.body.cyberglove import SENSORS
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import simulate
from thenar.simulator.playing.performance import of_set

PERIOD_US = 10_000


@pytest.fixture(scope="module")
def sets() -> list[GraspSet]:
    """Return movements of one man, the second time with other noise, objects held otherwise, and other ways to go."""
    scene = load_scene("continuous")
    scenes = [replace(scene, seed=seed, repetitions=2, subjects=scene.subjects[:1]) for seed in (2, 1)]
    return [simulate(each, jobs=1, keep_unsettled=True).grasp_set for each in scenes]


def live(build: Build, grasp_set: GraspSet) -> list[LiveGrasp]:
    played = of_set(grasp_set, PERIOD_US)
    recognizer = LiveRecognizer(
        build,
        sensor_names=SENSORS,
        calibration=played.calibration,
        switch_period_us=PERIOD_US,
        glove_period_us=PERIOD_US,
    )
    columns = [played.switch_names.index(switch.name) for switch in build.manifest.switches]
    found = []
    for row, (bits, sensors) in enumerate(zip(played.switches[:, columns], played.sensors, strict=True)):
        now, closed = row * PERIOD_US, sum(1 << int(number) for number in np.flatnonzero(bits))
        found.append(recognizer.step(now, now, SwitchFrame(now, closed), GloveFrame(now, sensors.tobytes())).grasp)
    return found


def changes(grasps: Sequence[LiveGrasp], truth: Sequence[str], *, segments: bool) -> tuple[int, int]:
    """Return how often the preshape, one of its own for every type, changed while something was held, and while nothing
    was.
    """
    each = {name: Preshape(name, ("a",), (0.0,), 1.0) for name in sorted({*truth} - {NONE})}
    selector, before, counts = PreshapeSelector(PreshapeTable("each", each), segments=segments), None, [0, 0]
    for grasp, held in zip(grasps, truth, strict=True):
        now = selector.update(grasp)
        if now is not None and now is not before:
            counts[held == NONE] += 1
            before = now
    return counts[0], counts[1]


@pytest.mark.slow
def test_an_empty_hand_changes_no_preshape_where_the_build_knows_none(sets: list[GraspSet], tmp_path: Path) -> None:
    trained, played = sets
    truth = played.grasps.tolist()
    found = dict[tuple[str, bool], tuple[int, int]]()
    for name, grasp_set in (("moving", trained), ("static", trained.without_none())):
        build = Build.load(compile_build(grasp_set, tmp_path / name, rounds=60, folds=0).folder)
        grasps = live(build, played)
        found |= {(name, segments): changes(grasps, truth, segments=segments) for segments in (True, False)}
    # Of 28 movements; one who saw no empty hand takes it for a grasp.
    assert found["moving", True][0] >= 8
    assert found["moving", True][1] == 0
    assert found["static", False][1] >= 3

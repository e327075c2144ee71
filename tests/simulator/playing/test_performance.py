from dataclasses import replace

import msgspec
import numpy as np
import pytest

from thenar.compiler import GraspSet
from thenar.runtime.calibration import CodeTables
from thenar.runtime.manifest import Calibration
from thenar.simulator import load_scene, simulate
from thenar.simulator.errors import SceneError
from thenar.simulator.playing.performance import Performance, of_scene, of_set
from thenar.simulator.scenes.scene import Scene


def small(rows: str = "last") -> Scene:
    scene = load_scene("quick")
    recording = msgspec.structs.replace(scene.recording, rows=rows, lead_ms=20.0, hold_ms=60.0)
    return msgspec.structs.replace(scene, repetitions=1, recording=recording)


def codes_of(performance: Performance, grasp_set: GraspSet) -> np.ndarray:
    names = [sensor.name for sensor in performance.calibration.sensors]
    joints = [
        Calibration(n, j.name, j.unit, j.code_a, j.value_a, j.code_b, j.value_b) for n, j in enumerate(grasp_set.joints)
    ]
    tables = CodeTables(joints, names, performance.calibration)
    return np.array([tables.codes(row.tobytes()) for row in performance.sensors], dtype=np.uint16)


def of_subject(grasp_set: GraspSet, subject: str) -> GraspSet:
    return grasp_set.rows(np.flatnonzero(grasp_set.subjects == subject))


@pytest.mark.parametrize("rows", ["last", "all"])
@pytest.mark.parametrize("subject", ["A", "C"])
def test_a_scene_is_played_as_it_is_simulated(rows: str, subject: str) -> None:
    played = of_scene(small(rows), subject, jobs=1)
    simulated = of_subject(simulate(small(rows), 1).grasp_set, subject)
    assert np.array_equal(played.switches, simulated.switches)
    assert played.switch_names == simulated.switch_names
    assert np.array_equal(played.grasps, simulated.grasps)
    assert np.array_equal(codes_of(played, simulated), simulated.codes)
    assert played.calibration.subject == subject
    assert played.period_us == (60_000 if rows == "last" else 10_000)


def test_the_first_subject_is_played_by_default_and_another_must_be_there() -> None:
    assert of_scene(small(), jobs=1).calibration.subject == "A"
    with pytest.raises(SceneError, match=r"has no subject 'Z': its subjects are A, C"):
        of_scene(small(), "Z", jobs=1)


def test_a_set_is_played_in_its_own_codes_with_the_subjects_calibration() -> None:
    performance = of_scene(small(), "A", jobs=1)
    simulated = of_subject(simulate(small(), 1).grasp_set, "A")
    played = of_set(simulated, 5000, performance.calibration)
    assert np.array_equal(codes_of(played, simulated), simulated.codes)
    assert np.array_equal(played.switches, simulated.switches)
    assert played.period_us == 5000


def test_a_code_that_no_byte_gives_is_played_as_the_nearest() -> None:
    simulated = simulate(small(), 1).grasp_set
    played = of_set(simulated, 5000)
    codes = codes_of(played, simulated).astype(int)
    steps = [(s.value_b - s.value_a) / (s.raw_b - s.raw_a) for s in played.calibration.sensors]
    assert np.abs(codes - simulated.codes.astype(int)).max() <= np.ceil(max(steps) / 0.5 / 2)


def test_a_set_of_another_glove_is_refused() -> None:
    simulated = simulate(small(), 1).grasp_set
    joints = tuple(replace(joint, name=f"other_{number}") for number, joint in enumerate(simulated.joints))
    with pytest.raises(SceneError, match="none of the set's joints is a sensor"):
        of_set(replace(simulated, joints=joints), 5000)

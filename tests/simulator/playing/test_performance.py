from dataclasses import replace

import msgspec
import numpy as np
import pytest

from thenar.compiler import GraspSet
from thenar.compiler.recordings.graspset import Joint
from thenar.runtime.calibration import CodeTables
from thenar.runtime.manifest import Calibration
from thenar.runtime.published import NONE
from thenar.simulator import load_scene, simulate
from thenar.simulator.errors import SceneError
from thenar.simulator.playing.performance import Performance, of_scene, of_set, resting
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


def test_a_moving_scene_plays_rests_of_the_stated_length() -> None:
    scene = load_scene("continuous")
    objects = tuple(item for item in scene.objects if item.grasp in ("PoS", "Tip"))
    scene = msgspec.structs.replace(scene, repetitions=1, objects=objects)
    played, faster = (of_scene(scene, jobs=1, period_us=us, rest_us=200_000) for us in (None, 5_000))
    movement = 101 + 30
    assert len(played) % (movement + 20) == 0
    resting = np.arange(len(played)) % (movement + 20) >= movement
    assert (played.grasps[resting] == NONE).all()
    assert not played.switches[resting].any()
    assert faster.period_us == 5_000
    assert len(faster) % (movement + 40) == 0
    own = of_scene(load_scene("continuous-rest").varied(repetitions=1), jobs=1)
    assert {"none", "PoS", "Tip"} < set(own.grasps.tolist())


@pytest.mark.parametrize(("period_us", "frames"), [(None, 4), (100_000, 2), (7_000, 29)])
def test_single_grasps_are_played_with_a_straight_hand_between_them(period_us: int | None, frames: int) -> None:
    plain, rested = of_scene(small(), jobs=1), of_scene(small(), jobs=1, period_us=period_us, rest_us=200_000)
    shape = (len(plain), 1 + frames)
    assert rested.grasps.reshape(shape)[:, 0].tolist() == plain.grasps.tolist()
    assert (rested.grasps.reshape(shape)[:, 1:] == NONE).all()
    assert np.array_equal(rested.switches.reshape(*shape, -1)[:, 0], plain.switches)
    assert not rested.switches.reshape(*shape, -1)[:, 1:].any()
    assert (rested.sensors.reshape(*shape, 18)[:, 1:] == resting(rested.calibration)).all()


def test_whole_movements_rest_after_each_not_within() -> None:
    grasp_set = simulate(small("all"), 1).grasp_set
    played = of_set(grasp_set, 10_000, rest_us=30_000)
    lengths = np.bincount(grasp_set.movement_ids)
    assert len(played) == len(grasp_set) + 3 * len(lengths)
    assert grasp_set.is_none.any()
    for end in np.cumsum(lengths + 3):
        assert (played.grasps[end - 3 : end] == NONE).all()
        assert not played.switches[end - 3 : end].any()
    assert played.grasps[: lengths[0]].tolist() == grasp_set.grasps[: lengths[0]].tolist()


def test_taxels_of_a_hand_at_rest_read_what_means_nothing_on_them() -> None:
    taxel = Joint("t", "N", 100, 0.0, 900, 8.0)
    taxels = np.full((3, 1), 500, np.uint16)
    grasp_set = simulate(small(), 1).grasp_set.rows([0, 1, 2])
    played = of_set(replace(grasp_set, taxels=taxels, taxel_columns=(taxel,)), 10_000, rest_us=10_000)
    assert played.taxels[:, 0].tolist() == [500, 100] * 3


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

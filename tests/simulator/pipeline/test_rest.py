"""The rest between grasps: where the hand lies, when it gets there, and that no other frame notices."""

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler import GraspSet, compile_build
from thenar.runtime import Build
from thenar.runtime.published import NONE
from thenar.simulator.body.cyberglove import USED, sensors_deg
from thenar.simulator.body.hand import LIMITS_DEG, RESTS_DEG
from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import simulate
from thenar.simulator.pipeline.steps import Ledger, compile_pipeline
from thenar.simulator.scenes.scene import ListedEffect, Recording, Scene

from ..small import make_batch, make_condition, make_scene

MOVING = Recording(lead_ms=30.0, hold_ms=250.0, release_ms=40.0, rows="all", rest=True, rest_ms=50.0)
VARIED = [
    ("hand.style", {"sd_deg": 2.0, "habit_sd_deg": 3.0}),
    ("hand.posture", {"sd_deg": 1.5}),
]


def run(scene: Scene, batch: Batch) -> Batch:
    compile_pipeline(scene).run([batch], Ledger())
    return batch


@cache
def whole(name: str, seed: int = 1, **changes: Any) -> GraspSet:
    scene = load_scene(name).varied(seed=seed)
    objects = tuple(item for item in scene.objects if item.grasp in ("PoS", "Tip", "Lat"))
    recording = replace(scene.recording, **changes)
    return simulate(replace(scene, objects=objects, repetitions=2, recording=recording), jobs=1).grasp_set


@pytest.mark.parametrize("rest", ["relaxed", "flat", True])
def test_the_hand_goes_to_its_rest_as_it_came_and_stays(rest: str | bool) -> None:
    recording = replace(MOVING, rest=rest)
    batch = run(make_scene(["hand.transition"], recording=recording), make_batch(range(3)))
    open_deg = sensors_deg(RESTS_DEG["relaxed" if rest is True else str(rest)])
    before, after = batch.sensors_deg[:, batch.frame_us[0] < 0], batch.sensors_deg[:, batch.frame_us[0] > 290_000]
    held = batch.sensors_deg[:, (batch.frame_us[0] >= 0) & (batch.frame_us[0] <= 290_000)]
    assert (held == held[:, :1]).all()
    np.testing.assert_array_equal(before[:, 0], np.tile(open_deg, (3, 1)))
    np.testing.assert_allclose(after[:, :3], before[:, ::-1], atol=1e-9)
    assert after.shape[1] == 3 + 5
    np.testing.assert_array_equal(after[:, 2:], np.tile(open_deg, (3, 6, 1)))


def test_rests_vary_and_join_consecutive_trials() -> None:
    scene = make_scene([*VARIED, "hand.transition"], recording=MOVING)
    batch = make_batch(range(400))
    batch.trials = np.arange(400)
    run(scene, batch)
    assert batch.rest_deg is not None
    np.testing.assert_array_equal(batch.rest_deg[:-1], batch.previous_deg[1:])
    assert batch.rest_deg.std(axis=0) == pytest.approx(1.5, abs=0.25)
    # Another grasp of the same subject comes from the same rests; another subject has other ones.
    alike = make_batch(range(400), make_condition("A", "Tip"))
    other = make_batch(range(400), make_condition("B"))
    alike.trials = other.trials = batch.trials
    assert np.array_equal(np.asarray(run(scene, alike).rest_deg), batch.rest_deg)
    means = [np.asarray(one.rest_deg).mean(axis=0) for one in (batch, run(scene, other))]
    assert 1.5 < np.std(means[0] - means[1]) / np.sqrt(2) < 6.0
    assert (batch.rest_deg >= LIMITS_DEG[:, 0]).all()
    assert (batch.rest_deg <= LIMITS_DEG[:, 1]).all()


@pytest.mark.parametrize("name", ["continuous", "faulty-glove"])
def test_a_rest_changes_no_draw_of_any_other_frame(name: str) -> None:
    """Nor does it change a switch before; only the joints of the way to the grasp come from elsewhere."""
    scene = load_scene(name)
    moving = {"lead_ms": 300.0, "hold_ms": 500.0, "release_ms": 200.0}
    if name == "faulty-glove":
        transition = dict(load_scene("continuous").effects)["hand.transition"]
        scene = replace(scene, effects=(*scene.effects, ListedEffect("hand.transition", transition)))
    objects = tuple(item for item in scene.objects if item.grasp in ("PoS", "Tip"))
    scene = replace(scene, objects=objects, repetitions=2, recording=replace(scene.recording, **moving))
    plain = simulate(scene, jobs=1).grasp_set
    rested = simulate(scene.varied(rest="flat"), jobs=1).grasp_set
    frames, all_frames = 101, 101 + 80
    kept = rested.rows((np.arange(len(rested)) % all_frames) < frames)
    assert len(kept) == len(plain)
    assert kept.grasps.tolist() == plain.grasps.tolist()
    assert np.array_equal(kept.switches, plain.switches)
    contact = np.arange(len(plain)) % frames >= 32
    assert np.array_equal(kept.codes[contact], plain.codes[contact])
    assert (np.diff(rested.times_us[rested.subjects == "A"]) >= 0).all()


def test_a_movement_is_one_and_none_outside_the_hold() -> None:
    made = whole("continuous-rest")
    frames = np.arange(len(made)) % 181
    assert made.is_none[(frames < 30) | (frames > 101)].all()
    assert not made.is_none[(frames > 31) & (frames <= 80)].any()
    assert not made.switches[made.is_none].any()
    assert np.array_equal(made.movement_ids, np.arange(len(made)) // 181)
    resting = made.rows(frames >= 131)
    assert resting.is_none.all()
    one = made.subjects == "A"
    assert made.times_us[one][::181] == pytest.approx(1_810_000 * np.arange(one.sum() / 181), abs=2000)


def test_a_flat_hand_reads_nought_and_closes_nothing() -> None:
    made = whole("continuous-rest", rest="flat")
    flat = made.rows(np.arange(len(made)) % 181 >= 131)
    angles = np.column_stack([joint.value(flat.codes[:, n]) for n, joint in enumerate(flat.joints)])
    away = angles.mean(axis=0) - sensors_deg(np.zeros(20))[:USED]
    noise = dict(dict(load_scene("continuous").effects)["joint.noise"])
    assert np.abs(away).max() < noise["trial_sd_deg"]
    assert not flat.switches.any()
    assert flat.is_none.all()


@pytest.mark.slow
@pytest.mark.parametrize("inputs", ["switches", "joints", "both"])
@pytest.mark.parametrize("trained", ["continuous", "continuous-rest"])
def test_a_flat_hand_that_no_build_has_seen_is_none(trained: str, inputs: str, tmp_path: Path) -> None:
    compile_build(whole(trained), tmp_path / "build", rounds=40, folds=0, jobs=1, inputs=inputs)
    build, made = Build.load(tmp_path / "build"), whole("continuous-rest", rest="flat", seed=2)
    flat = made.rows(np.arange(len(made)) % 181 >= 131)
    switches = flat.switches[:, [flat.switch_names.index(switch.name) for switch in build.manifest.switches]]
    codes = flat.codes[:, [flat.joint_names.index(joint.name) for joint in build.manifest.joints]]
    found = [build.classify(*frame) for frame in zip(switches, codes, strict=True)]
    assert found.count(NONE) >= 0.99 * len(flat)


@pytest.mark.parametrize(
    ("recording", "effect", "lacks"),
    [
        (replace(MOVING, rows="last"), "hand.transition", 'rows = "all"'),
        (replace(MOVING, lead_ms=0.0), "hand.transition", "a lead_ms"),
        (replace(MOVING, release_ms=0.0), "hand.transition", "a release_ms"),
        (MOVING, "hand.grip", "the effect [effects.hand.transition]"),
    ],
)
def test_a_rest_that_nothing_would_show_is_refused(recording: Recording, effect: str, lacks: str) -> None:
    with pytest.raises(SceneError, match=rf"^recording\.rest: .* the scene needs {re.escape(lacks)}$"):
        compile_pipeline(make_scene([effect], recording=recording))

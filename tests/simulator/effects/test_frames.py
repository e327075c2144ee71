"""Frames at even steps of the force of initial contact, and late ones."""

import numpy as np
import pytest

from thenar.simulator.effects.frame_jitter import prepare
from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.effect import SceneSetting, frame_times
from thenar.simulator.pipeline.steps import Ledger, compile_pipeline
from thenar.simulator.scenes.scene import Recording, SceneGlove

from ..small import make_batch, make_draw, make_scene, make_setting

PRESSED = Recording(rows="all", rate_hz=20.0, hold_ms=300.0)  # seven frames


def simulated(*effects: str) -> Batch:
    batch = make_batch(range(4))
    scene = make_scene(list(effects), recording=PRESSED, glove=SceneGlove(taxels="all"))
    compile_pipeline(scene).run([batch], Ledger())
    return batch


def test_the_hardest_pressed_place_bears_even_steps_of_force() -> None:
    batch = simulated("contact.ramp", "frame.at_force")
    hardest = batch.taxels_n.max(axis=2)
    assert batch.forces_n.max(axis=1).min() > 1.0
    np.testing.assert_allclose(hardest[:, :-1], np.tile(np.arange(6) / 5, (4, 1)), atol=1e-3)
    np.testing.assert_array_equal(hardest[:, -1], batch.forces_n.max(axis=1))
    assert (np.diff(batch.frame_us, axis=1) >= 0).all()


def test_without_a_ramp_frames_stay_where_they_are() -> None:
    batch = simulated("frame.at_force")
    np.testing.assert_array_equal(batch.frame_us[0], 50_000 * np.arange(7))


def test_frames_before_contact_and_after_release_stay() -> None:
    recording = Recording(rows="all", rate_hz=20.0, lead_ms=100.0, hold_ms=300.0, release_ms=50.0)
    batch = make_batch(range(2))
    compile_pipeline(make_scene(["contact.ramp", "frame.at_force"], recording=recording)).run([batch], Ledger())
    assert (batch.frame_us[:, [0, 1, 2, 8, 9]] == [-100_000, -50_000, 0, 300_000, 350_000]).all()
    assert ((batch.frame_us[:, 3:8] > 0) & (batch.frame_us[:, 3:8] < 300_000)).all()


def test_fewer_than_three_frames_of_contact_are_refused() -> None:
    with pytest.raises(SceneError, match=r"^effects\.frame\.at_force: needs three frames"):
        compile_pipeline(make_scene(["frame.at_force"], recording=Recording(hold_ms=60.0, rate_hz=20.0)))


def jittered(setting: SceneSetting, sd_us: float, rows: range) -> np.ndarray:
    batch = make_batch(rows)
    batch.frame_us = np.tile(frame_times(setting), (len(batch), 1))
    prepare(setting, sd_us=sd_us)(batch, make_draw("frame.jitter", batch))
    return batch.frame_us


@pytest.mark.parametrize("sd_us", [100.0, 5_000.0, 100_000.0])
def test_frames_keep_their_order_however_late(sd_us: float) -> None:
    times = jittered(make_setting(timed=True), sd_us, range(50))
    assert (np.diff(times, axis=1) >= 0).all()


def test_frames_stray_as_much_as_said() -> None:
    setting = make_setting(timed=True)
    late = jittered(setting, 300.0, range(400)) - frame_times(setting)
    assert abs(late.mean()) < 10.0
    assert abs(late.std() - 300.0) < 10.0

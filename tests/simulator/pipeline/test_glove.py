"""What the glove does in every scene, step by step, against what its definition says of each element."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.simulator.body.cyberglove import SubjectCalibration, sensors_deg
from thenar.simulator.pipeline import glove
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.effect import SceneSetting, frame_times
from thenar.simulator.pipeline.ramp import NEVER

from ..small import make_batch, make_draw, make_setting

FORCES = arrays(np.float64, (2, 5), elements=st.sampled_from([0.0, 0.999, 1.0, 1.001, 4.0]))


def take(name: str, batch: Batch, setting: SceneSetting) -> None:
    """Take a batch through one of the glove's own steps, which draws nothing."""
    draw = make_draw(name, batch)
    (effect,) = (step for step in glove.STEPS if step.name == name)
    assert effect.prepare is not None
    effect.prepare(setting)(batch, draw)
    assert not draw.draws


def test_recall_takes_what_was_planned_for_every_repetition() -> None:
    batch = make_batch(range(3))
    take("glove.recall", batch, make_setting())
    held = batch.condition.held
    np.testing.assert_array_equal(batch.posture_deg, [held.posture_deg] * 3)
    np.testing.assert_array_equal(batch.pose, [held.pose] * 3)
    assert batch.grip_n.tolist() == [held.grip_n] * 3
    batch.posture_deg[0] += 1.0
    assert batch.posture_deg[1, 0] == held.posture_deg[0]


@given(forces=FORCES, released=st.booleans())
def test_switches_close_above_threshold_and_open_after_the_row(forces: np.ndarray, released: bool) -> None:
    batch, setting = make_batch(range(2)), make_setting(threshold_n=1.0, release_us=40_000 if released else 0)
    batch.forces_n = forces
    take("glove.threshold", batch, setting)
    assert batch.thresholds_n.tolist() == [1.0] * 5
    take("glove.close", batch, setting)
    closed = forces > 1.0
    assert ((batch.on_us == 0) == closed).all()
    assert ((batch.on_us == NEVER) == ~closed).all()
    assert (batch.off_us[~closed] == NEVER).all()
    assert (batch.off_us[closed] == (setting.hold_us + setting.period_us if released else NEVER)).all()


@pytest.mark.parametrize("timed", [False, True])
def test_frames_are_those_configured_with_equal_sensing(timed: bool) -> None:
    batch, setting = make_batch(range(3)), make_setting(timed=timed)
    take("glove.recall", batch, setting)
    take("glove.frames", batch, setting)
    np.testing.assert_array_equal(batch.frame_us, [frame_times(setting)] * 3)
    take("glove.sense", batch, setting)
    assert batch.sensors_deg.shape == (*batch.frame_us.shape, 18)
    assert (batch.sensors_deg == sensors_deg(batch.posture_deg)[:, None]).all()


def test_bytes_are_those_of_the_subjects_calibration() -> None:
    batch, setting = make_batch(range(2)), make_setting()
    batch.sensors_deg = np.linspace(-200.0, 200.0, 2 * 3 * 18).reshape(2, 3, 18)
    take("glove.encode", batch, setting)
    expected = SubjectCalibration.of_subject(setting.seed, batch.condition.subject).bytes(batch.sensors_deg)
    np.testing.assert_array_equal(batch.raw, expected)
    assert batch.raw.min() == 1
    assert batch.raw.max() == 255


TIMES = st.sampled_from([-5, 0, 3, 10, 11, NEVER])


@given(
    on=arrays(np.int64, (2, 3), elements=TIMES),
    off=arrays(np.int64, (2, 3), elements=TIMES),
    frames=arrays(np.int64, (2, 4), elements=st.integers(-20, 20)),
    delay=st.none() | arrays(np.int64, (3,), elements=st.integers(0, 9)) | st.just(np.zeros((2, 4, 3), dtype=np.int64)),
)
def test_a_bit_is_read_between_closing_and_opening_when_its_turn_comes(
    on: np.ndarray, off: np.ndarray, frames: np.ndarray, delay: np.ndarray | None
) -> None:
    batch = make_batch(range(2))
    batch.on_us, batch.off_us, batch.frame_us, batch.delay_us = on, off, frames, delay
    take("glove.sample", batch, make_setting())
    late = np.zeros((2, 4, 3), dtype=np.int64) if delay is None else np.broadcast_to(delay, (2, 4, 3))
    for row, frame, switch in np.ndindex(2, 4, 3):
        at = int(frames[row, frame]) + int(late[row, frame, switch])
        assert batch.bits[row, frame, switch] == (on[row, switch] <= at < off[row, switch])

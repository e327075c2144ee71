import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.body.cyberglove import sensors_deg
from thenar.simulator.body.hand import DOF, LIMITS_DEG
from thenar.simulator.effects.hand_transition import path, prepare
from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.effect import SceneSetting

from ..small import make_batch, make_draw, make_setting

SEEDS, OPENINGS = st.integers(0, 2**32), st.floats(0.0, 90.0)
ABDUCTIONS = [name.endswith("abduction") for name in DOF]


def postures(seed: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    first, last = random.uniform(LIMITS_DEG[:, 0], LIMITS_DEG[:, 1], (2, 3, 20))
    return first, last


@given(SEEDS, OPENINGS)
def test_the_way_starts_at_the_posture_before_and_ends_at_the_grasp(seed: int, opening_deg: float) -> None:
    first, last = postures(seed)
    ends = path(first, last, np.tile([0.0, 1.0], (3, 1)), opening_deg)
    assert np.array_equal(ends[:, 0], first)
    assert np.array_equal(ends[:, 1], last)


@given(SEEDS, OPENINGS)
def test_the_hand_stands_still_at_both_ends(seed: int, opening_deg: float) -> None:
    """No velocity: within a share d of the way it moves by less than a multiple of d cubed."""
    first, last = postures(seed)
    d = 1e-3
    near = path(first, last, np.tile([d, 1.0 - d], (3, 1)), opening_deg)
    far = np.abs(last - first).max() + 400.0 * opening_deg
    assert np.abs(near[:, 0] - first).max() <= 10.5 * d**3 * far
    assert np.abs(near[:, 1] - last).max() <= 10.5 * d**3 * far


@given(SEEDS, OPENINGS)
def test_joints_open_on_the_way_no_further_than_they_can(seed: int, opening_deg: float) -> None:
    first, last = postures(seed)
    way = np.tile(np.linspace(0.0, 1.0, 60), (3, 1))
    straight, opened = path(first, last, way, 0.0), path(first, last, way, opening_deg)
    assert (opened <= straight + 1e-9).all()
    assert (opened >= LIMITS_DEG[:, 0] - 1e-9).all()
    assert (straight - opened <= opening_deg + 1e-9).all()
    assert np.array_equal(opened[..., ABDUCTIONS], straight[..., ABDUCTIONS])


def test_the_hand_is_open_widest_at_two_thirds_of_the_way() -> None:
    bent = np.full((1, 20), 60.0)
    way = np.linspace(0.0, 1.0, 301)[None]
    index = path(bent, bent, way, 20.0)[0, :, DOF.index("index_mcp")]
    assert index.argmin() == 200
    assert index.min() == pytest.approx(40.0)


def test_without_opening_it_is_the_minimum_jerk_path() -> None:
    """Of all ways from rest to rest that one's third derivative is a parabola: its sixth derivative is nought."""
    t = np.linspace(0.0, 1.0, 15)[None]
    angles = path(np.zeros((1, 20)), np.full((1, 20), 30.0), t, 0.0)[0, :, 0]
    assert np.abs(np.diff(angles, 6)).max() < 1e-9
    assert np.abs(np.diff(angles, 5)).min() > 1e-3
    assert angles[7] == pytest.approx(15.0)


def moved(setting: SceneSetting, frame_us: np.ndarray, rows: range) -> tuple:
    batch, random = make_batch(rows), np.random.default_rng(1)
    every = random.uniform(0.0, 60.0, (100, 2, 20))
    batch.previous_deg, batch.posture_deg = every[batch.repetitions, 0], every[batch.repetitions, 1]
    batch.frame_us = frame_us
    batch.sensors_deg = settled = np.repeat(sensors_deg(batch.posture_deg)[:, None], frame_us.shape[1], axis=1)
    prepare(setting)(batch, make_draw("hand.transition", batch))
    return batch, settled


def test_sensors_move_before_contact_and_only_then() -> None:
    frame_us = np.array([[-40_000, -30_000, -10_000, 0, 10_000], [-30_000, -20_000, 5, 10, 20]])
    batch, settled = moved(make_setting(timed=True, first_us=-30_000), frame_us, range(2))
    before = sensors_deg(batch.previous_deg)
    assert np.array_equal(batch.sensors_deg[0, :2], [before[0], before[0]])
    assert np.array_equal(batch.sensors_deg[1, 0], before[1])
    assert np.array_equal(batch.sensors_deg[frame_us >= 0], settled[frame_us >= 0])
    assert (batch.sensors_deg[0, 2] != settled[0, 2]).any()


def test_a_scene_without_time_before_contact_is_refused() -> None:
    with pytest.raises(SceneError, match=r"hand\.transition: there is no frame before contact.*lead_ms"):
        prepare(make_setting(timed=True, first_us=0))

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.contact.model import Contact, Load
from thenar.simulator.effects.contact_ramp import prepare
from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.ramp import NEVER, crossings

from ..small import make_batch, make_draw, make_setting

RISE_US, HOLD_US, LETS_GO_US = 100_000, 250_000, 260_000


@dataclass(frozen=True)
class Press:
    """A contact model whose forces (n, s) are a function of the grip (n, 1); it does not settle below a grip."""

    forces: Callable[[np.ndarray], np.ndarray]
    settles_n: float = 0.0

    def __call__(self, loads: Sequence[Load]) -> list[Contact]:
        return [self._solve(load.posture_deg, load.pose, load.grip_n) for load in loads]

    def _solve(self, posture_deg: np.ndarray, pose: np.ndarray, grip_n: np.ndarray) -> Contact:
        n = np.zeros(len(grip_n))
        settled = grip_n >= self.settles_n
        forces = self.forces(grip_n[:, None] + 0.0 * posture_deg[:, :1] + 0.0 * pose[:, :1])
        return Contact(posture_deg, pose, forces, np.zeros((len(n), 20)), n, settled, grip_n, 30 * grip_n, 3 * len(n))


def ramped(model: Press, levels: int = 10, release_us: int = 200_000) -> Batch:
    """Return a batch of grips of 10 and 20 N on switches that close at 1 N."""
    batch: Batch = make_batch(range(2))
    batch.commanded_deg, batch.commanded_pose = np.zeros((2, 20)), np.zeros((2, 6))
    batch.grip_n = np.array([10.0, 20.0])
    batch.forces_n = model.forces(batch.grip_n[:, None])
    batch.settled = np.ones(2, dtype=np.bool_)
    batch.residual_n, batch.residual_nmm = np.full(2, 0.25), np.full(2, 7.5)
    batch.thresholds_n = np.ones(batch.forces_n.shape[1])
    closed = batch.forces_n > 1.0
    batch.on_us = np.where(closed, 0, NEVER)
    batch.off_us = np.where(closed, LETS_GO_US, NEVER) if release_us else np.full_like(batch.on_us, NEVER)
    setting = make_setting(timed=True, hold_us=HOLD_US, release_us=release_us)
    prepare(setting, model, rise_ms=100.0, levels=levels)([batch], [make_draw("contact.ramp", batch)])
    return batch


def test_what_was_solved_on_the_way_is_counted() -> None:
    """Two hands at four levels below the full grip, three steps each."""
    batch, draw = ramped(Press(lambda grip: grip)), make_draw("contact.ramp", make_batch(range(2)))
    prepare(make_setting(), Press(lambda grip: grip), levels=5)([batch], [draw])
    assert draw.draws == {"grips solved": 8, "solver steps": 24}


def test_a_switch_closes_when_the_growing_force_passes_its_threshold() -> None:
    """Forces of 0.05, 0.25 and 1 times the grip: 1 N is reached at 20, 4 and 1 N of 10 and 20 N."""
    batch = ramped(Press(lambda grip: grip * np.array([0.05, 0.25, 1.0])))
    assert batch.on_us.tolist() == [[NEVER, 40_000, 10_000], [NEVER, 20_000, 5_000]]


def test_release_is_the_mirror_image() -> None:
    batch = ramped(Press(lambda grip: grip * np.array([0.05, 0.25, 1.0])))
    assert batch.off_us.tolist() == [[NEVER, LETS_GO_US + 60_000, LETS_GO_US + 90_000], [NEVER, 340_000, 355_000]]
    batch = ramped(Press(lambda grip: grip * np.array([0.05, 0.25, 1.0])), release_us=0)
    assert (batch.off_us == NEVER).all()


def test_a_switch_that_is_pressed_only_in_passing_closes_and_opens() -> None:
    """It bears the grip up to 5 N and then less: 10 N less the grip."""
    batch = ramped(Press(lambda grip: np.maximum(np.minimum(grip, 10.0 - grip), 0.0)))
    assert batch.on_us.tolist() == [[10_000], [5_000]]
    assert batch.off_us.tolist() == [[90_000], [45_000]]


@pytest.mark.parametrize("levels", [1, 2, 7])
def test_the_model_is_solved_at_all_levels_but_the_full_one(levels: int) -> None:
    grips: list[np.ndarray] = []

    def forces(grip: np.ndarray) -> np.ndarray:
        grips.append(grip[:, 0] / [10.0, 20.0])
        return grip

    ramped(Press(forces), levels)
    solved = grips[1:]  # the first call made the forces at full grip
    assert np.allclose(solved, [[level / levels] * 2 for level in range(1, levels)])


def test_what_does_not_settle_on_the_way_is_marked() -> None:
    batch = ramped(Press(lambda grip: grip, settles_n=1.5))
    assert batch.settled.tolist() == [False, True]
    # What was left at 1 N, where the first gave up; the second keeps what was left at its full grip.
    assert (batch.residual_n.tolist(), batch.residual_nmm.tolist()) == ([1.0, 0.25], [30.0, 7.5])


@given(st.integers(0, 2**32), st.integers(1, 12))
def test_at_every_level_switches_are_as_their_forces_say_unless_they_flicker(seed: int, levels: int) -> None:
    random = np.random.default_rng(seed)
    forces = np.concatenate([np.zeros((1, 2, 30)), random.uniform(0.0, 2.0, (levels, 2, 30))])
    thresholds = random.uniform(0.5, 1.5, 30)
    on, off = crossings(forces, thresholds, 1000.0)
    closed = forces > thresholds
    at = 1000 * np.arange(levels + 1)[:, None, None]
    reads = (on <= at) & (at < off)
    changes = np.count_nonzero(np.diff(closed, axis=0), axis=0)
    plain = changes <= np.where(closed[-1], 1, 2)
    assert np.array_equal(reads[:, plain], closed[:, plain])
    assert np.array_equal(reads[-1], closed[-1])
    assert (reads >= closed).all()


@given(st.integers(0, 2**32))
def test_forces_that_hardly_change_overflow_nothing(seed: int) -> None:
    draw = np.random.default_rng(seed)
    forces = draw.choice([0.0, 5e-324, 1e-310, 1e-300, 0.5, 2.0], (5, 2, 30))
    forces[0] = 0.0
    on, off = crossings(forces, np.full(30, 1.0), 1000.0)
    closed = forces > 1.0
    assert np.array_equal(on != NEVER, closed.any(axis=0))
    assert np.array_equal(off != NEVER, closed.any(axis=0) & ~closed[-1])
    first = closed.argmax(axis=0)
    ever = closed.any(axis=0)
    assert ((1000 * (first - 1) <= on) & (on <= 1000 * first))[ever].all()


def test_what_is_closed_from_the_first_level_on_closes_at_once() -> None:
    on, off = crossings(np.array([[[2.0]], [[1.0]], [[0.0]]]), np.array([0.5]), 1000.0)
    assert (on.tolist(), off.tolist()) == ([[0]], [[1500]])


def test_a_row_read_before_the_full_grip_is_refused() -> None:
    with pytest.raises(SceneError, match=r"contact\.ramp: .* rise_ms = 300 is longer than recording\.hold_ms = 250"):
        prepare(make_setting(hold_us=250_000), Press(lambda grip: grip), rise_ms=300.0)

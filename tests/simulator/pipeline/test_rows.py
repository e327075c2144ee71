from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.taxonomy import published
from thenar.simulator.body.condition import Condition
from thenar.simulator.body.cyberglove import common_joints
from thenar.simulator.body.layout import murakami160
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.effect import SceneSetting
from thenar.simulator.pipeline.ramp import NEVER, Ramp
from thenar.simulator.pipeline.report import Codes, Rows, grasp_set, joined, rows_of

from ..small import make_batch, make_condition, make_setting

SWITCHES = tuple(patch.name for patch in murakami160())
FRAMES, HELD = 4, 2
# Frames before contact, at contact, at read-out, and when the hand has let go.
FRAME_US = np.array([-10_000, 0, 10_000, 20_000])

Recorded = tuple[Condition, Batch, Codes]


@pytest.fixture(scope="module")
def recorded() -> list[Recorded]:
    """Return three conditions of two subjects, six repetitions of four frames each, with random bits and codes."""
    random = np.random.default_rng(5)
    found = []
    conditions = [
        make_condition("B", "PoS", "bar"),
        make_condition("B", "Tip", "pin"),
        make_condition("A", "PoS", "bar"),
    ]
    for number, condition in enumerate(conditions):
        batch = make_batch(range(6), condition)
        # The two conditions of the first subject share its session.
        batch.trials = random.permutation(6) * 2 + number % 2
        batch.bits = random.random((6, FRAMES, 160)) < 0.2
        batch.frame_us = np.tile(FRAME_US, (6, 1))
        found.append((condition, batch, random.integers(0, 1000, (6, FRAMES, 16)).astype(np.uint16)))
    return found


def part_of(batch: Batch, codes: Codes, pick: slice) -> tuple[Batch, Codes]:
    part = make_batch(batch.repetitions[pick], batch.condition)
    for name in ("trials", "bits", "frame_us"):
        setattr(part, name, getattr(batch, name)[pick])
    return part, codes[pick]


def make(**changes: object) -> SceneSetting:
    """Return the setting of these frames, in which the fields of `changes` differ."""
    times = {"timed": True, "first_us": -10_000, "hold_us": 10_000, "release_us": 10_000}
    return make_setting(**(times | changes))


def blocks_of(recorded: list[Recorded], size: int, setting: SceneSetting) -> list[Rows]:
    blocks = []
    for number, (_, whole, all_codes) in enumerate(recorded):
        for first in range(0, len(whole), size):
            batch, codes = part_of(whole, all_codes, slice(first, first + size))
            everyone = np.arange(len(batch))
            blocks.append(rows_of(batch, everyone, number, codes, setting))
    return blocks


def set_of(rows: Rows, recorded: list[Recorded]) -> GraspSet:
    conditions = [condition for condition, _, _ in recorded]
    return grasp_set(
        rows, conditions, SWITCHES, (), common_joints(), published("kamakura14"), "scene small", timed=True
    )


SUBJECTS = np.array([0, 0, 1])


@settings(max_examples=30, deadline=None)
@given(size=st.integers(1, 6), order=st.randoms(use_true_random=False), every_frame=st.booleans())
def test_rows_do_not_depend_on_blocks_or_order(
    size: int, order: Random, every_frame: bool, recorded: list[Recorded]
) -> None:
    whole = joined(blocks_of(recorded, 6, make(every_frame=every_frame)), SUBJECTS)
    blocks = blocks_of(recorded, size, make(every_frame=every_frame))
    order.shuffle(blocks)
    assert set_of(joined(blocks, SUBJECTS), recorded).fingerprint() == set_of(whole, recorded).fingerprint()


def test_rows_stand_by_subject_then_trial_then_frame(recorded: list[Recorded]) -> None:
    made = set_of(joined(blocks_of(recorded, 4, make(every_frame=True)), SUBJECTS), recorded)
    assert made.subjects.tolist() == ["B"] * 48 + ["A"] * 24
    assert made.trials[:48].tolist() == np.repeat(np.arange(12), FRAMES).tolist()
    for condition, batch, codes in recorded:
        for repetition, trial in enumerate(batch.trials):
            own = np.flatnonzero((made.subjects == condition.subject) & (made.trials == trial))
            np.testing.assert_array_equal(made.switches[own], batch.bits[repetition])
            np.testing.assert_array_equal(made.codes[own], codes[repetition])
            assert made.grasps[own].tolist() == ["none", condition.grasp, condition.grasp, "none"]
            assert made.times_us[own].tolist() == [10_000 * (FRAMES * trial + frame) for frame in range(FRAMES)]
            assert len(set(made.movement_ids[own])) == 1
            assert set(made.objects[own]) == {condition.thing.name}


def test_one_row_a_repetition_is_the_frame_that_is_read_out(recorded: list[Recorded]) -> None:
    rows = joined(blocks_of(recorded, 6, make()), SUBJECTS)
    made = set_of(rows, recorded)
    assert rows.read_out.all()
    _, batch, codes = recorded[2]
    order = np.argsort(batch.trials)
    np.testing.assert_array_equal(made.switches[12:], batch.bits[order, HELD])
    np.testing.assert_array_equal(made.codes[12:], codes[order, HELD])


def test_a_clock_never_goes_back_and_begins_at_nought(recorded: list[Recorded]) -> None:
    blocks = blocks_of(recorded, 6, make(every_frame=True))
    for block in blocks:
        block.time_us[:] -= np.tile([25_000, 0, 0, 0], len(block) // FRAMES)
    made = set_of(joined(blocks, SUBJECTS), recorded)
    for subject in "AB":
        clock = made.times_us[made.subjects == subject]
        assert clock[0] == 0
        assert (np.diff(clock) >= 0).all()


def test_a_grasp_is_held_until_its_first_pressure_ends() -> None:
    batch = make_batch(range(3))
    batch.frame_us = np.tile(FRAME_US, (3, 1))
    assert batch.holds(15_000).tolist() == [[False, True, True, False]] * 3
    batch.on_us = np.full((3, 160), NEVER)
    batch.on_us[0, 7], batch.on_us[1, 9] = 2_999, 3_000
    batch.ramp = Ramp(np.zeros((2, 3, 160)), 8_000.0)
    late, early, never = batch.holds(15_000).tolist()
    assert late == [False, True, True, True]
    assert early == never == [False, True, True, False]
    assert batch.holds(None).tolist() == [[False, True, True, True]] * 3


def test_a_batch_of_which_nothing_is_kept_has_no_rows(recorded: list[Recorded]) -> None:
    _, batch, codes = recorded[0]
    rows = rows_of(batch, np.array([], dtype=np.intp), 0, codes, make(every_frame=True))
    assert len(rows) == 0
    assert rows.bits.shape == (0, 20)
    assert len(joined([rows], SUBJECTS)) == 0

import numpy as np
import pytest

from thenar.compiler.firmware.probes import Probes, extreme_frames, random_frames, turns
from thenar.runtime.tables import IntegerTables

ALL_OPEN, ALL_CLOSED = (False,) * 5, (True,) * 5


def tables(*thresholds: list[int], switches: int = 5) -> IntegerTables:
    """Return tables of zeros for two grasp types."""
    joints = tuple(np.array(each, np.uint16) for each in thresholds)
    return IntegerTables(
        bias=np.zeros(2, np.int16),
        switch_rows=np.zeros((switches, 2), np.int16),
        thresholds=joints,
        joint_rows=tuple(np.zeros((len(each) + 1, 2), np.int16) for each in joints),
        switch_means=np.zeros((switches, 2), np.int16),
        joint_means=np.zeros((len(joints), 2), np.int16),
        scale=1.0,
    )


def as_set(frames: Probes) -> set[tuple[tuple[bool, ...], tuple[int, ...]]]:
    return set(zip(map(tuple, frames.bits.tolist()), map(tuple, frames.codes.tolist()), strict=True))


def test_turning_codes_are_both_sides_of_thresholds_and_the_ends() -> None:
    assert turns(tables([3, 4, 90]), 0).tolist() == [0, 3, 4, 5, 90, 91, 255]
    assert turns(tables([0, 254]), 0).tolist() == [0, 1, 254, 255]
    assert turns(tables([]), 0).tolist() == [0, 255]
    assert turns(tables([3], [300]), 0).tolist() == [0, 3, 4, 65535]
    assert turns(tables([65535]), 0).tolist() == [0, 65535]


def test_extreme_frames_isolate_every_switch_and_every_code() -> None:
    held = tables([3, 90], [7])
    frames = extreme_frames(held)
    found = as_set(frames)
    assert len(frames) == 4 * (5 + 1) + 2 * (6 + 4)
    for one in range(5):
        alone = tuple(number == one for number in range(5))
        others = tuple(number != one for number in range(5))
        assert {(bits, (code,) * 2) for bits in (alone, others) for code in (0, 255)} <= found
    assert {(bits, (code,) * 2) for bits in (ALL_OPEN, ALL_CLOSED) for code in (0, 255)} <= found
    assert {(ALL_OPEN, (code, 0)) for code in (0, 3, 4, 90, 91, 255)} <= found
    assert {(ALL_CLOSED, (code, 255)) for code in (0, 3, 4, 90, 91, 255)} <= found
    assert {(ALL_OPEN, (0, code)) for code in (0, 7, 8, 255)} <= found
    assert {(ALL_CLOSED, (255, code)) for code in (0, 7, 8, 255)} <= found


@pytest.mark.parametrize("seed", [0, 1])
def test_seeded_random_frames_meet_every_side_of_every_threshold(seed: int) -> None:
    held = tables([3, 90, 91], [200])
    frames = random_frames(held, 1000, seed)
    assert (frames.bits.shape, frames.codes.shape) == ((1000, 5), (1000, 2))
    assert as_set(frames) == as_set(random_frames(held, 1000, seed)) != as_set(random_frames(held, 1000, seed + 2))
    assert {(3, 200), (90, 201), (4, 0), (91, 255)} <= set(map(tuple, frames.codes.tolist()))
    assert len(set(frames.codes[:, 0].tolist())) > 200
    assert {ALL_OPEN, ALL_CLOSED} <= set(map(tuple, frames.bits.tolist()))
    assert len(set(map(tuple, frames.bits.tolist()))) == 32

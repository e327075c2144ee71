"""The stated error rate, beside the rate that simulation finds; and what correlated frames do to it."""

import math

import numpy as np
import pytest

from thenar.runtime.live.decision import Ranking, SequentialTest

SCALE = 200.0
FOREVER = 10**12
FRAME_US = 10_000


def scores(random: np.random.Generator, true: int, classes: int, distance: float, frames: int) -> np.ndarray:
    """Scores of frames whose log-likelihood ratios are known: x ~ N(distance e_true, 1), F_k = distance x_k.

    log f_k(x) - log f_j(x) = distance (x_k - x_j), exactly, so these are what a calibrated ensemble would give.
    """
    x = random.normal(size=(frames, classes))
    x[:, true] += distance
    return np.rint(SCALE * distance * x).astype(int) + 32768


def run(test: SequentialTest, lanes: np.ndarray) -> tuple[int | None, int]:
    """Feed frames until the first decision; return it and how many frames it took."""
    for number, row in enumerate(lanes.tolist()):
        found = test.update(number * FRAME_US, Ranking(tuple(row)))
        if found is not None:
            return found, number + 1
    return None, len(lanes)


def wrong_share(classes: int, error_rate: float, runs: int, repeat: int = 1, spacing_us: int = 0) -> float:
    """Share of tests that end wrong; every frame comes `repeat` times, as from a hand that rests."""
    random, wrong = np.random.default_rng(11), 0
    for number in range(runs):
        true = number % classes
        lanes = np.repeat(scores(random, true, classes, 0.7, 150), repeat, axis=0)
        found, _ = run(SequentialTest(classes, SCALE, error_rate, FOREVER, spacing_us), lanes)
        assert found is not None
        wrong += found != true
    return wrong / runs


@pytest.mark.parametrize(("classes", "error_rate"), [(2, 0.1), (2, 0.02), (5, 0.1), (14, 0.1)])
def test_it_errs_no_more_often_than_stated(classes: int, error_rate: float) -> None:
    runs = 1500
    found = wrong_share(classes, error_rate, runs)
    assert found <= error_rate + 3 * math.sqrt(error_rate * (1 - error_rate) / runs)


def test_the_threshold_is_not_needlessly_high_for_two_types() -> None:
    """Wald's threshold errs less often than stated only by how far the last frame carries beyond it."""
    assert wrong_share(2, 0.2, 1500) > 0.2 / 3


def test_frames_that_repeat_themselves_are_not_evidence_and_spacing_leaves_them_out() -> None:
    alike = wrong_share(5, 0.02, 800, repeat=8)
    spaced = wrong_share(5, 0.02, 800, repeat=8, spacing_us=8 * FRAME_US)
    assert alike > 3 * 0.02
    assert spaced <= 0.02 + 3 * math.sqrt(0.02 * 0.98 / 800)


def test_it_decides_at_the_threshold_and_not_one_step_below() -> None:
    threshold = math.ceil(SCALE * math.log(2 / 0.1))
    assert SequentialTest(3, SCALE, 0.1, FOREVER).threshold == threshold
    assert SequentialTest(3, SCALE, 0.1, FOREVER).update(0, Ranking((threshold, 0, 0))) == 0
    assert SequentialTest(3, SCALE, 0.1, FOREVER).update(0, Ranking((threshold, 1, 0))) is None


def test_an_answer_stands_until_the_next_or_until_its_time_is_over() -> None:
    test = SequentialTest(2, 1.0, 0.1, 100)
    assert test.update(0, Ranking((50, 0))) == 0
    assert test.update(40, Ranking((0, 0))) == 0
    assert test.update(60, Ranking((0, 50))) == 1
    assert test.update(160, Ranking((0, 0))) == 1
    assert test.update(161, Ranking((0, 0))) is None


def test_evidence_that_is_too_old_is_dropped() -> None:
    test = SequentialTest(2, 1.0, 0.1, 100)
    assert test.update(0, Ranking((2, 0))) is None
    assert test.update(101, Ranking((2, 0))) is None
    assert test.update(201, Ranking((2, 0))) == 0


def test_a_frame_that_is_seen_twice_counts_once() -> None:
    test = SequentialTest(2, 1.0, 0.1, FOREVER)
    assert [test.update(5, Ranking((2, 0))) for _ in range(9)] == [None] * 9
    assert test.update(6, Ranking((2, 0))) == 0


def test_frames_nearer_than_the_spacing_do_not_count() -> None:
    test = SequentialTest(2, 1.0, 0.1, FOREVER, spacing_us=30)
    assert [test.update(time_us, Ranking((2, 0))) for time_us in (0, 10, 29)] == [None] * 3
    assert test.update(30, Ranking((2, 0))) == 0


def test_forgetting_drops_the_answer_and_the_evidence() -> None:
    test = SequentialTest(2, 1.0, 0.1, FOREVER)
    test.update(0, Ranking((50, 0)))
    test.update(1, Ranking((2, 0)))
    test.forget()
    assert test.held is None
    assert test.update(1, Ranking((2, 0))) is None
    assert test.update(2, Ranking((2, 0))) == 0


FOR_0, FOR_1 = (2, 0), (0, 2)


def follow(frames: list[tuple[int, tuple[int, int], bool]]) -> list[int | None]:
    """Return what two frames in agreement decide on, for up to 100 us, after each frame, whole or not."""
    test = SequentialTest(2, 1.0, 0.1, 100)
    return [test.update(time_us, Ranking(scores), whole=whole) for time_us, scores, whole in frames]


def test_degraded_frames_end_no_test_during_a_whole_answer() -> None:
    whole = [(0, FOR_0, True), (10, FOR_0, True)]
    lost = [(time_us, FOR_1, False) for time_us in (20, 110, 111, 112)]
    assert follow(whole + lost) == [None, 0, 0, 0, None, 1]


def test_degraded_frames_are_ignored_during_tests_of_whole_frames() -> None:
    frames = [(0, FOR_0, True), (10, FOR_1, False), (20, FOR_1, False), (30, FOR_0, True)]
    assert follow(frames) == [None, None, None, 0]


def test_an_expired_test_of_whole_frames_admits_degraded_ones() -> None:
    frames = [(0, FOR_0, True), (100, FOR_1, False), (101, FOR_1, False), (102, FOR_1, False)]
    assert follow(frames) == [None, None, None, 1]


def test_a_whole_frame_drops_answer_and_evidence_of_frames_with_lost_inputs() -> None:
    answered = [(0, FOR_1, False), (10, FOR_1, False), (20, FOR_1, False)]
    assert follow([*answered, (30, FOR_0, True), (40, FOR_0, True)]) == [None, 1, 1, None, 0]
    assert follow([*answered, (30, FOR_1, True), (40, FOR_1, True)]) == [None, 1, 1, None, 1]

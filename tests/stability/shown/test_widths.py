from itertools import pairwise

import pytest

from thenar.stability.shown.figures import Width, widths


@pytest.fixture(scope="module")
def found() -> list[Width]:
    return widths(full=False)


def test_every_width_from_4_to_16_bits_is_there(found: list[Width]) -> None:
    assert [width.bits for width in found] == list(range(4, 17))


def test_no_width_is_off_by_more_than_its_bound_which_a_bit_more_halves(found: list[Width]) -> None:
    for width in found:
        assert 0 < width.worst <= width.bound
        assert width.worst == pytest.approx(width.worst_steps / width.scale)
    for coarse, fine in pairwise(found[4:]):
        assert fine.bound / coarse.bound == pytest.approx(0.5, rel=0.05)


def test_16_bits_keep_every_answer_and_4_bits_do_not(found: list[Width]) -> None:
    assert found[-1].kept == found[-1].total
    assert found[-1].correct == found[-1].correct_ensemble
    assert found[0].kept < 0.9 * found[0].total
    assert found[0].rate < found[-1].rate


def test_the_picture_is_the_same_every_time(found: list[Width]) -> None:
    assert widths(full=False) == found

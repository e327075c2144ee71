import numpy as np
import pytest

from thenar.compiler.placement import PlacementError
from thenar.compiler.placement.tree import check_bits, check_matrix, grow_id3


@pytest.mark.parametrize(
    ("X", "reason"),
    [
        ([[0, 1], [2, -3]], "X holds -3 in row 1, column 1"),
        ([[0.0, np.nan]], "X holds nan in row 0, column 1"),
        ([[0.0], [1.5]], "X holds 1.5 in row 1, column 0"),
        ([[np.inf]], "X holds inf in row 0, column 0"),
        ([0, 1], "X has 1 dimensions"),
        ([["a"]], "X holds <U1"),
    ],
)
def test_what_is_no_matrix_of_whole_numbers_is_refused_where_it_is(X: object, reason: str) -> None:
    with pytest.raises(PlacementError, match=reason):
        grow_id3(np.array(X), [0] * len(np.array(X)))


@pytest.mark.parametrize(
    ("y", "reason"),
    [
        ([0], r"y has shape \(1,\), one label for each of the 2 rows"),
        ([0.0, np.nan], "y is nan in row 1"),
        ([0.0, -np.inf], "y is -inf in row 1"),
        (np.array([1.0, np.nan], object), "y is nan in row 1"),
        (np.array([1, "a"], dtype=object), "cannot be sorted"),
    ],
)
def test_labels_that_do_not_fit_are_refused(y: object, reason: str) -> None:
    with pytest.raises(PlacementError, match=reason):
        grow_id3([[0], [1]], np.asarray(y))


def test_no_rows_and_a_negative_number_of_samples_are_refused() -> None:
    with pytest.raises(PlacementError, match="there are no rows"):
        grow_id3(np.zeros((0, 3), bool), [])
    with pytest.raises(PlacementError, match="min_samples is -1"):
        grow_id3([[0]], [0], min_samples=-1)


def test_whole_floats_are_taken_as_whole_numbers() -> None:
    assert check_matrix([[0.0, 7.0]]).tolist() == [[0, 7]]


def test_a_two_among_bits_is_refused_where_it_is() -> None:
    with pytest.raises(PlacementError, match="X holds 2 in row 1, column 0: neither 0 nor 1"):
        check_bits([[0], [2]])

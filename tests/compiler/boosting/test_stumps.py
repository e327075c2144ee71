import numpy as np
import pytest

from thenar.compiler.trainers.stumps import Stumps
from thenar.runtime.model.tables import TIE, winners


def test_scores_within_a_billionth_are_a_tie_that_the_lowest_number_wins() -> None:
    scores = np.array([[1.0, 1.0 + 5e-10, 0.0], [1.0, 1.0 + 2e-9, 0.0], [0.0, 1.0, 1.0], [-5.0, -7.0, -5.0 + 9e-10]])
    assert winners(scores).tolist() == [0, 1, 1, 0]


def test_scores_exactly_a_billionth_apart_are_still_a_tie() -> None:
    assert winners(np.array([[-TIE, 0.0], [np.nextafter(-TIE, -1.0), 0.0]])).tolist() == [0, 1]


@pytest.mark.parametrize("shape", [(5, 3), (5, 5), (4,), (5, 4, 1)])
def test_inputs_of_another_shape_are_not_scored(shape: tuple[int, ...]) -> None:
    stumps = Stumps(4, np.zeros((1, 2), np.int32), np.zeros((1, 2)), np.zeros((1, 2, 3)), 1.0)
    with pytest.raises(ValueError, match="the ensemble expects"):
        stumps.scores(np.zeros(shape))


@pytest.mark.parametrize("thresholds", [1, 3])
def test_arrays_of_rounds_that_do_not_agree_are_not_scored(thresholds: int) -> None:
    stumps = Stumps(4, np.zeros((2, 2), np.int32), np.zeros((thresholds, 2)), np.zeros((2, 2, 3)), 1.0)
    with pytest.raises(ValueError, match="zip"):
        stumps.scores(np.zeros((5, 4)))

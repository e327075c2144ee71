import numpy as np

from thenar.compiler.boosting.stumps import winners


def test_scores_within_a_billionth_are_a_tie_that_the_lowest_number_wins() -> None:
    scores = np.array([[1.0, 1.0 + 5e-10, 0.0], [1.0, 1.0 + 2e-9, 0.0], [0.0, 1.0, 1.0], [-5.0, -7.0, -5.0 + 9e-10]])
    assert winners(scores).tolist() == [0, 1, 1, 0]

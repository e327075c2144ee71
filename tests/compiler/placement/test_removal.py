import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.placement.removal import removal_rises

Floats = npt.NDArray[np.float64]


def loss(scores: Floats, labels: npt.NDArray[np.intp]) -> float:
    return float(np.log(np.exp(scores).sum(axis=1)).sum() - scores[np.arange(len(labels)), labels].sum())


@given(st.integers(0, 2**32 - 1), st.integers(1, 30), st.integers(1, 5), st.integers(1, 4))
def test_a_rise_is_that_of_the_loss_with_the_mean_row_in_place(seed: int, n: int, s: int, classes: int) -> None:
    random = np.random.default_rng(seed)
    bits, rows = random.random((s, n)) < 0.5, random.normal(0, 2, (s, classes))
    labels, scores = random.integers(0, classes, n), random.normal(0, 3, (n, classes))
    shares = np.exp(scores)
    rises = removal_rises((shares / shares.sum(axis=1, keepdims=True)).T, bits, rows, labels)
    for bit, row, rise in zip(bits, rows, rises, strict=True):
        without = scores - np.outer(bit, row) + bit.mean() * row
        np.testing.assert_allclose(rise, loss(without, labels) - loss(scores, labels), rtol=1e-9, atol=1e-8)

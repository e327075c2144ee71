import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.placement.counts import Counter, Digits
from thenar.compiler.placement.inputs import PlacementError


def random_inputs(seed: int, n: int, radices: list[int]) -> npt.NDArray[np.int64]:
    random = np.random.default_rng(seed)
    return np.stack([random.integers(0, radix, n) * (1 + column % 3) for column, radix in enumerate(radices)], axis=1)


def check_counts(X: npt.NDArray[np.int64], rows: npt.NDArray[np.intp], seed: int) -> None:
    """Compare the cells of `rows` with a direct count, and the codes with the values."""
    labels = np.random.default_rng(seed).integers(0, 4, len(X))
    digits = Digits.from_matrix(X)
    counter = Counter(digits, labels, 4)
    cells = counter.count(rows)
    stops = np.append(counter.starts[1:], cells.shape[1])
    for position, column in enumerate(digits.columns.tolist()):
        values = digits.values[position]
        assert np.array_equal(values[digits.codes(position, rows)], X[rows, column])
        for cell, value in zip(range(counter.starts[position], stops[position]), values[1:], strict=True):
            wanted = np.bincount(labels[rows][X[rows, column] == value], minlength=4)
            assert cells[:, cell].tolist() == wanted.tolist()


@given(st.integers(0, 99), st.integers(1, 60), st.lists(st.sampled_from([1, 2, 3, 5, 16, 17, 300]), max_size=12))
def test_cells_are_the_direct_counts(seed: int, n: int, radices: list[int]) -> None:
    X = random_inputs(seed, n, radices) if radices else np.zeros((n, 0), dtype=np.int64)
    check_counts(X, np.flatnonzero(np.random.default_rng(seed).random(n) < 0.7), seed)


@pytest.mark.parametrize("n", [1500, 1501, 70_000])
def test_many_rows_are_counted_as_few_are(n: int) -> None:
    check_counts(random_inputs(1, n, [2, 2, 3, 7, 16, 40, 2]), np.arange(n), 2)


def test_packed_bits_of_another_width_are_refused() -> None:
    with pytest.raises(PlacementError, match=r"9 bits a row are \(n, 2\) uint8, not \(4, 1\)"):
        Digits.from_packed_bits(np.zeros((4, 1), np.uint8), 9)

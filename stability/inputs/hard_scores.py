"""Scores that are hard to make shares of: equal, a hair apart, and so far apart that a share underflows."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def hard_scores(rng: np.random.Generator, n: int) -> Iterator[Floats]:
    """Yield scores (K, columns) of 2 to 33 classes: equal, a hair apart, 1e4 apart, and of every size between."""
    for number in range(n):
        classes = int(rng.choice([2, 3, 5, 14, 33]))
        size = 10.0 ** float(rng.uniform(-16, 4))
        scores = rng.normal(0, size, (classes, 6))
        scores[:, 0] = 1e4 * (number % 2)
        scores[:, 1] = 1.0 + np.spacing(1.0) * rng.integers(0, 2, classes)
        scores[:, 2] = np.where(np.arange(classes) == number % classes, 1e4, -1e4)
        scores[:, 3] = np.linspace(-746, 0, classes)
        yield scores

"""Weights, responses and columns that are hard to fit a stump to."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Problem:
    """One class's round: inputs X (n, d), weights w (n,) and weighted responses w z (n,), and what is hard about it."""

    name: str
    X: Floats
    weights: Floats
    responses: Floats


def problems(rng: np.random.Generator, n: int, z_max: float) -> Iterator[Problem]:
    """Yield n problems of every kind, 5 to 80 rows of 2 to 6 columns each."""
    for _ in range(n):
        for kind in (_ordinary, _decades, _settled, _clamped, _one_heavy, _light_branch, _subnormal):
            rows = int(rng.integers(5, 80))
            X = columns(rng, rows)[:, : int(rng.integers(2, 7))]
            weights, ratios = kind(rng, rows, z_max)
            yield Problem(kind.__name__.strip("_").replace("_", " "), X, weights, weights * ratios)


def neighbours(rng: np.random.Generator, n: int) -> Iterator[list[float]]:
    """Yield ascending values: next to nothing, the largest, doubles next to each other, 16-bit codes."""
    largest, least = float(np.finfo(np.float64).max), 5e-324
    yield from ([0.0, least, 2 * least, 3 * least], [-least, least], [-largest, largest])
    yield [float(np.nextafter(largest, 0)), largest]
    for _ in range(n):
        one = np.ldexp(rng.uniform(0.5, 1), rng.integers(-1073, 1022))
        yield (one + np.spacing(one) * np.arange(4)).tolist()
        yield np.unique(rng.integers(0, 1 << 16, 9)).astype(np.float64).tolist()


def columns(rng: np.random.Generator, n: int) -> Floats:
    """Return inputs (n, 6), n >= 2: codes, a switch and its opposite, numbers one double apart, one that is missing."""
    codes, switch = rng.integers(0, 256, n).astype(np.float64), rng.integers(0, 2, n).astype(np.float64)
    codes[:2] = 0, 255
    close = 1.0 + np.spacing(1.0) * rng.integers(0, 3, n)
    lacking = np.where(rng.random(n) < 0.2, np.nan, codes)
    return np.column_stack([codes, switch, close, 1.0 - switch, lacking, np.arange(n)])


def tied(rng: np.random.Generator, z_max: float) -> Problem:
    """Return a problem in which the first row has exactly what the next two have together, in columns of all orders."""
    weights, ratios = rng.random(40), np.full(40, -1.7)
    weights[1:3] = weights[0] / 2
    ratios[:3] = rng.choice([1.9, z_max])
    responses = weights * ratios
    responses[1:3] = responses[0] / 2
    one, two = np.arange(40) == 0, np.isin(np.arange(40), (1, 2))
    either = 1.0 + one - two  # one at 2, two at 0: the first split takes two off, the second one
    inputs = [one, two, 1.0 - one, either, 2.0 - either, rng.integers(0, 2, 40)]
    order = rng.permutation(len(inputs))
    return Problem(f"columns in order {order.tolist()}", np.column_stack(inputs)[:, order], weights, responses)


def _ratios(rng: np.random.Generator, n: int, z_max: float) -> Floats:
    return rng.choice([-1.0, 1.0], n) * rng.uniform(1.0, z_max, n)


def _ordinary(rng: np.random.Generator, n: int, z_max: float) -> tuple[Floats, Floats]:
    return rng.random(n), _ratios(rng, n, z_max)


def _decades(rng: np.random.Generator, n: int, z_max: float) -> tuple[Floats, Floats]:
    return np.power(10.0, rng.uniform(-300, 0, n)), _ratios(rng, n, z_max)


def _settled(rng: np.random.Generator, n: int, z_max: float) -> tuple[Floats, Floats]:
    return np.ldexp(1.0, -rng.integers(30, 53, n)), rng.choice([-1.0, 1.0], n)


def _clamped(rng: np.random.Generator, n: int, z_max: float) -> tuple[Floats, Floats]:
    return np.full(n, 1 / z_max), rng.choice([-z_max, z_max], n)


def _one_heavy(rng: np.random.Generator, n: int, z_max: float) -> tuple[Floats, Floats]:
    return np.where(np.arange(n) == n // 2, 1.0, rng.random(n) * 2.0**-52), _ratios(rng, n, z_max)


def _light_branch(rng: np.random.Generator, n: int, z_max: float) -> tuple[Floats, Floats]:
    """Most rows of some 2^-38 of the weight, where a branch is next to being taken for empty, and of opposite sign."""
    light = np.arange(n) >= 3
    return np.where(light, 2.0**-38 * rng.uniform(0.25, 4, n) / n, 1.0), np.where(light, -z_max, 1.0)


def _subnormal(rng: np.random.Generator, n: int, z_max: float) -> tuple[Floats, Floats]:
    return np.ldexp(rng.integers(0, 1000, n).astype(np.float64), -1074), rng.choice([-1.0, 1.0, z_max], n)

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from thenar.compiler.model.collapse import collapse
from thenar.compiler.model.compare import Comparison, compare, float_slack
from thenar.compiler.trainers.stumps import Stumps
from thenar.runtime.model.quantise import quantise, rounding_error
from thenar.runtime.model.tables import ScoreTables, winners

from .conftest import make_rows, make_stumps


@pytest.fixture
def sound() -> Comparison:
    return Comparison(
        collapse_difference=1e-13,
        collapse_bound=1e-12,
        integer_difference=4.9,
        integer_bound=5.0,
        slack=1e-9,
        safe_margin=10.0,
        trained=np.array([0, 1, 2]),
        deployed=np.array([0, 1, 1]),
        margins=np.array([50.0, 11.0, 3.0]),
        covered=np.array([True, True, False]),
    )


def test_a_change_of_class_within_the_safe_margin_is_allowed(sound: Comparison) -> None:
    assert sound.holds
    assert sound.changed.tolist() == [2]


def test_a_comparison_fails_beyond_bounds_or_on_changed_safe_rows(sound: Comparison) -> None:
    assert not replace(sound, collapse_difference=1.1e-12).holds
    assert not replace(sound, integer_difference=5.0 + 2e-9).holds
    assert replace(sound, integer_difference=5.0 + 1e-9).holds
    assert not replace(sound, deployed=np.array([0, 2, 1])).holds


def test_the_ensembles_ties_are_its_own() -> None:
    stumps, (bits, codes) = make_stumps(1, shrinkage=1e-10), make_rows(1)
    found = compare(stumps, quantise(collapse(stumps, 6), bits, codes), bits, codes)
    scores = stumps.scores(np.hstack([bits, codes]))
    assert np.array_equal(found.trained, winners(scores))
    assert not np.array_equal(found.trained, scores.argmax(axis=1))


@pytest.mark.parametrize("size", [1.0, 1e3, 1e6, 1e9, 1e12])
def test_the_slack_covers_what_doubles_lose_where_large_rows_cancel(size: float) -> None:
    random = np.random.default_rng(5)
    rows = tuple(random.normal(0, 1e-3, (2, 3)) - size for _ in range(3))
    tables = ScoreTables.of(np.full(3, 3 * size), np.zeros((6, 3)), (np.array([99], np.uint16),) * 3, rows)
    bits, codes = make_rows()
    integers = quantise(tables, bits, codes)
    slack, errors = float_slack(tables, integers.scale), []
    for frame in codes > 99:
        exact = [sum(map(Fraction, column)) for column in np.stack([tables.bias, *_at(rows, frame)]).T.tolist()]
        whole = np.sum([integers.bias, *_at(integers.joint_rows, frame)], axis=0, dtype=int).tolist()
        errors += [abs(x * Fraction(integers.scale) - n) for x, n in zip(exact, whole, strict=True)]
        floats = tables.scores(bits[:1], np.where(frame, 100, 0).astype(np.uint16)[np.newaxis])[0] * integers.scale
        assert np.abs(floats - whole).max() <= rounding_error(tables, integers.scale) + slack
    assert max(errors) <= rounding_error(tables, integers.scale) + slack
    # Once that is more than the rounding to steps, the slack is no more than a hundred times what is lost.
    assert size < 1e12 or max(errors) > slack / 100


def _at(rows: tuple[np.ndarray, ...], right: np.ndarray) -> list[np.ndarray]:
    return [of[int(bin_)] for of, bin_ in zip(rows, right, strict=True)]


@pytest.mark.parametrize("classes", [2, 3, 5])
def test_a_margin_is_the_lead_of_the_best_over_the_second(classes: int) -> None:
    stumps, (bits, codes) = make_stumps(2, classes=classes), make_rows(2)
    integers = quantise(collapse(stumps, 6), bits, codes)
    steps = collapse(stumps, 6).scores(bits, codes) * integers.scale
    for margin, row in zip(compare(stumps, integers, bits, codes).margins, steps.tolist(), strict=True):
        best, second, *_ = sorted(row, reverse=True)
        assert margin == best - second


def test_a_margin_within_the_slack_is_not_covered() -> None:
    # What a joint adds to a class in every bin, a switch takes away: large rows of which small scores are left.
    random, (bits, codes) = np.random.default_rng(6), make_rows(6, n=400, switches=6, joints=3)
    columns, values = random.integers(0, 9, (40, 3)), random.normal(0, 1e-3, (40, 3, 3))
    columns[:2], values[0], values[1] = [[6], [0]], [[3e9], [-1e9], [2e9]], [[-3e9], [1e9], [-2e9]]
    stumps = Stumps(9, columns.astype(np.int32), np.where(columns < 6, 0.5, 130.0), values, 1.0)
    found = compare(stumps, quantise(collapse(stumps, 6), bits, codes), bits, codes)
    edge = 2 * (found.integer_bound + found.slack)
    assert found.slack > 1
    assert ((2 * (found.integer_bound - found.slack) < found.margins) & (found.margins <= edge)).any()
    assert np.array_equal(found.covered, found.margins > edge)


def test_progress_is_told_every_thousand_rows() -> None:
    stumps, (bits, codes) = make_stumps(2), make_rows(2, n=2001)
    told: list[tuple[int, int]] = []
    compare(stumps, quantise(collapse(stumps, 6), bits, codes), bits, codes, lambda *done: told.append(done))
    assert told == [(1000, 2001), (2000, 2001)]

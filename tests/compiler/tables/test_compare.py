from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from thenar.compiler.boosting.stumps import Stumps, winners
from thenar.compiler.tables.collapse import collapse
from thenar.compiler.tables.compare import Comparison, compare
from thenar.compiler.tables.quantise import quantise

MakeStumps = Callable[..., Stumps]
MakeRows = Callable[..., tuple[np.ndarray, np.ndarray]]


@pytest.fixture
def sound() -> Comparison:
    return Comparison(
        collapse_difference=1e-13,
        collapse_bound=1e-12,
        integer_difference=4.9,
        integer_bound=5.0,
        safe_margin=10.0,
        trained=np.array([0, 1, 2]),
        deployed=np.array([0, 1, 1]),
        margins=np.array([50.0, 11.0, 3.0]),
        covered=np.array([True, True, False]),
    )


def test_a_change_of_class_within_the_safe_margin_is_allowed(sound: Comparison) -> None:
    assert sound.holds
    assert sound.changed.tolist() == [2]


def test_nothing_holds_if_float_tables_stray_from_the_ensemble(sound: Comparison) -> None:
    assert not replace(sound, collapse_difference=1.1e-12).holds


def test_nothing_holds_if_integers_stray_beyond_the_rounding(sound: Comparison) -> None:
    assert not replace(sound, integer_difference=5.001).holds


def test_nothing_holds_if_a_safe_row_changes_class(sound: Comparison) -> None:
    assert not replace(sound, deployed=np.array([0, 2, 1])).holds


def test_the_ensembles_ties_are_its_own(make_stumps: MakeStumps, make_rows: MakeRows) -> None:
    stumps, (bits, codes) = make_stumps(1, shrinkage=1e-10), make_rows(1)
    found = compare(stumps, quantise(collapse(stumps, 6), bits, codes), bits, codes)
    scores = stumps.scores(np.hstack([bits, codes]))
    assert np.array_equal(found.trained, winners(scores))
    assert not np.array_equal(found.trained, scores.argmax(axis=1))

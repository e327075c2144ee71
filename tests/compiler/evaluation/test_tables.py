import numpy as np
import pytest

from thenar.compiler.evaluation.fits import Fit
from thenar.compiler.evaluation.folds import Fold
from thenar.compiler.evaluation.plan import CellPlan, RowPlan, TablePlan
from thenar.compiler.evaluation.populations import Population
from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.evaluation.tables import Reader

# Six rows of labels 2 and 5 (others do not occur), two folds, two repeats of the same folds; switches are columns 0..2.
LABELS = np.array([2, 2, 2, 5, 5, 5])
FOLDS = (Fold(np.arange(3, 6), np.arange(3), "1"), Fold(np.arange(3), np.arange(3, 6), "2"))
PART = Population("A", np.arange(6), (2, 5), (FOLDS, FOLDS))
FIRST = tuple(Fit(fold, (0, 1, 7), (2, 5)) for fold in FOLDS)
SECOND = tuple(Fit(fold, columns, (2, 5)) for fold, columns in zip(FOLDS, [(0, 1, 2), ()], strict=True))
ANSWERS = {
    FIRST[0]: np.array([2, 2, 5]),
    FIRST[1]: np.array([5, 5, 5]),
    SECOND[0]: np.array([2, 2, 2]),
    SECOND[1]: np.array([2, 2, 5]),
}
READER = Reader(LABELS, (2, 5), 3, ANSWERS, frozenset({SECOND[1]}))
CELL = CellPlan(PART, (FIRST, SECOND))


def test_a_repeat_counts_what_all_its_folds_recognised() -> None:
    assert (READER.cell(CELL, confusing=False).rate.correct, READER.cell(CELL, confusing=False).rate.total) == (
        (5, 4),
        6,
    )


def test_the_confusion_matrix_adds_up_the_repeats_true_types_in_rows() -> None:
    assert READER.cell(CELL, confusing=True).confusion == ((5, 1), (2, 4))


def test_switches_are_counted_without_the_joints_and_fits_without_inputs_are_told() -> None:
    cell = READER.cell(CELL, confusing=False)
    assert (cell.switches.least, cell.switches.most) == (0, 3)
    assert cell.switches.mean == pytest.approx(7 / 4)
    assert cell.no_inputs == 1


def test_more_runs_than_repeats_are_draws_with_a_range_of_their_own() -> None:
    cell = READER.cell(CellPlan(PART, (FIRST, FIRST, SECOND, SECOND)), confusing=False)
    assert cell.draws is not None
    assert (cell.draws.least, cell.draws.most) == pytest.approx((4 / 6, 5 / 6))
    assert cell.rate == Rate.of((5, 5, 4, 4), 6, repeats_a_draw=2)
    assert READER.cell(CELL, confusing=False).draws is None
    assert READER.cell(CELL, confusing=False).rate == Rate.of((5, 4), 6)


def test_a_row_averages_its_subjects_and_only_compositions_carry_confusions() -> None:
    row = RowPlan("VI", "Sel-Co", (CellPlan(PART, (FIRST, FIRST)), CellPlan(PART, (SECOND, SECOND))))
    table = READER.table(TablePlan("pruning", "paper", (row,)))
    assert table.columns == ("A", "A")
    assert table.rows[0].average.mean == pytest.approx((5 / 6 + 4 / 6) / 2)
    assert (table.rows[0].switches.least, table.rows[0].switches.most) == (0, 3)
    assert table.rows[0].cells[0].confusion is None
    assert READER.table(TablePlan("compositions", "paper", (row,))).rows[0].cells[0].confusion is not None

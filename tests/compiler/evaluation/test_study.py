from dataclasses import replace

import msgspec
import numpy as np
import pytest

from thenar.compiler.evaluation.folds import PROTOCOLS, EvaluationError, Fold, Population, Scheme
from thenar.compiler.evaluation.plan import REFERENCE, CellPlan, FoldFit, RowPlan, TableName
from thenar.compiler.evaluation.rates import Rate, RecipeWords
from thenar.compiler.evaluation.study import TABLES, Study, StudyDesign, evaluate
from thenar.compiler.evaluation.tables import RateReader, RateRow, RateTable
from thenar.compiler.placement.elements import Element
from thenar.compiler.samples import Samples
from thenar.compiler.trainers.base import TRAINERS
from thenar.runtime.recipe import Recipe

from ..conftest import with_none
from .conftest import make_grasps

# Six rows of two types, two folds, two repeats of the same folds; three switches, and a joint.
SAMPLES = Samples(
    np.tile(np.eye(3) > 0, (2, 1)), np.arange(6).astype(np.uint16)[:, np.newaxis], np.arange(6) // 3, ("cup", "pen")
)
FOLDS = (Fold(np.arange(3, 6), np.arange(3), "1"), Fold(np.arange(3), np.arange(3, 6), "2"))
PART = Population("A", np.arange(6), (0, 1), (FOLDS, FOLDS))
FIRST = tuple(FoldFit(fold, (Element(0), Element(1)), (0,), (0, 1)) for fold in FOLDS)
THREE = tuple(map(Element, range(3)))
SECOND = tuple(FoldFit(fold, elements, (), (0, 1)) for fold, elements in zip(FOLDS, [THREE, ()], strict=True))
ANSWERS = {
    FIRST[0]: np.array([0, 0, 1]),
    FIRST[1]: np.array([1, 1, 1]),
    SECOND[0]: np.array([0, 0, 0]),
    SECOND[1]: np.array([0, 0, 1]),
}
READER = RateReader(SAMPLES, ANSWERS, "within subject", None)
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
    assert cell.rate == Rate.counted((5, 5, 4, 4), 6, of="within subject", repeats_a_draw=2)
    assert READER.cell(CELL, confusing=False).draws is None
    assert READER.cell(CELL, confusing=False).rate == Rate.counted((5, 4), 6, of="within subject")


def test_a_row_counts_all_its_subjects_and_only_compositions_carry_confusions() -> None:
    folds = tuple(Fold(fold.train + 6, fold.test + 6, fold.name) for fold in FOLDS)
    theirs = tuple(FoldFit(fold, fit.elements, (), fit.grasps) for fold, fit in zip(folds, SECOND, strict=True))
    answers = ANSWERS | {fit: ANSWERS[like] for fit, like in zip(theirs, SECOND, strict=True)}
    twice = replace(SAMPLES.rows(np.tile(np.arange(6), 2)), trials=np.arange(12), movements=np.arange(12))
    reader = replace(READER, samples=twice, predictions=answers)
    other = Population("B", np.arange(6, 12), (0, 1), (folds, folds))
    row = RowPlan("VI", "Sel-Co", (CellPlan(PART, (FIRST, FIRST)), CellPlan(other, (theirs, theirs))))
    recipe = RecipeWords("id3, S = 0", "logitboost, rounds 5")
    table = reader.table("pruning", "paper", (row,), recipe)
    assert table.columns == ("A", "B")
    assert table.rows[0].rate.total == 12
    assert table.rows[0].rate.mean == pytest.approx((5 / 6 + 4 / 6) / 2)
    assert (table.rows[0].switches.least, table.rows[0].switches.most) == (0, 3)
    assert table.rows[0].cells[0].confusion is None
    assert reader.table("compositions", "paper", (row,), recipe).rows[0].cells[0].confusion is not None


ALL: tuple[TableName, ...] = (*TABLES, "trainers")
QUICK = StudyDesign(
    Recipe(trainer="logitboost", rounds=5, folds=2),
    repeats=2,
    prune_list=(0, 10),
    protocols=tuple(PROTOCOLS),
    tables=ALL,
)


@pytest.fixture(scope="module")
def study() -> Study:
    return evaluate(make_grasps(noise=0.2), QUICK, jobs=1)


def table(study: Study, name: str, protocol: str = "nested") -> RateTable:
    (found,) = (candidate for candidate in study.tables if (candidate.name, candidate.protocol) == (name, protocol))
    return found


def row(table: RateTable, name: str) -> RateRow:
    (found,) = (candidate for candidate in table.rows if candidate.name == name)
    return found


def test_every_table_comes_under_both_protocols_in_the_papers_layout(study: Study) -> None:
    both = [(name, p) for name in ALL for p in ("paper", "nested") if (name, p) != ("trainers", "paper")]
    assert [(t.name, t.protocol) for t in study.tables] == both
    for each in study.tables:
        assert each.columns == ("A", "B")
    assert [r.name for r in table(study, "compositions").rows] == ["I", "II", "III", "IV", "V", "VI", "VII"]
    assert [r.name for r in table(study, "generality").rows] == ["A", "B"]
    assert [r.name for r in table(study, "pruning").rows] == ["all", "0", "10"]


def test_confusion_matrices_count_every_row_and_agree_with_rates(study: Study) -> None:
    assert study.grasps == ("hook", "pinch", "power", "tip")
    for protocol in ("paper", "nested"):
        for line in table(study, "compositions", protocol).rows:
            for cell in line.cells:
                counts = np.array(cell.confusion)
                assert counts.sum(axis=1).tolist() == [24, 24, 24, 24]
                assert np.trace(counts) == sum(cell.rate.correct)


def test_evaluations_are_identical_on_any_number_of_workers() -> None:
    grasps = make_grasps(n_switches=5, per_type=8, noise=0.2)
    one, two = (evaluate(grasps, QUICK.changed(repeats=1), jobs=jobs) for jobs in (1, 2))
    assert msgspec.json.encode(one) == msgspec.json.encode(two)


@pytest.mark.usefixtures("one_way_to_train")
def test_rows_in_which_nothing_is_held_change_no_table() -> None:
    quick = QUICK.changed(rounds=2, repeats=1, folds=2, tables=("compositions", "trainers"))
    grasps = make_grasps(noise=0.2, per_type=8)
    without, among = (evaluate(found, quick, jobs=1) for found in (grasps, with_none(grasps)))
    assert among.fingerprint == with_none(grasps).fingerprint() != without.fingerprint
    assert replace(among, fingerprint=without.fingerprint, rests=0) == without


def test_choosing_from_test_rows_flatters_where_there_is_nothing_to_learn() -> None:
    # Coin flips say nothing about the grasp: a nested rate is about 1 in 4, and the paper's protocol is above it.
    grasps = make_grasps(n_switches=200, n_joints=0, subjects="A", noise=0.5, per_type=10)
    study = evaluate(grasps, QUICK.changed(rounds=20, folds=4, repeats=3, tables=("compositions",)), jobs=1)
    paper, nested = (row(table(study, "compositions", name), "VI").cells[0].rate for name in ("paper", "nested"))
    assert paper.mean > nested.mean + 0.1
    assert nested.low <= 0.25 <= nested.high


def test_without_switches_there_are_the_joints_and_no_placements() -> None:
    study = evaluate(make_grasps(n_switches=0), QUICK, jobs=1)
    tables = [("compositions", "paper"), ("compositions", "nested"), ("trainers", "nested")]
    assert [(t.name, t.protocol) for t in study.tables] == tables
    assert [(t.name, t.reason) for t in study.left_out] == [
        (name, "a placement needs switches, and the set has none") for name in ("generality", "pruning", "baselines")
    ]
    assert [line.name for line in study.tables[0].rows] == ["IV"]


def test_a_composition_without_inputs_predicts_the_most_frequent_grasp() -> None:
    grasps = make_grasps(n_joints=0, subjects="A")
    study = evaluate(grasps, QUICK.changed(prune=1000, tables=("compositions",), protocols=("nested",)), jobs=1)
    (cell,) = row(table(study, "compositions"), "VI").cells
    assert (cell.switches.most, cell.no_inputs) == (0, 4)
    assert cell.rate.mean <= 0.25
    assert row(table(study, "compositions"), "V").cells[0].no_inputs == 0


@pytest.mark.usefixtures("one_way_to_train")
def test_one_subject_alone_has_nobody_elses_placement() -> None:
    grasps = make_grasps(n_switches=5)
    study = evaluate(grasps, QUICK.changed(rounds=2, subjects=("B",)), jobs=1)
    assert study.fingerprint == grasps.fingerprint()
    assert {t.name for t in study.tables} == {"compositions", "pruning", "baselines", "trainers"}
    assert [t.name for t in study.left_out] == ["generality"]
    assert study.tables[0].columns == ("B",)
    assert study.rows == 48


def test_one_subjects_pruning_at_equal_s_is_composition_six() -> None:
    options = QUICK.changed(subjects=("A",), prune=10, tables=("compositions", "pruning", "baselines"))
    study = evaluate(make_grasps(noise=0.2), options, jobs=1)
    for protocol in ("paper", "nested"):
        six = row(table(study, "compositions", protocol), "VI").cells[0].rate
        assert row(table(study, "pruning", protocol), "10").cells[0].rate == six
        assert row(table(study, "baselines", protocol), "ID3").cells[0].rate == six


@pytest.mark.usefixtures("one_way_to_train")
@pytest.mark.parametrize("scheme", ["subject", "object"])
def test_other_cuts_have_one_repeat_and_a_column_a_subject(scheme: Scheme) -> None:
    quick = QUICK.changed(rounds=2, scheme=scheme, protocols=("nested",))
    study = evaluate(make_grasps(n_switches=5, per_type=8), quick, jobs=1)
    assert ("generality" in {t.name for t in study.tables}) == (scheme != "subject")
    for each in study.tables:
        assert each.columns == ("A", "B")
        assert all(len(c.rate.correct) == 1 for line in each.rows for c in line.cells if line.name != "random")


def test_every_trainer_is_compared_on_the_same_folds_and_inputs_with_baselines(study: Study) -> None:
    compared = table(study, "trainers")
    assert [(line.what, line.name) for line in compared.rows] == [
        (what, name) for what in ("Angle + Sel-Co", "Angle", "Sel-Co") for name in TRAINERS
    ]
    # The paper's settings were asked for: the first trainer's rows are those of the compositions.
    for what, composition in (("Angle + Sel-Co", "II"), ("Angle", "IV"), ("Sel-Co", "VI")):
        (first,) = (line for line in compared.rows if (line.what, line.name) == (what, REFERENCE))
        # Trainers are compared in the first repeat alone.
        assert first.rate.correct == row(table(study, "compositions"), composition).rate.correct[:1]
        assert first.paired is None
        for line in compared.rows:
            if line.what == what and line.name != REFERENCE:
                assert line.paired is not None
                assert line.paired.difference == pytest.approx(line.rate.mean - first.rate.mean)


def test_trainers_are_not_compared_where_test_rows_choose() -> None:
    study = evaluate(make_grasps(), QUICK.changed(protocols=("paper",), tables=("trainers",)), jobs=1)
    assert study.tables == ()
    assert [left.reason for left in study.left_out] == ["trainers are compared under the nested protocol only"]


def test_a_set_without_rows_is_refused() -> None:
    with pytest.raises(EvaluationError, match="no rows"):
        evaluate(make_grasps().rows([]), QUICK)

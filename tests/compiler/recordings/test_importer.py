from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.compiler.recordings import RecordingError, TableError
from thenar.compiler.recordings.columns import CalibrationPoints, ColumnRoles, JointColumns, TaxelColumns, sound_grid
from thenar.compiler.recordings.export import export
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.importer import ImportReport, code_joint, import_file, import_table
from thenar.compiler.recordings.table import Table

if TYPE_CHECKING:
    from thenar.compiler.recordings.cells import Column

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "columns"
JOINTS = (JointColumns(("j",)),)


def table(*labels: str) -> Table:
    columns = {"g": list(labels), "s": ["0", "1"] * (len(labels) // 2), "j": [str(row) for row in range(len(labels))]}
    return Table("t.csv", columns, np.arange(2, len(labels) + 2))


def test_a_taxonomy_of_ones_own_is_the_labels_sorted() -> None:
    grasp_set, report = import_table(
        table("mug", "ball", "mug", "ball"), ColumnRoles("g", joints=JOINTS, frames="independent")
    )
    assert grasp_set.taxonomy.types == ("ball", "mug")
    assert grasp_set.labels.tolist() == [1, 0, 1, 0]
    assert (report.frames, report.grasp_types, report.subjects, report.joints, report.switches) == (4, 2, 1, 1, 0)


def test_a_list_of_names_is_a_taxonomy_in_its_order() -> None:
    columns = ColumnRoles("g", joints=JOINTS, taxonomy=("mug", "can", "ball"))
    assert import_table(table("MUG", "ball"), columns)[0].labels.tolist() == [0, 2]


def test_labels_of_a_published_taxonomy_may_be_names_abbreviations_and_numbers() -> None:
    columns = ColumnRoles("g", joints=JOINTS, taxonomy="kamakura14", labels={"the strong one": "PoS"})
    labels = ["pos", "2", "Lateral_grip", "the strong one"]
    assert import_table(table(*labels), columns)[0].grasps.tolist() == ["PoS", "PoH", "Lat", "PoS"]


def test_all_unknown_labels_are_named_at_once_with_suggestions() -> None:
    columns = ColumnRoles("g", joints=JOINTS, taxonomy="kamakura14", frames="independent")
    with pytest.raises(TableError) as refused:
        import_table(table("PoS", "PoX", "PoX", "PoH", "mug"), columns)
    said = str(refused.value)
    assert said.startswith("t.csv: 2 labels in 'g' are not grasp types of kamakura14: 'PoX' (did you mean ")
    assert "'mug' (its types: PoS," in said
    assert said.endswith("; 3 rows have them, rows 3, 4, 6; [labels] can translate them")
    with pytest.raises(TableError) as refused:
        import_table(table(*(f"mug {number}" for number in range(500))), columns)
    assert "'mug 12'" in str(refused.value)
    assert len(str(refused.value)) < 1000


def test_rows_that_may_be_frames_of_one_trial_are_asked_about() -> None:
    columns = ColumnRoles("g", joints=JOINTS)
    with pytest.raises(TableError, match=r"2 rows share .* \(`trial = \.\.\.`, .* \(`frames = \"independent\"`\)"):
        import_table(table("a", "b", "a"), columns)
    grasp_set, report = import_table(table("a", "b", "a"), replace(columns, frames="independent"))
    assert grasp_set.independent
    assert (report.trials, grasp_set.trial_ids.tolist()) == (3, [0, 1, 2])
    assert import_table(table("a", "b"), columns)[1].trials == 2


def frames(**cells: Any) -> tuple[GraspSet, ImportReport]:
    """Import six frames of three trials of a and b, with other cells, or keys of a columns.toml."""
    keys = {name: cells.pop(name) for name in ("missing", "taxels", "time") if name in cells}
    rows: dict[str, Column] = {
        "g": ["a", "a", "a", "b", "b", "a"],
        "rep": ["T1", "T1", "T1", "T1", "T1", "T10"],
        "t": ["2", "0", "1", "0", "1", "0"],
        "s": ["0", "0", "1", "1", "0", "0"],
        "j": ["3", "1", "2", "5", "7", "9"],
    }
    settings: Any = {"joints": (JointColumns(("j",), codes=True),), **keys}
    columns = ColumnRoles("g", trial="rep", switches=("s",), **settings)
    return import_table(Table("t.csv", rows | cells, np.arange(2, 8)), columns)


def test_text_trials_are_numbered_in_natural_order_and_it_is_said() -> None:
    grasp_set, report = frames(rep=["T10", "T10", "001 - Copy", "T2", "T2", "T10"])
    assert grasp_set.trials.tolist() == [3, 3, 1, 2, 2, 3]
    assert report.notes == (
        "the texts of rep were numbered as trials in natural order: '001 - Copy' is 1, 'T2' is 2, 'T10' is 3",
    )
    grasp_set, report = frames(rep=["7", "7", "8", "-1", "-1", "9.0"])
    assert (grasp_set.trials.tolist(), report.notes) == ([7, 7, 8, -1, -1, 9], ())


def test_the_frames_of_a_trial_are_put_in_order() -> None:
    grasp_set, report = frames(time="t")
    assert grasp_set.codes[:, 0].tolist() == [1, 2, 3, 5, 7, 9]
    assert grasp_set.switches[:, 0].tolist() == [0, 1, 0, 1, 0, 0]
    assert report.trials == 3


def test_a_trial_begins_where_time_starts_anew() -> None:
    table = Table(
        "t.csv", {"g": ["a"] * 5 + ["b"], "t": ["0", "2", "0", "2", "0", "2"], "s": ["0", "1"] * 3}, np.arange(6)
    )
    columns = ColumnRoles("g", time="t", frames="restart", switches=("s",))
    assert import_table(table, columns)[0].trial_ids.tolist() == [0, 0, 1, 1, 2, 3]


def test_missing_cells_are_kept_filled_from_their_trial_and_it_is_said() -> None:
    grasp_set, report = frames(missing="keep", j=["3", "", "2", "5", "7", ""], s=["0", "0", "1", "?", "0", "0"])
    assert grasp_set.codes[:, 0].tolist() == [3, 3, 2, 5, 7, 3]
    assert grasp_set.switches[:, 0].tolist() == [False, False, True, False, False, False]
    assert report.warnings[0].message == (
        "3 missing cells in 3 rows were filled: 2 from the nearest frame of their trial, 1 with their column's median "
        "(rows 3, 5, 7; columns s, j)"
    )


def test_rows_without_label_or_trial_are_dropped_and_counted() -> None:
    grasp_set, report = frames(missing="keep", g=["a", "a", "a", "b", "", "a"], rep=["1", "1", "1", "", "1", "2"])
    assert grasp_set.codes[:, 0].tolist() == [3, 1, 2, 9]
    assert report.warnings[0].message == (
        "2 rows with missing values were left out: rows 5, 6 (columns g, rep); "
        "so 2 of 4 trials and grasp type b are lost"
    )
    with pytest.raises(TableError, match=r"column 'j' has no values: leave it out"):
        frames(missing="keep", j=[""] * 6)


def test_analog_columns_become_switches_above_a_threshold() -> None:
    pads = {"p1": ["0", "90", "100", "5", "95", ""], "p2": ["0.5", "0.4", "0.6", "1", "0", "0.41"]}
    taxels = (TaxelColumns(("p1",), threshold="otsu"), TaxelColumns(("p2",), threshold=0.4))
    grasp_set, report = frames(missing="keep", taxels=taxels, **pads)
    assert grasp_set.switch_names == ("s", "p1", "p2")
    assert grasp_set.switches[:, 1].tolist() == [False, True, True, False, True, True]
    assert grasp_set.switches[:, 2].tolist() == [True, False, True, True, False, True]
    assert "2 analog columns became switches, closed p1 above 47.5, p2 above 0.4" in report.notes


def test_columns_whose_threshold_is_learnt_are_kept_as_codes(tmp_path: Path) -> None:
    pads = {"p1": ["0", "90", "100", "5", "95", ""], "p2": ["0.5", "0.4", "0.6", "1", "0", "0.41"]}
    grasp_set, _ = frames(missing="keep", taxels=(TaxelColumns(("p*",), threshold="learnt"),), **pads)
    assert grasp_set.element_names == ("s", "p1", "p2")
    assert grasp_set.taxels[:, 0].tolist() == [0, 90, 100, 5, 95, 90]
    assert grasp_set.taxel_columns[1].value(grasp_set.taxels[:, 1]) == pytest.approx([0.5, 0.4, 0.6, 1, 0, 0.41])
    for codes in (False, True):
        export(grasp_set, tmp_path / "t.csv", codes, columns=tmp_path / "c.toml")
        again, _ = import_file(tmp_path / "t.csv", tmp_path / "c.toml")
        assert again.fingerprint() == grasp_set.fingerprint()


def test_a_label_and_a_trial_may_be_spread_over_columns() -> None:
    rows = {"o": ["mug", "mug", "can"], "a": ["lift", "pour", "lift"], "side": ["l", "l", "r"], "n": ["0", "1", "0"]}
    columns = ColumnRoles(("o", "a"), trial=("side", "n"), switches=("s",))
    grasp_set, _ = import_table(Table("t.csv", {**rows, "s": ["0", "1", "0"]}, np.arange(3)), columns)
    assert grasp_set.taxonomy.types == ("can lift", "mug lift", "mug pour")
    assert grasp_set.trials.tolist() == [1, 2, 3]


def test_a_coarse_grid_of_radians_warns_with_a_better_one() -> None:
    values = np.random.default_rng(1).permutation(np.linspace(0, 1.4, 60))
    rows: dict[str, Column] = {"g": ["a", "b"] * 30, "j": values}
    columns = ColumnRoles("g", joints=(JointColumns(("j",), "rad"),), frames="independent")
    (coarse, *_) = import_table(Table("t.csv", rows, np.arange(60)), columns)[1].warnings
    assert coarse.kind == "coarse grids"
    assert "j 4 of 60 (grid = 0.001 keeps them)" in coarse.message
    columns = replace(columns, joints=(JointColumns(("j",), "rad", grid=0.001),))
    assert import_table(Table("t.csv", rows, np.arange(60)), columns)[1].warnings == ()


def test_oddities_are_warnings_with_the_users_rows() -> None:
    columns = ColumnRoles("g", subject="who", switches=("s",))
    rows = {"g": ["a", "b", "a", "b"], "who": ["x", "x", "y", "y"], "s": ["0", "1", "0", "1"]}
    _, report = import_table(Table("t.csv", rows, np.array([2, 3, 5, 6])), columns)
    (finding,) = report.warnings
    assert (finding.kind, finding.rows) == ("frames shared by subjects", (2, 3, 5, 6))


def test_the_icub_recordings_are_read_as_their_readme_describes_them(icub_table: Path) -> None:
    grasp_set, report = import_file(icub_table, EXAMPLES / "icub.toml")
    assert grasp_set.switches.shape == (230, 60)
    assert grasp_set.joint_names == tuple(f"enc{number}" for number in range(7, 16))
    assert (report.grasp_types, report.subjects, report.objects) == (11, 1, 1)
    assert all(cost.largest_error <= 0.25 and cost.step == 0.5 for cost in report.coding)
    assert grasp_set.joints[0].value(grasp_set.codes[0, 0]) == 21.0
    assert grasp_set.grasps[0] == "blue_bear"
    coarse, constant = report.warnings
    assert (coarse.kind, coarse.columns) == ("coarse grids", ("enc8",))
    assert (constant.kind, constant.count) == ("constant switches", 11)


def test_counts_of_a_converter_keep_its_range_and_their_calibration(tmp_path: Path) -> None:
    """The ends of the range are the two points, in counts or in newtons; a written set reads back as the same."""
    pads = {"p1": ["0", "90", "1000", "5", "95", "7"], "p2": ["0", "4", "6", "1023", "0", "41"]}
    plain = TaxelColumns(("p1",), bits=10)
    newtons = TaxelColumns(("p2",), unit="N", bits=10, calibration=CalibrationPoints(23, 0.0, 523, 10.0))
    grasp_set, report = frames(taxels=(plain, newtons), **pads)
    one, two = grasp_set.taxel_columns
    assert (one.code_a, one.value_a, one.code_b, one.value_b) == (0, 0.0, 1023, 1023.0)
    assert (two.code_a, two.code_b) == (0, 1023)
    assert two.value([23, 523]) == pytest.approx([0, 10])
    assert grasp_set.taxels[:, 1].tolist() == [0, 4, 6, 1023, 0, 41]
    assert report.notes[-1].startswith("2 taxels stay analog")
    export(grasp_set, tmp_path / "t.csv", True, columns=tmp_path / "c.toml")
    assert import_file(tmp_path / "t.csv", tmp_path / "c.toml")[0].fingerprint() == grasp_set.fingerprint()
    with pytest.raises(TableError, match=r"taxel 'p2': row 5 .*exceed 9 bits"):
        frames(taxels=(plain, TaxelColumns(("p2",), bits=9)), **pads)


ANGLES = st.lists(st.floats(-400, 400), min_size=1, max_size=20)


def rows(values: np.ndarray) -> np.ndarray:
    return np.arange(2, len(values) + 2)


@given(ANGLES, st.sampled_from([0.1, 0.5, 1.0, 3.0]))
def test_no_value_moves_by_more_than_half_the_grid(angles: list[float], grid: float) -> None:
    values = np.array(angles)
    codes, joint, cost = code_joint("j", JointColumns(("j",), grid=grid), values, rows(values))
    errors = np.abs(joint.value(codes) - values)
    assert errors.max() <= grid / 2 + 1e-9
    assert cost.largest_error == errors.max()
    assert cost.distinct_before == len(set(values.tolist()))
    assert cost.distinct_after == len(set(codes.tolist())) <= cost.distinct_before


@given(ANGLES)
def test_the_grid_starts_at_a_multiple_below_the_least_value(angles: list[float]) -> None:
    values = np.array(angles)
    codes, joint, _ = code_joint("j", JointColumns(("j",), grid=0.5), values, rows(values))
    assert joint.value_a <= values.min() < joint.value_a + 0.5
    assert joint.value_a % 0.5 == 0
    assert codes.min() in (0, 1)
    assert joint.step == 0.5


def test_codes_are_taken_as_they_are() -> None:
    values = np.array([1.0, 255.0, 65535.0])
    codes, joint, cost = code_joint("j", JointColumns(("j",), "raw", codes=True), values, rows(values))
    assert codes.tolist() == joint.value(codes).tolist() == values.tolist()
    assert cost.largest_error == 0


def test_values_are_coded_by_a_calibration_when_there_is_one() -> None:
    entry = JointColumns(("j",), calibration=CalibrationPoints(100, 0.0, 200, -90.0))
    codes, _, cost = code_joint("j", entry, np.array([0.0, -45.2, -90.0]), np.arange(3))
    assert codes.tolist() == [100, 150, 200]
    assert cost.largest_error == pytest.approx(0.2)
    assert cost.step == 0.9


@pytest.mark.parametrize(
    ("entry", "advice"),
    [
        (JointColumns(("j",), grid=0.001), "take a coarser grid"),
        (JointColumns(("j",), origin=1.0), "check origin and calibration"),
        (JointColumns(("j",), calibration=CalibrationPoints(0, 10.0, 1, 11.0)), "check origin and calibration"),
    ],
)
def test_values_beyond_the_codes_are_refused_with_their_rows(entry: JointColumns, advice: str) -> None:
    with pytest.raises(TableError, match=f"joint 'j': rows? .* would get codes outside 0..65535: {advice}"):
        code_joint("j", entry, np.array([0.0, 100.0, 5.0]), np.array([2, 3, 4]))


@pytest.mark.parametrize("values", [[0.0, 1e308], [-1e308, 1e308], [-1e308, 0.0], [1e308, 1e308]])
@pytest.mark.parametrize("grid", [0.5, 0.001])
def test_values_beyond_all_counting_are_refused_as_well(values: list[float], grid: float) -> None:
    with pytest.raises((TableError, RecordingError), match="take a coarser grid"):
        code_joint("j", JointColumns(("j",), grid=grid), np.array(values), np.arange(2))


@pytest.mark.parametrize("size", [1e-200, 1e-9, 1.0, 1e200])
def test_the_cost_of_coding_is_told_in_any_unit(size: float) -> None:
    values = np.array([0.0, 1.25, 2.5, 7.75]) * size
    _, _, cost = code_joint("j", JointColumns(("j",), grid=size), values, rows(values))
    assert cost.largest_error == pytest.approx(0.5 * size)


@given(st.lists(st.floats(-1e290, 1e290), min_size=1, max_size=30).map(np.array))
def test_a_sound_grid_gives_every_value_a_code(values: np.ndarray) -> None:
    grid = sound_grid(values)
    if np.ptp(values) > 0:
        codes, joint, _ = code_joint("j", JointColumns(("j",), grid=grid), values, rows(values))
        assert np.abs(joint.value(codes) - values).max() <= grid * 0.5001


@given(st.lists(st.integers(-5000, 5000), min_size=2, max_size=30, unique=True), st.integers(0, 4))
def test_decimals_keep_all_that_they_tell(numbers: list[int], digits: int) -> None:
    values = np.array([float(f"{number}e-{digits}") for number in numbers])
    codes, joint, cost = code_joint("j", JointColumns(("j",), grid=sound_grid(values)), values, rows(values))
    assert cost.distinct_after == len(numbers)
    assert joint.value(codes) == pytest.approx(values, abs=1e-9)


@pytest.mark.parametrize(("largest", "grid"), [(1.5, 0.001), (90.0, 0.05), (3.3, 0.002), (1.5e-6, 1e-9), (4e12, 2e9)])
def test_noise_gets_a_thousand_steps(largest: float, grid: float) -> None:
    values = np.random.default_rng(1).random(5000) * largest
    assert sound_grid(values) == grid
    outlier = np.append(values, 30 * largest)
    assert sound_grid(outlier) == grid
    assert (sound_grid(np.array([3.0])), sound_grid(np.array([2.0, 2.0]))) == (1.0, 1.0)

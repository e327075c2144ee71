from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.recordings.columns import Columns, JointColumns
from thenar.compiler.recordings.errors import ColumnsError, TableError
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.importer import ImportReport, import_file, import_table
from thenar.compiler.recordings.table import Table

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "columns"
JOINTS = (JointColumns(("j",)),)


def table(*labels: str) -> Table:
    columns = {"g": list(labels), "s": ["0", "1"] * (len(labels) // 2), "j": [str(row) for row in range(len(labels))]}
    return Table("t.csv", columns, np.arange(2, len(labels) + 2))


def test_a_taxonomy_of_ones_own_is_the_labels_sorted() -> None:
    grasp_set, report = import_table(table("mug", "ball", "mug", "ball"), Columns("g", joints=JOINTS))
    assert grasp_set.taxonomy.types == ("ball", "mug")
    assert grasp_set.labels.tolist() == [1, 0, 1, 0]
    assert (report.rows, report.grasp_types, report.subjects, report.joints, report.switches) == (4, 2, 1, 1, 0)


def test_a_list_of_names_is_a_taxonomy_in_its_order() -> None:
    columns = Columns("g", joints=JOINTS, taxonomy=("mug", "can", "ball"))
    assert import_table(table("MUG", "ball"), columns)[0].labels.tolist() == [0, 2]


def test_labels_of_a_published_taxonomy_may_be_names_abbreviations_and_numbers() -> None:
    columns = Columns("g", joints=JOINTS, taxonomy="kamakura14", labels={"the strong one": "PoS"})
    labels = ["pos", "2", "Lateral_grip", "the strong one"]
    assert import_table(table(*labels), columns)[0].grasps.tolist() == ["PoS", "PoH", "Lat", "PoS"]


def test_unknown_labels_are_counted_named_and_answered_with_the_nearest() -> None:
    with pytest.raises(TableError) as refused:
        import_table(table("PoS", "PoX", "PoX", "PoH"), Columns("g", joints=JOINTS, taxonomy="kamakura14"))
    assert str(refused.value).startswith(
        "t.csv: 2 unknown labels in 'g', rows 3, 4; 'PoX' is no grasp type of kamakura14"
    )
    assert "did you mean" in str(refused.value)


def test_an_unknown_taxonomy_is_refused() -> None:
    with pytest.raises(ColumnsError, match="taxonomy: no taxonomy is called 'feix'"):
        import_table(table("a", "b"), Columns("g", joints=JOINTS, taxonomy="feix"))


def test_an_alias_that_no_row_needs_is_a_warning() -> None:
    _, report = import_table(table("a", "b"), Columns("g", joints=JOINTS, labels={"c": "a"}))
    assert [(finding.kind, finding.count) for finding in report.warnings] == [("unused aliases", 1)]


def test_oddities_are_warnings_with_the_users_rows() -> None:
    columns = Columns("g", subject="who", switches=("s",))
    rows = {"g": ["a", "b", "a", "b"], "who": ["x", "x", "y", "y"], "s": ["0", "1", "0", "1"]}
    _, report = import_table(Table("t.csv", rows, np.array([2, 3, 5, 6])), columns)
    (finding,) = report.warnings
    assert (finding.kind, finding.rows) == ("frames shared by subjects", (2, 3, 5, 6))


def imported(path: Path, columns: str) -> tuple[GraspSet, ImportReport]:
    return import_file(path, EXAMPLES / columns)


def test_the_icub_recordings_are_read_as_their_readme_describes_them(icub_table: Path) -> None:
    grasp_set, report = imported(icub_table, "icub.toml")
    assert grasp_set.switches.shape == (230, 60)
    assert grasp_set.joint_names == tuple(f"enc{number}" for number in range(7, 16))
    assert (report.grasp_types, report.subjects, report.objects) == (11, 1, 1)
    assert all(cost.largest_error <= 0.25 and cost.step == 0.5 for cost in report.coding)
    assert grasp_set.joints[0].value(grasp_set.codes[0, 0]) == 21.0
    assert grasp_set.grasps[0] == "blue_bear"
    (constant,) = report.warnings
    assert (constant.kind, constant.count) == ("constant switches", 11)


def test_the_aml_recordings_are_read_as_their_readme_describes_them(aml_table: Path) -> None:
    grasp_set, report = imported(aml_table, "aml.toml")
    assert grasp_set.codes.shape == (699, 6)
    assert grasp_set.switches.shape == (699, 0)
    assert (report.taxonomy, report.grasp_types, report.subjects, report.objects) == ("feix33", 8, 2, 13)
    assert grasp_set.grasps[0] == "Adduction Grip"
    assert [cost.largest_error for cost in report.coding] == [0.0] * 6
    assert [joint.value(code) for joint, code in zip(grasp_set.joints, grasp_set.codes[0], strict=True)] == [
        150,
        201,
        125,
        158,
        77,
        157,
    ]


def test_a_value_beyond_the_codes_is_named_by_the_users_row() -> None:
    rows = {"g": ["a", "b"], "j": ["0", "1e6"]}
    with pytest.raises(TableError, match="joint 'j': row 9 would get codes outside"):
        import_table(Table("t.csv", rows, np.array([7, 9])), Columns("g", joints=JOINTS))

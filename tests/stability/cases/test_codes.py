import gzip
import warnings
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thenar.cli import run
from thenar.compiler.boosting.binning import midpoints
from thenar.compiler.boosting.boost import boost
from thenar.compiler.boosting.stumps import winners
from thenar.compiler.recordings.coding import code_joint
from thenar.compiler.recordings.columns import JointColumns
from thenar.compiler.recordings.errors import RecordingError, TableError
from thenar.compiler.recordings.importer import import_file
from thenar.compiler.tables.collapse import collapse
from thenar.compiler.tables.quantise import quantise
from thenar.runtime.scores import Scorer
from thenar.runtime.tables import HIGHEST_CODE
from thenar.stability.cases.codes import EVERY_CODE, HARD_DOUBLES, NO_BITS, NO_CODES, NO_NUMBERS, hard_codes

finite = st.floats(allow_nan=False, allow_infinity=False) | st.sampled_from(HARD_DOUBLES)
near_the_ends = st.integers(0, HIGHEST_CODE) | st.sampled_from([0, 1, HIGHEST_CODE - 1, HIGHEST_CODE])


@given(st.lists(finite, min_size=2, max_size=30))
def test_a_threshold_lies_where_it_parts_two_neighbours(values: list[float]) -> None:
    distinct = np.unique(values)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = midpoints(distinct)
    for low, high, threshold in zip(distinct[:-1].tolist(), distinct[1:].tolist(), found.tolist(), strict=True):
        assert low <= threshold < high
        middle = (Fraction(low) + Fraction(high)) / 2
        # No double between the two lies closer to the middle.
        for near in np.nextafter(threshold, [-np.inf, np.inf]).tolist():
            if low <= near < high:
                assert abs(Fraction(near) - middle) >= abs(Fraction(threshold) - middle)


@settings(deadline=None, max_examples=40)
@given(st.lists(near_the_ends, min_size=2, max_size=12))
def test_codes_are_told_apart_alike_by_stumps_tables_and_integers(column: list[int]) -> None:
    X = np.array(column, np.uint16)[:, np.newaxis]
    labels = np.arange(len(X)) % 2
    stumps, _ = boost(X, labels, 2, rounds=10)
    assume(stumps.n_rounds)
    tables = collapse(stumps, 0)
    integers = quantise(tables, np.zeros((len(X), 0), bool), X)
    # On both sides of every threshold, at both ends, and at what was trained on: nowhere else can anything change.
    codes_ = np.unique(np.concatenate([X[:, 0], *tables.thresholds, tables.thresholds[0] + 1, [0, HIGHEST_CODE]]))
    frames = codes_.astype(np.uint16)[:, np.newaxis]
    by_stumps, by_tables = stumps.scores(frames), tables.scores(np.zeros((len(frames), 0), bool), frames)
    assert np.allclose(by_stumps, by_tables, rtol=0, atol=1e-12)
    scorer = Scorer(integers)
    decided = np.abs(by_stumps[:, 0] - by_stumps[:, 1]) > 4 / integers.scale
    for code, winner in zip(frames[decided], winners(by_stumps)[decided], strict=True):
        assert int(np.argmax(scorer.lanes(np.zeros(0, bool), code))) == winner


@pytest.mark.parametrize("seed", range(3))
def test_hard_codes_hold_their_ends_and_a_constant(seed: int) -> None:
    found, labels = hard_codes(seed)
    assert found.dtype == np.uint16
    assert set(found[:, 0].tolist()) == {0, HIGHEST_CODE}
    assert {HIGHEST_CODE - 1, HIGHEST_CODE} <= set(found[:, 1].tolist())
    assert np.ptp(found[:, 2]) == 0
    assert np.ptp(found[:, 3].astype(int)) == 1
    assert set(labels.tolist()) == {0, 1, 2}


@settings(deadline=None)
@given(
    st.lists(st.floats(-1e6, 1e6) | st.sampled_from([-0.0, 5e-324, -5e-324, 1e-9, 2e-9]), min_size=1, max_size=20),
    st.sampled_from([1e-9, 1e-6, 0.1, 1 / 3, 0.5, 2.0, 100.0]),
)
@example([1.0, 1.000000001], 1e-9)
@example([-0.0, 0.0], 0.5)
def test_degrees_are_coded_to_the_nearest_step_or_refused_with_their_rows(values: list[float], grid: float) -> None:
    array = np.array(values)
    rows = np.arange(2, len(values) + 2)
    try:
        coded, joint, cost = code_joint("j", JointColumns(("j",), grid=grid), array, rows)
    except (RecordingError, TableError) as complaint:
        complaints = str(complaint)
    else:
        complaints = ""
    too_wide = max(values) - min(values) > 65534 * grid
    too_fine = grid <= 1.0001e-9 * (max(map(abs, values)) + 65536 * grid)
    if complaints:
        assert ("would get codes outside" in complaints and too_wide) or (
            "cannot be distinguished" in complaints and too_fine
        )
        return
    step = Fraction(joint.value_b - joint.value_a) / (joint.code_b - joint.code_a)
    for value, code in zip(values, coded.tolist(), strict=True):
        meant = Fraction(joint.value_a) + (code - joint.code_a) * step
        assert abs(Fraction(value) - meant) <= step * Fraction(1, 2) * (1 + Fraction(1, 10**6))
    assert 0 <= cost.rms_error <= cost.largest_error * (1 + 1e-12)
    assert joint.code(joint.value(EVERY_CODE)).tolist() == EVERY_CODE.tolist()


@pytest.mark.parametrize(
    ("column", "entry", "cells"), [("j", "", NO_NUMBERS), ("j", "codes = true", NO_CODES), ("s", "", NO_BITS)]
)
@pytest.mark.parametrize("kind", ["csv", "csv.gz", "arff"])
def test_the_command_refuses_what_is_no_number_and_names_row_and_column(
    column: str, entry: str, cells: tuple[str, ...], kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "columns.toml").write_text(f'label = "g"\nswitches = ["s"]\n[[joints]]\ncolumns = ["j"]\n{entry}\n')
    for cell in cells:
        if kind == "arff" and ("," in cell or not cell):
            continue
        table = write(tmp_path, kind, ["1", cell if column == "s" else "0"], ["1", cell if column == "j" else "2"])
        out = tmp_path / "set.grasps"
        code = run(["import", str(table), "-o", str(out), "--columns", str(tmp_path / "columns.toml")])
        said = capsys.readouterr().err
        assert code == 2
        assert said.startswith("thenar: ")
        assert f"row {2 if kind == 'arff' else 3} {column!r} ({cell!r})" in said, said
        assert not out.exists()


def write(folder: Path, kind: str, switches: list[str], joints: list[str]) -> Path:
    """Write a table of two rows as `kind`, its name."""
    rows = [[f'"{cell}"' for cell in row] for row in zip(["a", "b"], switches, joints, strict=True)]
    head = "g,s,j\n"
    if kind == "arff":
        head = "@relation t\n@attribute g {a,b}\n@attribute s numeric\n@attribute j numeric\n@data\n"
    text = head + "".join(",".join(row) + "\n" for row in rows)
    path = folder / f"table.{kind}"
    path.write_bytes(gzip.compress(text.encode()) if kind.endswith("gz") else text.encode())
    return path


@pytest.mark.parametrize("column", ["g", "s", "j", "t", "u", "o"])
@pytest.mark.parametrize("number", [np.inf, -np.inf, np.nan])
def test_no_column_of_an_npz_takes_infinity_and_none_takes_nan_unasked(
    column: str, number: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heads = {"label": "g", "subject": "u", "object": "o", "trial": "t"}
    told = "".join(f'{key} = "{name}"\n' for key, name in heads.items())
    (tmp_path / "columns.toml").write_text(f'{told}switches = ["s"]\n[[joints]]\ncolumns = ["j"]\n')
    np.savez(tmp_path / "table.npz", **arrays_with(column, number))  # type: ignore[arg-type]
    given_ = ["import", str(tmp_path / "table.npz"), "-o", str(tmp_path / "set.grasps"), "--columns"]
    assert run([*given_, str(tmp_path / "columns.toml")]) == 2
    said = capsys.readouterr().err
    assert f"row 2 {column!r} ('{number}')" in said
    assert ("missing" in said) == np.isnan(number)


def arrays_with(column: str, number: float) -> dict[str, NDArray[np.float64]]:
    arrays = {name: np.array([0.0, 1.0, 1.0]) for name in "gsjtuo"}
    arrays[column][1] = number
    return arrays


def test_rows_of_nan_are_left_out_where_the_user_says_so_and_infinity_never(tmp_path: Path) -> None:
    (tmp_path / "columns.toml").write_text(
        'label = "g"\nframes = "independent"\nmissing = "drop"\n[[joints]]\ncolumns = ["j"]\n'
    )
    (tmp_path / "table.csv").write_text("g,j\na,1\nb,nan\na,3\n")
    grasp_set, report = import_file(tmp_path / "table.csv", tmp_path / "columns.toml")
    assert len(grasp_set) == 2
    assert "1 rows with missing values were left out: row 3 (columns j)" in report.warnings[0].message
    (tmp_path / "table.csv").write_text("g,j\na,1\nb,inf\na,3\n")
    with pytest.raises(TableError, match=r"not finite numbers: 1 cell, row 3 'j' \('inf'\)"):
        import_file(tmp_path / "table.csv", tmp_path / "columns.toml")


def test_what_a_coarse_grid_makes_equal_is_said(tmp_path: Path) -> None:
    (tmp_path / "columns.toml").write_text('label = "g"\n[[joints]]\ncolumns = ["j"]\n')
    (tmp_path / "table.csv").write_text("g,j\na,10.000000001\nb,10.000000002\n")
    _, report = import_file(tmp_path / "table.csv", tmp_path / "columns.toml")
    assert (report.coding[0].distinct_before, report.coding[0].distinct_after) == (2, 1)
    messages = [warning.message for warning in report.warnings]
    assert "1 joints never change: j" in messages
    assert any("another grasp type has as well: rows 2, 3" in message for message in messages)

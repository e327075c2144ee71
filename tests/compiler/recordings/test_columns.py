import math
from pathlib import Path

import pytest

from thenar.compiler.recordings import TableError
from thenar.compiler.recordings.columns import (
    CalibrationPoints,
    ColumnRoles,
    JointColumns,
    TaxelColumns,
    read_columns,
    select,
)

NAMES = ["grasp", "who", "what", "s1", "s2", "s10", "j1", "j2"]


def read(text: str, folder: Path) -> ColumnRoles:
    path = folder / "columns.toml"
    path.write_text(text)
    return read_columns(path)


def test_every_key_is_read(tmp_path: Path) -> None:
    text = """
        label = "grasp"
        subject = "who"
        object = "what"
        trial = "n"
        switches = ["s*"]
        taxonomy = ["a", "b"]
        missing = "drop"
        delimiter = ";"
        [labels]
        alpha = "a"
        [[joints]]
        columns = ["j1"]
        unit = "rad"
        grid = 1
        origin = -3
        [[joints]]
        columns = ["j2"]
        codes = true
        calibration = { code_a = 1, value_a = 0, code_b = 255, value_b = 90.5 }
    """
    assert read(text, tmp_path) == ColumnRoles(
        label="grasp",
        subject="who",
        object="what",
        trial="n",
        switches=("s*",),
        taxonomy=("a", "b"),
        missing="drop",
        delimiter=";",
        labels={"alpha": "a"},
        joints=(
            JointColumns(("j1",), "rad", grid=1.0, origin=-3.0),
            JointColumns(("j2",), codes=True, calibration=CalibrationPoints(1, 0.0, 255, 90.5)),
        ),
    )


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "line 1: the key label is missing"),
        ('label = "a"\nlables = 1', "line 2: lables: this key is unknown"),
        ('label = "a"\nmissing = "skip"', "line 2: missing: 'skip' is not among its values"),
        ('label = "a"\ndecimal = ";"', "decimal: ';' is not among its values"),
        ('label = "a"\n[[taxels]]\ncolumns = ["b"]\nthreshold = "max"', "'max' is not among its values"),
        ('label = "a"\ndelimiter = ""', "`delimiter` must be one character"),
        ('label = "a"\ndelimiter = "\'"\nquote = "\'"', "one character that is not the `quote`"),
        ('label = "a"\nencoding = "base64"', "`encoding` must be one that Python knows, not 'base64'"),
        ('label = "a"\nencoding = "idna"', "`encoding` must be one that Python knows"),
        ('label = "a"\nencoding = "a\\u0000b"', "`encoding` must be one that Python knows"),
        ('label = "a"\ntime_unit = "s"', "`time_unit` is given without `time`"),
        ('label = "a"\ntrial = "b"\nframes = "restart"', "`trial` and `frames` = 'restart' both say what"),
        ("label = []", "`label` must name a column"),
        (
            'label = "a"\n[[taxels]]\ncolumns = ["b"]\nthreshold = inf',
            r"taxels\[0\]\.threshold: must be a finite number, not inf",
        ),
        ('label = "a"\n[[taxels]]\ncolumns = ["b"]\nbits = 17', "bits: "),
        ('label = "a"\n[[taxels]]\ncolumns = ["b"]\nbits = 12\ngrid = 2', "`bits` is for counts"),
        (
            'label = "a"\n[[taxels]]\ncolumns = ["b"]\nthreshold = 3\ncodes = true',
            "`codes`, `bits`, `grid`, `origin` and `calibration` are for taxels without `threshold`",
        ),
        ('label = "a"\n[[joints]]\ncolumns = ["b"]\ngrid = 0', "`grid` must be above 0, not 0"),
        (
            'label = "a"\n[[joints]]\ncolumns = ["b"]\ngrid = nan',
            r"joints\[0\]\.grid: must be a finite number, not nan",
        ),
        ('label = "a"\n[[joints]]\ncolumns = ["b"]\ncodes = true\ngrid = 1', "`grid` and `origin` are for values"),
        (
            'label = "a"\n[[joints]]\ncolumns = ["b"]\norigin = inf',
            r"joints\[0\]\.origin: must be a finite number, not inf",
        ),
        (f'label = "a"\ndelimiter = "{"x" * 100_000}"', "`delimiter` must be one character, not 'xxx"),
    ],
)
def test_a_wrong_key_is_named(text: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(TableError, match=f"^columns.toml.*{reason}") as refused:
        read(text, tmp_path)
    assert len(str(refused.value)) < 500


def test_numbers_of_columns_are_finite() -> None:
    with pytest.raises(ValueError, match="`grid` must be above 0, not nan"):
        JointColumns(("b",), grid=math.nan)
    with pytest.raises(ValueError, match="`origin` must be a finite number, not inf"):
        JointColumns(("b",), origin=math.inf)
    with pytest.raises(ValueError, match="`threshold` must be a finite number, 'otsu' or 'learnt', not inf"):
        TaxelColumns(("b",), threshold=math.inf)


def test_globs_pick_columns_in_their_own_order_then_the_tables() -> None:
    columns = ColumnRoles("grasp", switches=("s1*", "s2"), joints=(JointColumns(("j2",)), JointColumns(("j1",))))
    selection = select(columns, NAMES)
    assert selection.switches == (("s1", None), ("s10", None), ("s2", None))
    assert selection.coded == (("j2", columns.joints[0]), ("j1", columns.joints[1]))


@pytest.mark.parametrize(
    ("columns", "reason"),
    [
        (ColumnRoles("grap", switches=("s*",)), r"no column 'grap' \(did you mean 'grasp'\?\)"),
        (ColumnRoles("grasp", subject="whom", switches=("s*",)), r"no column 'whom' \(did you mean 'who'"),
        (
            ColumnRoles("grasp", trial="zzz", switches=("s*",)),
            r"trial: the .* 'zzz' \(there are: grasp, who, .* and 3 more\)",
        ),
        (ColumnRoles("grasp", joints=(JointColumns(("k3",)),)), "joints: 'k3' matches no column"),
        (ColumnRoles("grasp", switches=("s*", "s1")), "column 's1' is used 2 times"),
        (ColumnRoles("grasp", switches=("*",)), "column 'grasp' is used 2 times"),
        (ColumnRoles("grasp", subject="grasp", switches=("s*",)), "column 'grasp' is used 2 times"),
        (ColumnRoles("grasp"), "no column is an input"),
    ],
)
def test_columns_that_do_not_fit_the_table_are_refused(columns: ColumnRoles, reason: str) -> None:
    with pytest.raises(TableError, match=reason):
        select(columns, NAMES)


@pytest.mark.parametrize(
    ("globs", "count", "reason"),
    [
        (("[s" * 400_000,), 2, "more than 600 characters"),
        (("*a" * 400_000,), 2, "more than 600 characters"),
        (tuple(f"s{number:05}*" for number in range(10_000)), 20_000, "10000 globs are too many for 20000 columns"),
        (("*",) * 1000, 20_000, "column 'g' is used"),
        (("s" * 400_000,), 2, "more than 600 characters"),
    ],
)
def test_slow_globs_are_refused_at_once_and_briefly(globs: tuple[str, ...], count: int, reason: str) -> None:
    names = ["g", *(f"s{number:05}" for number in range(count - 1))]
    with pytest.raises(TableError, match=reason) as refused:
        select(ColumnRoles("g", switches=globs), names)
    assert len(str(refused.value)) < 300


def test_columns_by_their_names_may_be_as_many_as_there_are() -> None:
    names = [f"s{number}" for number in range(50_000)]
    assert [*dict(select(ColumnRoles("g", switches=tuple(names)), ["g", *names]).switches)] == names


def test_a_missed_column_with_brackets_is_answered_with_its_glob() -> None:
    with pytest.raises(TableError, match=r"for the column of that name write 'force\[\[\]N\]'"):
        select(ColumnRoles("g", switches=("force[N]",)), ["g", "force[N]"])
    assert select(ColumnRoles("g", switches=("force[[]N]",)), ["g", "force[N]"]).switches == (("force[N]", None),)

import gzip
import io
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.recordings import TableError
from thenar.compiler.recordings.cells import numbers
from thenar.compiler.recordings.columns import TextFormat
from thenar.compiler.recordings.table import Table, read_table


def csv(content: bytes, folder: Path, delimiter: str = ",") -> Table:
    (folder / "table.csv").write_bytes(content)
    return read_table(folder / "table.csv", TextFormat(delimiter))


def texts(table: Table) -> dict[str, list[str]]:
    return {name: list(map(str, column)) for name, column in table.columns.items()}


def test_a_csv_is_columns_of_text_and_rows_by_their_line(tmp_path: Path) -> None:
    table = csv(b'\xef\xbb\xbfa, b\r\n1,x\r\n\r\n2,"y, ""z"""\r\n', tmp_path)
    assert {name: list(column) for name, column in table.columns.items()} == {"a": ["1", "2"], "b": ["x", 'y, "z"']}
    assert table.rows.tolist() == [2, 4]


def test_blank_lines_before_the_header_are_skipped(tmp_path: Path) -> None:
    table = csv(b"\n\na\n1\n", tmp_path)
    assert (texts(table), table.rows.tolist()) == ({"a": ["1"]}, [4])


def test_a_gzipped_csv_is_the_same_table(tmp_path: Path) -> None:
    path = tmp_path / "t.b.csv.gz"
    path.write_bytes(gzip.compress(b"a;b\n1;2\n"))
    assert texts(read_table(path, TextFormat(";"))) == {"a": ["1"], "b": ["2"]}


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"a,b\n1,2\n3\n", "row 3 has 1 cells, its header 2"),
        (b"a,b\n1,2,3\n", "row 2 has 3 cells, its header 2"),
        (b'a,b\n1,"2\n', "unexpected end of data"),
        (b'a,b\n1,"2"3\n', "row 2: ',' expected after '\"'"),
        (b"a,a\n1,2\n", "column 'a' occurs twice"),
        (b"a,b\n", "has no rows"),
        (b"", "has no rows"),
        (b"a\n\xff\n", "is not UTF-8 text: invalid start byte; save it as UTF-8, or name its `encoding`"),
    ],
)
def test_a_csv_that_is_no_table_is_refused_with_the_row(content: bytes, reason: str, tmp_path: Path) -> None:
    with pytest.raises(TableError, match=f"table.csv.*{reason}"):
        csv(content, tmp_path)


# Without a time stamp: the names of the tests hold these bytes, and two workers must collect the same names.
GZIP = gzip.compress(b"a,b\n1,2\n" * 50, mtime=0)


@pytest.mark.parametrize("damaged", [GZIP[:-9], GZIP[1:], GZIP[:10] + b"\xff" + GZIP[11:], GZIP[:-5] + bytes(5)])
def test_a_damaged_gzip_is_refused(damaged: bytes, tmp_path: Path) -> None:
    (tmp_path / "t.csv.gz").write_bytes(damaged)
    with pytest.raises(TableError, match=r"t\.csv\.gz is damaged"):
        read_table(tmp_path / "t.csv.gz")


def test_arrays_of_an_npz_are_columns(tmp_path: Path) -> None:
    path = tmp_path / "t.npz"
    np.savez(
        path,
        y=np.array(["a", "b"]),
        raw=np.array([b"a", b"b"]),
        X=np.arange(4).reshape(2, 2),
        on=np.array([True, False]),
    )
    table = read_table(path)
    assert {name: list(column) for name, column in table.columns.items()} == {
        "y": ["a", "b"],
        "raw": ["a", "b"],
        "X.0": [0, 2],
        "X.1": [1, 3],
        "on": [1, 0],
    }
    assert table.rows.tolist() == [1, 2]


def _with_a_long_claim(path: Path) -> None:
    """Write an npz of one number, whose head claims eight terabytes in as many bytes as the true one."""
    array = io.BytesIO()
    np.save(array, np.ones(1))
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", array.getvalue().replace(b"(1,), }             ", b"(999999999999,), }  "))


@pytest.mark.parametrize(
    ("arrays", "reason"),
    [
        ({"a": np.zeros(2), "b": np.zeros(3)}, "its arrays have unequal lengths, 2, 3"),
        ({"a": np.zeros((2, 2, 2))}, "array 'a' is not of numbers or text, in one or two dimensions: leave it out"),
        ({"a": np.zeros(2, complex)}, "array 'a' is not of numbers or text"),
        ({"a": np.array([{}, {}])}, "cannot be read as npz: Object arrays cannot be loaded"),
        ({"a": np.zeros(0)}, "has no rows"),
        ({}, "it holds no columns"),
        ({"a.0": np.ones(1), "a": np.ones((1, 2))}, r"two columns are called 'a\.0'"),
        ({"a": np.frombuffer(b"\xff\xff\xff\x7f", "<U1")}, "cannot be read as npz: "),
        (_with_a_long_claim, "it needs more than 600000000 bytes of memory"),
        (lambda path: path.write_bytes(b"a,b\n1,2\n"), "cannot be read as npz: File is not a zip file"),
    ],
    ids=range(10),
)
def test_an_npz_that_is_no_table_is_refused(
    arrays: dict[str, Any] | Callable[[Path], Any], reason: str, tmp_path: Path
) -> None:
    path = tmp_path / "t.npz"
    np.savez(path, **arrays) if isinstance(arrays, dict) else arrays(path)
    with pytest.raises(TableError, match=rf"^t\.npz:? .*{reason}"):
        read_table(path)


def test_another_suffix_is_refused_naming_those_that_are_read(tmp_path: Path) -> None:
    with pytest.raises(TableError, match=r"table\.doc: a table ends in \.csv, .* or \.mat"):
        read_table(tmp_path / "table.doc")


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("tables")


ARFF = st.text("@{}',\"%? \\\nab01").map(
    lambda text: f"@relation r\n@attribute a numeric\n{text}\n@data\n{text}\n".encode()
)


@given(
    st.sampled_from(["csv", "csv.gz", "arff", "arff.gz"]),
    st.one_of(st.binary(), st.text('a1,"\r\n \0').map(str.encode), ARFF),
    st.booleans(),
)
@settings(deadline=None)
def test_any_bytes_are_a_table_or_refused_and_never_crash(
    folder: Path, suffix: str, content: bytes, zipped: bool
) -> None:
    path = folder / f"t.{suffix}"
    path.write_bytes(gzip.compress(content) if zipped else content)
    with suppress(TableError):
        table = read_table(path)
        assert {len(column) for column in table.columns.values()} == {len(table.rows)}


def test_a_number_too_large_for_a_double_becomes_infinite_in_its_row(tmp_path: Path) -> None:
    largest = np.finfo(np.longdouble).max  # on some machines a double's
    np.savez(tmp_path / "t.npz", a=np.array([1, largest, -largest], np.longdouble))
    column = numbers(read_table(tmp_path / "t.npz").columns["a"]).values
    assert column.tolist() == [1.0, float(largest), -float(largest)]

import gzip
import io
import zipfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.compiler.recordings.cells import numbers
from thenar.compiler.recordings.columns import TextFormat
from thenar.compiler.recordings.errors import TableError
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


@pytest.mark.parametrize(
    ("arrays", "reason"),
    [
        ({"a": np.zeros(2), "b": np.zeros(3)}, "its arrays have unequal lengths, 2, 3"),
        ({"a": np.zeros((2, 2, 2))}, "array a.npy: it has 3 dimensions"),
        ({"a": np.zeros(2, complex)}, "array a.npy: it holds '<c16', neither numbers nor text"),
        ({"a": np.array([{}, {}])}, r"cannot be read as npz: array a\.npy: it holds '\|O', neither"),
        ({"a": np.zeros(0)}, "has no rows"),
        ({}, "it holds no arrays"),
    ],
)
def test_an_npz_that_is_no_table_is_refused(arrays: dict[str, Any], reason: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "t.npz", **arrays)
    with pytest.raises(TableError, match=reason):
        read_table(tmp_path / "t.npz")


def _zip(members: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return file.getvalue()


def _npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


ONE = _npy(np.ones(1))
# A header that claims eight terabytes, in as many bytes as the true one.
HUGE = ONE.replace(b"(1,), }             ", b"(999999999999,), }  ")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "File is not a zip file"),
        (b"a,b\n1,2\n", "File is not a zip file"),
        (ONE, "File is not a zip file"),
        (_zip({"a.npy": ONE})[:-30], "File is not a zip file"),
        (_zip({"readme.txt": b"no array at all"}), "it does not begin as a .npy file does"),
        (_zip({"a.npy": ONE[:-1]}), r"array a\.npy: its length does not match its shape \(1,\)"),
        (_zip({"a.npy": ONE.replace(b")", b"(")}), "its head is not what numpy writes"),
        (_zip({"a.npy": HUGE}), "it has more than 1000000 rows"),
        (_zip({"a.npy": ONE}, zipfile.ZIP_BZIP2), r"a\.npy is not compressed as numpy\.savez does"),
        (_zip({"a.0.npy": ONE, "a.npy": _npy(np.ones((1, 2)))}), r"two arrays make a column 'a\.0'"),
    ],
)
def test_what_is_no_npz_is_refused(content: bytes, reason: str, tmp_path: Path) -> None:
    (tmp_path / "t.npz").write_bytes(content)
    with pytest.raises(TableError, match=rf"t\.npz cannot be read as npz: .*{reason}"):
        read_table(tmp_path / "t.npz")


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
    st.sampled_from(["csv", "csv.gz", "arff", "arff.gz", "npz"]),
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

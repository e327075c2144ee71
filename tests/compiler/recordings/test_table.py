import codecs
import gzip
import io
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.recordings import TableError
from thenar.compiler.recordings.cells import numbers
from thenar.compiler.recordings.columns import TextFormat
from thenar.compiler.recordings.table import Table, read_table, sniff

from ...conftest import calls


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
    with pytest.raises(TableError, match=r"table\.doc: a table ends in \.csv, .*\.mat, .* or \.mcap"):
        read_table(tmp_path / "table.doc")


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("tables")


MOTION = st.tuples(st.sampled_from(["PathFileType\t4\n1\n2\n", "x\nendheader\n"]), st.text("a1.,\t\n")).map(
    lambda parts: "".join(parts).encode()
)


@given(
    st.sampled_from(["csv", "csv.gz", "mot", "trc"]),
    st.one_of(st.binary(), st.text('a1,"\r\n \0').map(str.encode), MOTION),
    st.booleans(),
)
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


ROWS = [["Griff", "Person", "Daumen"], ["Größe", "Jörg", "1,5"], ["Haken", "Käthe", "12,25"], ["Haken", "Anna", "3"]]


def written(delimiter: str, encoding: str, rows: list[list[str]] = ROWS) -> bytes:
    quoted = [[f'"{cell}"' if delimiter in cell else cell for cell in row] for row in rows]
    return "".join(delimiter.join(row) + "\r\n" for row in quoted).encode(encoding)


@pytest.mark.parametrize("delimiter", [";", "\t", ",", "|"])
@pytest.mark.parametrize(
    ("encoding", "found"),
    [("utf-8", "utf-8"), ("utf-8-sig", "utf-8"), ("latin-1", "cp1252"), ("cp1252", "cp1252"), ("utf-16", "utf-16")],
)
def test_delimiter_decimal_comma_encoding_and_header_are_found(
    delimiter: str, encoding: str, found: str, tmp_path: Path
) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(written(delimiter, encoding))
    text, reasons = sniff(path)
    assert text == TextFormat(delimiter, ",", found)
    assert [reason.partition(":")[0].split()[0] for reason in reasons] == ["encoding", "delimiter", "decimal", "header"]
    table = read_table(path, text)
    assert {name: list(column) for name, column in table.columns.items()} == {
        name: [row[place] for row in ROWS[1:]] for place, name in enumerate(ROWS[0])
    }


def test_a_gzipped_table_is_looked_into(tmp_path: Path) -> None:
    (tmp_path / "t.csv.gz").write_bytes(gzip.compress(written(";", "latin-1")))
    assert sniff(tmp_path / "t.csv.gz")[0] == TextFormat(";", ",", "cp1252")


@pytest.mark.parametrize(
    ("rows", "header"),
    [
        ([["mug", "0", "1.5"], ["ball", "1", "2.5"], ["can", "0", "3.5"]], False),
        ([["g", "s", "j"], ["mug", "0", "1.5"], ["ball", "1", "2.5"]], True),
        ([["g", "s", "j"], ["mug", "0", ""], ["ball", "1", "NA"]], True),
        ([["g", "h"], ["mug", "a"], ["ball", "b"]], True),
        ([["mug", "a"], ["ball", "a"], ["mug", "b"]], False),
        ([["g", "s", "j"]], True),
    ],
)
def test_a_header_is_told_from_a_row(rows: list[list[str]], header: bool, tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(written(",", "utf-8", rows))
    text = sniff(path)[0]
    assert text.header is header
    if not header:
        table = read_table(path, text)
        assert [*table.columns] == [f"column {number}" for number in range(1, len(rows[0]) + 1)]
        assert table.rows.tolist() == [1, 2, 3]


def test_a_letter_far_down_decides_on_the_encoding(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(b"g,s\n" + b"mug,1\n" * 300_000 + "Größe,0\n".encode("latin-1"))
    assert sniff(path)[0].encoding == "cp1252"
    # Split between two pieces that are read.
    path.write_bytes(b"g,s\n" + b"x" * ((1 << 20) - 5) + "ö,1\nä,0\n".encode())
    assert sniff(path)[0].encoding == "utf-8"


def test_non_utf8_tables_are_windows_1252_if_python_agrees(tmp_path: Path) -> None:
    for byte in range(0x80, 0x100):
        content = b"g,s\nx" + bytes([byte]) + b",1\n"
        (tmp_path / "t.csv").write_bytes(content)
        try:
            content.decode("cp1252")
            expected = "cp1252"
        except UnicodeDecodeError:
            expected = "latin-1"
        assert sniff(tmp_path / "t.csv")[0].encoding == expected, hex(byte)


@pytest.mark.parametrize("signs", ["\",;\t| '\\ab1", "\"'~`,;|", '",a\\', "1.,- ", '"', ",", "*/ int x; /*,"])
def test_a_hostile_sample_is_looked_at_quickly(signs: str, tmp_path: Path) -> None:
    """Long lines of whatever may be a delimiter, a quote or an escape, in two orders."""
    random = Random(1)
    lines = ["".join(random.choices(signs, k=20_000)) for _ in range(30)] + [signs * (20_000 // len(signs))] * 30
    (tmp_path / "t.csv").write_text("\n".join(lines))
    assert calls(lambda: sniff(tmp_path / "t.csv")) < 3_000_000


@pytest.mark.parametrize(
    "content", [b"", b"\n\n", b"x" * 200_000, b"\x81\x8d\xff\n\x00,1\n", codecs.BOM_UTF16_LE + b"a"]
)
def test_near_tables_are_sniffed_quickly_and_refused_by_the_reader(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(content)
    with pytest.raises(TableError):
        read_table(path, sniff(path)[0])

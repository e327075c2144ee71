import codecs
import gzip
from pathlib import Path
from random import Random

import pytest

from thenar.compiler.recordings import TableError
from thenar.compiler.recordings.columns import TextFormat
from thenar.compiler.recordings.table import read_table, sniff

from ...conftest import calls

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

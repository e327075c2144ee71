import gzip
from pathlib import Path

import pytest

from thenar.compiler.recordings import TableError
from thenar.compiler.recordings.table import Table, read_arff, read_table

HEADER = """% a comment
@RELATION 'a b'
@attribute 'my joint' NUMERIC
@ATTRIBUTE s {0, 1}
@attribute\tclass {'Disk (power)', 'Hook, platform, push', "it's", 'it\\'s not', x}

@data
"""


def arff(text: str) -> Table:
    return read_arff("t.arff", text.splitlines(keepends=True))


def test_numbers_nominals_quotes_and_missing_values_are_read() -> None:
    table = arff(
        HEADER + "1.5,0,'Disk (power)'\n% between\n?,1, 'Hook, platform, push'\n\n-2e1 ? \"it's\"\n3,0,'it\\'s not'\n"
    )
    assert {name: list(column) for name, column in table.columns.items()} == {
        "my joint": ["1.5", "?", "-2e1", "3"],
        "s": ["0", "1", "?", "0"],
        "class": ["Disk (power)", "Hook, platform, push", "it's", "it's not"],
    }
    assert table.rows.tolist() == [1, 2, 3, 4]


def test_a_gzipped_arff_is_read_by_its_suffix(tmp_path: Path) -> None:
    (tmp_path / "t.arff.gz").write_bytes(gzip.compress((HEADER + "1,0,x\n").encode()))
    assert list(read_table(tmp_path / "t.arff.gz").columns["class"]) == ["x"]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "t.arff is not ARFF: it has no line @data"),
        ("garbage\n", "t.arff line 1: expected @attribute or @data, not 'garbage'"),
        (HEADER.replace("s {", "'my joint' {"), "line 4: attribute 'my joint' occurs twice"),
        (HEADER.replace("NUMERIC", "string"), "line 3: attribute 'my joint' is string; only numeric and nominal"),
        (HEADER.replace("{0, 1}", "{0, 1"), r"line 4: attribute 's' is \{0, 1; only"),
        (HEADER.replace("s {0, 1}", "s"), "line 4: an attribute has a name and a type"),
        (HEADER + "1,0\n", "row 1 has 2 values, the header 3 attributes"),
        (HEADER + "1,0,x\n1,2,x\n", "row 2: '2' is not among the values of attribute 's'"),
        (HEADER + "{0 1, 2 x}\n", "row 1 cannot be read as values: sparse rows are not read"),
        (HEADER + "1,0,'x\n", "row 1 cannot be read as values: "),
    ],
)
def test_what_is_no_arff_is_refused_with_the_line_or_row(text: str, reason: str) -> None:
    with pytest.raises(TableError, match=reason):
        arff(text)

"""Tables as other programs write them: what import makes of them, or which first oddity it names."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from thenar.compiler import from_dataframe

from .conftest import columns_toml, imported, refusal, refused, works

pytestmark = pytest.mark.usefixtures("importing")

FINGERS = ("thumb", "index", "middle", "ring", "pinky")


def rows(columns: int) -> list[list[str]]:
    """Return 24 rows of grasp, trial and numbers."""
    random = np.random.default_rng(1)
    grasps = [(grasp, trial) for trial in range(1, 9) for grasp in range(3)]
    values = 30 * np.array(grasps)[:, :1] + random.normal(0, 2, (24, columns))
    return [
        ["ABC"[grasp], str(trial), *map("{:.3f}".format, row)]
        for (grasp, trial), row in zip(grasps, values, strict=True)
    ]


def write(path: str, lines: Sequence[Sequence[str]], delimiter: str = ",") -> None:
    Path(path).write_text("".join(delimiter.join(line) + "\n" for line in lines))


@pytest.mark.parametrize("columns", [5, 150, 367, 2000])
def test_a_header_may_be_of_any_length(columns: int, capsys: pytest.CaptureFixture[str]) -> None:
    names = [f"RightHand_{FINGERS[place % 5]}_Phalanx_{place}_Rotation" for place in range(columns)]
    write("manus.csv", [["grasp", "trial", *names], *rows(columns)])
    assert imported("manus.csv").joint_names == tuple(names)
    assert f"{columns:,} joints rounded to codes, at most 0.0" in capsys.readouterr().out


# OpenSim, Vicon Nexus, a spreadsheet saved as text, notes of two cells, and none.
PREFACES = {
    "sto": "Coordinates\nversion=1\nnRows=24\n\nendheader\n",
    "vicon": "Joints,,,,\n100,,,,\n,,Anna:Hand,,\n",
    "notes": "Subject,Anna\nDate,2026-01-02\n\n",
    "one line": "recorded by Anna\n",
    "none": "",
}


@pytest.mark.parametrize("kind", PREFACES)
@pytest.mark.parametrize("delimiter", [",", "\t", " "])
@pytest.mark.parametrize("header", [True, False])
def test_lines_before_the_table_are_left_out(
    kind: str, delimiter: str, header: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    body = rows(4)
    head = [["grasp", "trial", *FINGERS[:4]]] if header else []
    write("t.txt", [*head, *body], delimiter)
    text = Path("t.txt").read_text()
    Path("t.txt").write_text(PREFACES[kind].replace(",", delimiter) + text)
    said = ""
    if header:
        grasp_set = imported("t.txt")
        assert grasp_set.joint_names == FINGERS[:4]
        said = capsys.readouterr().out
    else:
        assert "no column tells which rows are frames of one trial" in refused("t.txt", "--yes")
    lines = PREFACES[kind].count("\n")
    assert (f"skip = {lines}\n" in columns_toml().read_text()) is bool(lines)
    assert ("rows left out at the top" in said) is bool(lines and header)


def test_a_spreadsheet_has_lines_before_its_table_too() -> None:
    frame = pd.DataFrame(rows(3), columns=["grasp", "trial", *FINGERS[:3]]).astype({"trial": int})
    frame = frame.astype(dict.fromkeys(FINGERS[:3], float))
    with pd.ExcelWriter("t.xlsx", engine="openpyxl") as writer:
        pd.DataFrame([["Lab", "Bern"], ["Rate", 100]]).to_excel(writer, index=False, header=False)
        frame.to_excel(writer, index=False, startrow=3)
    grasp_set = imported("t.xlsx")
    assert grasp_set.joint_names == FINGERS[:3]
    assert "skip = 3\n" in columns_toml().read_text()
    columns_toml().write_text(columns_toml().read_text().replace("skip = 3", "skip = 99"))
    said = refusal("import", "t.xlsx", "-o", "c.grasps", "--columns", str(columns_toml()))
    assert "t.xlsx: it holds no cells below row 99 (`skip`)" in said


def test_rows_keep_their_numbers_below_a_preface() -> None:
    write("t.csv", [["grasp", "trial", "a"], *rows(1)])
    text = PREFACES["sto"] + Path("t.csv").read_text()
    Path("t.csv").write_text(text)
    imported("t.csv")
    lines = text.splitlines()
    lines[9] = "A,1,oops"
    Path("t.csv").write_text("\n".join(lines))
    assert "row 10 'a' ('oops')" in refusal("import", "t.csv", "-o", "c.grasps", "--columns", str(columns_toml()))


def test_runs_of_blanks_are_one_delimiter() -> None:
    """As MATLAB's `save -ascii` and numpy.savetxt write them, with a comment for a header."""
    body = [["0" if row[0] == "A" else "1", *row[1:]] for row in rows(3)]
    lines = ["".join(f"{float(cell):16.7e}" for cell in row) + "  " for row in body]
    for head in ("grasp  trial a b\tc", "# grasp trial a b c", "%grasp trial a  b c"):
        Path("t.txt").write_text("\n".join([head, *lines]) + "\n")
        grasp_set = imported("t.txt")
        assert grasp_set.joint_names == ("a", "b", "c")
        assert len(grasp_set) == 24
    np.savetxt("t.csv", np.array(body, float), delimiter=",", header="grasp,trial,a,b,c")
    assert imported("t.csv").joint_names == ("a", "b", "c")


LISTS = {
    "pandas": lambda row: str([float(cell) for cell in row]),
    "numpy": lambda row: str(np.array(row, float)),
    "numpy scalars": lambda row: str(list(np.array(row, float))),
    "tuples": lambda row: str(tuple(map(float, row))),
}


def wide_codes() -> np.ndarray:
    """Return the codes of a table with a column for each number of the lists."""
    wide = pd.DataFrame([[row[0], row[1], *map(float, row[2:])] for row in rows(3)])
    wide.columns = pd.Index(["grasp", "trial", "data.0", "data.1", "data.2"])
    wide.to_csv("u.csv", index=False)
    return imported("u.csv").codes


@pytest.mark.parametrize("kind", LISTS)
def test_lists_in_cells_become_columns(kind: str) -> None:
    table = pd.DataFrame(
        [[row[0], row[1], LISTS[kind](row[2:])] for row in rows(3)], columns=["grasp", "trial", "data"]
    )
    table.to_csv("t.csv", index=False)
    grasp_set = imported("t.csv")
    assert grasp_set.joint_names == ("data.0", "data.1", "data.2")
    assert np.array_equal(grasp_set.codes, wide_codes())


def test_so_do_lists_of_spreadsheets_data_frames_and_parquet() -> None:
    lists = pd.DataFrame(
        [[row[0], int(row[1]), [float(cell) for cell in row[2:]]] for row in rows(3)],
        columns=["grasp", "trial", "data"],
    )
    codes = wide_codes()
    lists.astype({"data": str}).to_excel("t.xlsx", index=False)
    lists.to_parquet("t.parquet")
    for name in ("t.xlsx", "t.parquet"):
        assert np.array_equal(imported(name).codes, codes)
    for made in (lists, lists.assign(data=[np.array(row) for row in lists["data"]])):
        assert np.array_equal(from_dataframe(made).codes, codes)


ODDITIES = {
    'grasp,trial,data\nA,1,"[1, 2]"\nB,1,"[1, 2, 3]"\n': (
        "column 'data' holds lists of unequal lengths, 2 in row 2 and 3 in row 3: write lists of one length"
    ),
    'grasp,trial,data\nA,1,"[1, 2]"\nB,1,x\n': "column 'data' holds lists of numbers, but row 3 has 'x'",
    'grasp,trial,data\nA,1,"[[1, 2], [3, 4]]"\nB,1,"[[1, 2], [3, 4]]"\n': (
        "row 2 has '[[1, 2], [3, 4]]' in column 'data': write a list of numbers in each cell, or a column for each"
    ),
    'grasp,trial,a,data.0,data\nA,1,1,2,"[1, 2]"\nB,1,3,4,"[1, 2]"\n': "column 'data.0' occurs twice",
    "grasp,trial,a\n,,mm\nA,1,1.5\nB,1,2.5\nA,2,3\nB,2,4\n": (
        "row 2 has 'mm' in column 'a', which holds numbers elsewhere: correct the cell or delete the row"
    ),
    "grasp,trial,a\nA,1,1.5\nB,1,2.5\nA,2,3\nB,2,4,5,6\n": "row 5 has 5 cells, its header 3",
    "grasp,trial\nA,1,1.5\nB,1,2.5\nA,2,3\nB,2,4\n": "row 2 has 3 cells, its header 2",
    "grasp-trial-a\nA-1-1.5\nB-1-2.5\n": "its rows have one cell each, under 'grasp-trial-a': name the `delimiter`",
}


@pytest.mark.parametrize("text", ODDITIES, ids=range(len(ODDITIES)))
def test_the_error_names_the_first_oddity(text: str) -> None:
    Path("t.csv").write_text(text)
    assert ODDITIES[text] in refused("t.csv", "--yes")


def test_a_column_with_a_broken_cell_is_left_out_by_its_row() -> None:
    broken = "grasp,trial,a,b\nA,1,0,1.5\nB,1,x,2.5\nA,2,1,3\nB,2,1,4\n"
    Path("t.csv").write_text(broken)
    told = " ".join(works("import", "t.csv", "-o", "t.grasps", "--yes").stdout.replace("│", " ").split())
    assert "a left out row 3 has 'x' in column 'a', which holds numbers elsewhere: correct the cell" in told
    Path("t.csv").write_text(broken.replace("grasp", "kind"))
    done = works("import", "t.csv", "-o", "t.grasps", "--yes", "--overwrite")
    assert "kind label" in " ".join(done.stdout.replace("│", " ").split())

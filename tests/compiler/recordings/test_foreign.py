import sys
from datetime import datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from thenar.compiler.recordings import foreign
from thenar.compiler.recordings.errors import TableError
from thenar.compiler.recordings.table import Table, read_table

GRASPS = ["Größe", "hook", "pin"]
JOINTS = [1.5, float("nan"), -2e-7]
PADS = [[0, 4095], [12, 7], [3, 65535]]


def check(path: Path, rows: list[int]) -> None:
    """Hold what is read of `path` against what was written."""
    table = read_table(path)
    columns: dict[str, Any] = dict(table.columns)
    assert list(columns.pop("grasp")) == GRASPS
    assert np.array_equal(columns.pop("flex"), JOINTS, equal_nan=True)
    assert [columns.pop(name).tolist() for name in ("pads.0", "pads.1")] == np.transpose(PADS).tolist()
    assert not columns
    assert table.rows.tolist() == rows


@pytest.fixture
def frame() -> pd.DataFrame:
    pads = {f"pads.{number}": column for number, column in enumerate(np.transpose(PADS))}
    return pd.DataFrame({"grasp": GRASPS, "flex": JOINTS, **pads})


@pytest.mark.parametrize("suffix", ["xlsx", "XLSX"])
def test_a_spreadsheet_is_read_by_the_rows_that_it_shows(frame: pd.DataFrame, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"t.{suffix}"
    with pd.ExcelWriter(tmp_path / "t.xlsx", engine="openpyxl") as writer:
        pd.DataFrame().to_excel(writer, sheet_name="empty")
        frame.to_excel(writer, sheet_name="glove", index=False, startrow=2)
    (tmp_path / "t.xlsx").rename(path)
    check(path, [4, 5, 6])


def test_cells_of_a_spreadsheet_become_numbers_or_text(tmp_path: Path) -> None:
    mixed = [3, 2.5, "T1", True, datetime(2026, 1, 2, 3), None]
    frame = pd.DataFrame({"mixed": pd.Series(mixed, dtype=object), "on": [True, False] * 3, "": [1] * 6})
    frame.to_excel(tmp_path / "t.xlsx", index=False)
    table = read_table(tmp_path / "t.xlsx")
    assert list(table.columns["mixed"]) == ["3", "2.5", "T1", "True", "2026-01-02 03:00:00", ""]
    assert list(table.columns["on"]) == [1, 0] * 3
    assert list(table.columns) == ["mixed", "on", "column 3"]


def test_parquet_is_read(frame: pd.DataFrame, tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    frame.astype({"grasp": "category"}).to_parquet(path, index=False)
    check(path, [1, 2, 3])
    pads = pd.DataFrame({"grasp": GRASPS, "flex": JOINTS, "pads": PADS})
    pads.to_parquet(path, index=False)
    check(path, [1, 2, 3])


@pytest.mark.parametrize("text", ["variable", "fixed"])
def test_hdf5_is_read(text: str, tmp_path: Path) -> None:
    with h5py.File(tmp_path / "t.h5", "w") as file:
        file["grasp"] = GRASPS if text == "variable" else np.char.encode(GRASPS, "utf-8")
        file["flex"], file["pads"], file["rate"] = JOINTS, PADS, 50.0
    check(tmp_path / "t.h5", [1, 2, 3])


def test_records_of_hdf5_are_columns(tmp_path: Path) -> None:
    records = np.array([(1, (2.0, 3.0)), (4, (5.0, 6.0))], [("a", "i4"), ("b", "f8", 2)])
    with h5py.File(tmp_path / "t.h5", "w") as file:
        file["glove/table"] = records
    columns = read_table(tmp_path / "t.h5").columns
    assert {name: list(column) for name, column in columns.items()} == {
        "glove/table.a": [1, 4],
        "glove/table.b.0": [2, 5],
        "glove/table.b.1": [3, 6],
    }


@pytest.mark.parametrize("structured", [True, False])
def test_matlab_is_read(structured: bool, tmp_path: Path) -> None:
    variables = {"grasp": np.array(GRASPS, object), "flex": JOINTS, "pads": PADS, "rate": 50}
    savemat(tmp_path / "t.mat", {"glove": variables} if structured else variables, oned_as="column")
    check(tmp_path / "t.mat", [1, 2, 3])


def test_matlab_7_3_is_read(tmp_path: Path) -> None:
    # As MATLAB writes it: transposed, text in UTF-16 behind references, and a block of its own before all.
    with h5py.File(tmp_path / "t.mat", "w", userblock_size=512) as file:
        references = []
        for number, grasp in enumerate(GRASPS):
            file[f"#refs#/{number}"] = np.frombuffer(grasp.encode("utf-16-le"), np.uint16)[:, None]
            references.append(file[f"#refs#/{number}"].ref)
        cell = file.create_dataset("grasp", (1, 3), h5py.ref_dtype)
        cell[0] = references
        cell.attrs["MATLAB_class"] = np.bytes_("cell")
        file["flex"], file["pads"], file["rate"] = [JOINTS], np.transpose(PADS), [[50.0]]
    content = (tmp_path / "t.mat").read_bytes()
    (tmp_path / "t.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(128) + content[128:])
    check(tmp_path / "t.mat", [1, 2, 3])


def hdf5(path: Path, **datasets: Any) -> Path:
    with h5py.File(path, "w") as file:
        for name, data in datasets.items():
            file.create_dataset(name, **data) if isinstance(data, dict) else file.create_dataset(name, data=data)
    return path


def refused(path: Path) -> str:
    with pytest.raises(TableError) as found:
        read_table(path)
    assert 0 < len(str(found.value)) < 1000
    assert str(found.value).startswith(f"{path.name}: ")
    return str(found.value)


@pytest.mark.parametrize("suffix", foreign.READERS)
@pytest.mark.parametrize(
    "content", [b"", b"junk" * 999, b"PK\3\4" + bytes(99), b"PAR1\1\0\0\0PAR1", b"\x89HDF\r\n\x1a\n\0\0"]
)
def test_what_is_no_such_file_is_refused_in_a_sentence(suffix: str, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / f"t{suffix}"
    path.write_bytes(content)
    assert f"cannot be read as {foreign.READERS[suffix][0]}" in refused(path)


def test_a_claim_of_terabytes_is_refused(tmp_path: Path) -> None:
    claimed = hdf5(tmp_path / "t.h5", a={"shape": (1_000_000, 90_000), "dtype": "f8", "chunks": (1000, 10)})
    assert "needs more than 600000000 bytes of memory" in refused(claimed)
    claimed = hdf5(tmp_path / "u.h5", a={"shape": (10**12,), "dtype": "u1", "chunks": (1000,)})
    assert "more than 1000000 rows or 100000 columns" in refused(claimed)


def test_arrays_of_several_lengths_and_columns_of_one_name_are_no_table(tmp_path: Path) -> None:
    assert "its arrays have unequal lengths, 2, 3" in refused(hdf5(tmp_path / "t.h5", a=[1, 2], b=[1, 2, 3]))
    pd.DataFrame([["a", 1]], columns=["g", "g"]).to_excel(tmp_path / "t.xlsx", index=False)
    assert "two columns are called 'g'" in refused(tmp_path / "t.xlsx")
    pd.DataFrame().to_excel(tmp_path / "u.xlsx")
    assert "it holds no sheet with cells" in refused(tmp_path / "u.xlsx")


def test_no_other_file_is_read_through_hdf5(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(b"1234")
    elsewhere = [("secret", 0, 4)]
    linked = hdf5(tmp_path / "t.h5", a={"shape": (4,), "dtype": "u1", "external": elsewhere}, b=[1, 2, 3, 4])
    assert "'a' lies in another file" in refused(linked)


def test_a_reader_that_crashes_ends_no_more_than_the_import(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    crash = tmp_path / "crash"
    crash.write_text("#!/bin/sh\nkill -SEGV $$\n")
    crash.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(crash))
    (tmp_path / "t.xlsx").write_bytes(b"")
    assert "its reader gave up: the file is damaged" in refused(tmp_path / "t.xlsx")


def test_what_is_read_is_the_same_table_in_every_format(frame: pd.DataFrame, tmp_path: Path) -> None:
    frame.to_csv(tmp_path / "t.csv", index=False)
    frame.to_excel(tmp_path / "t.xlsx", index=False)
    tables: list[Table] = [read_table(tmp_path / name) for name in ("t.csv", "t.xlsx")]
    assert [list(table.columns) for table in tables] == [list(frame)] * 2
    assert [float(cell) for cell in tables[0].columns["pads.1"]] == list(tables[1].columns["pads.1"])
    assert tables[0].rows.tolist() == tables[1].rows.tolist()

import os
import select
import subprocess
import sys
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from thenar.compiler.recordings import TableError, foreign
from thenar.compiler.recordings.table import read_table

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


@pytest.mark.parametrize("structured", [True, False])
def test_matlab_is_read(structured: bool, tmp_path: Path) -> None:
    variables = {"grasp": np.array(GRASPS, object), "flex": JOINTS, "pads": PADS, "rate": 50}
    savemat(tmp_path / "t.mat", {"glove": variables} if structured else variables, oned_as="column")
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


# Beginnings of files, by the suffixes of those that they begin.
BEGINNINGS = {
    **dict.fromkeys((".xlsx", ".ods", ".npz"), b"PK\3\4" + bytes(99)),
    ".xls": b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(99),
    ".parquet": b"PAR1\1\0\0\0PAR1",
    **dict.fromkeys((".h5", ".hdf5"), b"\x89HDF\r\n\x1a\n\0\0"),
    ".mat": b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM" + b"\xff" * 40,
    ".c3d": b"\2P" + bytes(600),
    ".bag": b"#ROSBAG V2.0\n" + bytes(40),
    ".db3": b"SQLite format 3\0" + bytes(100),
    ".mcap": b"\x89MCAP0\r\n\1" + (16).to_bytes(8, "little") + b"\4\0\0\0ros2\4\0\0\0peer" + bytes(40),
}


@pytest.mark.parametrize(
    ("suffix", "content"),
    [
        *((suffix, BEGINNINGS[suffix]) for suffix in foreign.READERS),
        *(
            (suffix, content)
            for suffix in (".xlsx", ".parquet", ".h5", ".npz", ".mat", ".c3d", ".bag", ".db3")
            for content in (b"", b"junk" * 999)
        ),
    ],
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
    assert "'/a' lies in another file" in refused(linked)
    layout = h5py.VirtualLayout(shape=(4,), dtype="f8")
    layout[:] = h5py.VirtualSource(hdf5(tmp_path / "u.h5", a=[1.0, 2.0, 3.0, 4.0]), "a", shape=(4,))
    with h5py.File(tmp_path / "v.h5", "w") as file:
        file.create_virtual_dataset("a", layout)
    assert "'/a' lies in another file" in refused(tmp_path / "v.h5")
    # A link to a dataset of another file is not followed.
    with h5py.File(tmp_path / "w.h5", "w") as file:
        file["a"] = h5py.ExternalLink("u.h5", "a")
    assert "it holds no columns" in refused(tmp_path / "w.h5")


def test_matlab_7_3_is_refused_with_what_to_save_instead(tmp_path: Path) -> None:
    path = hdf5(tmp_path / "t.mat", a=[1, 2])
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM" + path.read_bytes())
    assert "save it with the option -v7" in refused(path)


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("kill -SEGV $$", "its reader gave up: the file is damaged"),
        ("kill -XCPU $$", "its reader took longer than 60 s of processor time: save it as CSV"),
        ("exec sleep 600", "its reader took longer than 0 s: save it as CSV"),
    ],
)
def test_a_crashing_or_endless_reader_ends_only_the_import(
    script: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "program"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))
    if "sleep" in script:
        monkeypatch.setattr(foreign, "WALL", 0)
    (tmp_path / "t.xlsx").write_bytes(b"")
    assert said in refused(tmp_path / "t.xlsx")


def test_a_reader_out_of_processor_time_says_so(tmp_path: Path) -> None:
    """The limit at which SIGXCPU comes, which says why, is below the one of SIGKILL, which does not."""
    limits = "from thenar.compiler.recordings import foreign; import resource; foreign._limit(0);"
    program = f"{limits} print(resource.getrlimit(resource.RLIMIT_CPU))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "(60, 65)\n"


def test_a_killed_import_leaves_no_reader_and_no_folder(tmp_path: Path) -> None:
    (tmp_path / "import").mkdir()
    # The reader reports its number, and would not end by itself.
    reader = tmp_path / "calls.py"
    reader.write_text(
        "import os, signal, sys\n"
        "from thenar.compiler.recordings import foreign\n"
        "foreign._end_with(int(sys.argv[-2]))\n"
        "print(os.getpid(), file=open(os.environ['TOLD'], 'w'), flush=True)\n"
        "signal.pause()\n"
    )
    program = tmp_path / "program"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{reader}" "$@"\n')
    program.chmod(0o755)
    (tmp_path / "t.xlsx").write_bytes(b"")
    os.mkfifo(tmp_path / "told")
    begin = f"import sys; sys.executable = {str(program)!r}; from pathlib import Path\n"
    begin += f"from thenar.compiler.recordings.table import read_table; read_table(Path({str(tmp_path / 't.xlsx')!r}))"
    environment = os.environ | {"TMPDIR": str(tmp_path / "import"), "TOLD": str(tmp_path / "told")}
    with subprocess.Popen([sys.executable, "-c", begin], env=environment) as importing:
        number = int((tmp_path / "told").read_text())
        importing.kill()
    with suppress(ProcessLookupError):
        assert select.select([os.pidfd_open(number)], [], [], 60)[0], "the reader lives on"
    assert not list((tmp_path / "import").iterdir())

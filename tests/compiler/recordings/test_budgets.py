"""What hostile tables may cost: 200 MB and twenty times their size of memory, and a time that grows as they do."""

import gzip
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.recordings import TableError, unpacked
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.table import read_table
from thenar.compiler.recordings.taxonomy import published

SWITCHES = 'label = "g"\nframes = "independent"\nswitches = ["s*"]\n'
JOINTS = 'label = "g"\nframes = "independent"\n[[joints]]\ncolumns = ["s*"]\n'
DROP = 'missing = "drop"\n' + JOINTS
NAMED = 'subject = "u"\nobject = "o"\n' + SWITCHES

# In a process that imports what the command does. VmHWM: ru_maxrss would count what the parent had at the fork.
PROGRAM = """
import sys
from pathlib import Path
import thenar.cli.import_command
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.importer import import_file
from thenar.drivers.errors import ThenarError
try:
    GraspSet.load(sys.argv[1]) if sys.argv[1].endswith(".grasps") else import_file(*map(Path, sys.argv[1:]))
except ThenarError as refused:
    assert 0 < len(str(refused)) < 1000
status = Path("/proc/self/status").read_text()
print(status.partition("VmHWM:")[2].split()[0])
"""


def csv(columns: int, cell: str, rows: int, label: str = "a") -> bytes:
    head = ",".join(["g", *(f"s{number}" for number in range(columns))])
    return (f"{head}\n" + (label + f",{cell}" * columns + "\n") * rows).encode()


HOSTILE: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "narrow": ("csv", lambda: csv(1, "1", 400_000), JOINTS),
    "two digits": ("csv", lambda: csv(22, "12", 40_000), JOINTS),
    "empty": ("csv", lambda: csv(200, "", 10_000) + b"a" + b",1" * 200, DROP),
    "wide": ("csv", lambda: csv(99_000, "1", 4), JOINTS),
    "too wide": ("csv", lambda: b"g," + b"ab," * 4_000_000 + b"\n", SWITCHES),
    "too long": ("csv", lambda: b"g\n" + b"1\n" * 2_000_000, SWITCHES),
    "long line": ("csv", lambda: b"g,s\n" + b"a" * 30_000_000, SWITCHES),
    "cells over lines": ("csv", lambda: b"g,s\n" + b'"a\n",' * 2_000_000, SWITCHES),
    "long name": ("csv", lambda: b"g,s\n" + b"x" * 100_000 + b",1\n" + b"a,1\n" * 200_000, SWITCHES),
    "all different": (
        "csv",
        lambda: b"g,u,o,s\n" + b"".join(b"%x,%x,%x,1\n" % (i, i, i) for i in range(90_000)),
        NAMED,
    ),
    "bomb": ("csv.gz", lambda: gzip.compress(b"g,s\n" + b" " * 300_000_000, 1), SWITCHES),
    "packed": ("csv.gz", lambda: gzip.compress(csv(1, "1", 1_000_000)[:5_900_000]), JOINTS),
    "packed and wide": ("csv.gz", lambda: gzip.compress(csv(99_000, "1", 26)), JOINTS),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_table_takes_no_more_memory_than_its_size_allows(name: str, tmp_path: Path) -> None:
    suffix, content, columns = HOSTILE[name]
    table = tmp_path / f"t.{suffix}"
    table.write_bytes(content())
    (tmp_path / "columns.toml").write_text(columns)
    assert _peak(table, tmp_path / "columns.toml") < 220_000_000 + 20 * table.stat().st_size


@pytest.mark.slow
def test_a_set_takes_no_more_memory_than_its_size_allows(tmp_path: Path) -> None:
    rows, columns = 200_000, 400
    GraspSet(
        switches=np.zeros((rows, columns), np.bool_),
        switch_names=tuple(f"s{number}" for number in range(columns)),
        codes=np.zeros((rows, 0), np.uint16),
        joints=(),
        grasps=np.full(rows, "Index Finger Extension"),
        taxonomy=published("feix33"),
        subjects=np.full(rows, "a" * 60),
        objects=np.full(rows, "b" * 60),
        trials=np.arange(rows),
    ).save(tmp_path / "t.grasps")
    assert _peak(tmp_path / "t.grasps") < 220_000_000 + 20 * (tmp_path / "t.grasps").stat().st_size


def _peak(*files: Path) -> int:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *map(str, files)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return int(done.stdout) * 1000


@pytest.mark.parametrize(
    ("suffix", "content", "reason"),
    [
        ("csv", b"g," + b"a," * 200_000 + b"\n", "more than 100000 columns"),
        ("csv", b"a\n" + b"1\n" * 1_000_001, "more than 1000000 rows"),
        ("csv", b"a" * 16_000_001, "line 1 is longer than 16000000 characters"),
        (
            "csv.gz",
            gzip.compress(b"a\n" + b" " * 10_000_000, mtime=0),
            "unpacks to more than 6.*: unpack it and import",
        ),
    ],
    ids=range(4),
)
def test_what_is_beyond_a_limit_is_refused_with_the_limit(
    suffix: str, content: bytes, reason: str, tmp_path: Path
) -> None:
    (tmp_path / f"t.{suffix}").write_bytes(content)
    with pytest.raises(TableError, match=rf"^t\.{suffix} .*{reason}"):
        read_table(tmp_path / f"t.{suffix}")


def test_a_link_to_an_endless_device_is_refused(tmp_path: Path) -> None:
    for suffix in ("csv", "csv.gz", "mot", "npz"):
        (tmp_path / f"t.{suffix}").symlink_to("/dev/zero")
        with pytest.raises(TableError, match="is a device or a pipe"):
            read_table(tmp_path / f"t.{suffix}")


def test_a_line_of_ten_megabytes_is_read(tmp_path: Path) -> None:
    names = [f"{number:0100}" for number in range(99_000)]
    (tmp_path / "t.csv").write_text(f"{','.join(names)}\n" + ",".join("1" * 99_000))
    assert list(read_table(tmp_path / "t.csv").columns) == names


def test_what_a_packed_table_may_unpack_to_grows_with_its_file() -> None:
    assert unpacked(0) == 6_000_000
    assert unpacked(10_000_000) == 16_000_000
    assert unpacked(10**12) == 1_000_000_000

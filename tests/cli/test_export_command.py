import json
from dataclasses import replace
from pathlib import Path

import pytest

from thenar.cli import run
from thenar.compiler import GraspSet

from .conftest import refusal, works


@pytest.mark.parametrize("suffix", ["csv", "csv.gz", "tsv", "tsv.gz", "parquet"])
@pytest.mark.parametrize("flags", [[], ["--codes"]])
def test_an_exported_table_imports_again(grasps: Path, suffix: str, flags: list[str]) -> None:
    table, columns, again = (str(grasps.with_name(name)) for name in (f"t.{suffix}", "columns.toml", "again.grasps"))
    assert run(["export", str(grasps), "-o", table, "--columns", columns, *flags]) == 0
    assert run(["import", table, "-o", again, "--columns", columns]) == 0
    assert GraspSet.load(again).fingerprint() == GraspSet.load(grasps).fingerprint()


def test_machines_are_told_what_was_written(grasps: Path) -> None:
    table = grasps.with_name("t.csv")
    done = works("export", grasps, "-o", table, "--json")
    assert json.loads(done.stdout) == {"output": str(table), "columns": None, "trials": 4, "frames": 4}


def test_values_are_written_unless_codes_are_asked_for(grasps: Path) -> None:
    table = grasps.with_name("t.csv")
    assert run(["export", str(grasps), "-o", str(table)]) == 0
    assert table.read_text().splitlines()[1] == "mug,A,x,0,0,1,11.5"
    assert run(["export", str(grasps), "-o", str(table), "--codes", "--overwrite"]) == 0
    assert table.read_text().splitlines()[1] == "mug,A,x,0,0,1,3"


def test_simulated_grasps_stay_simulated_on_the_way_through_a_table(grasps: Path) -> None:
    table, columns, again = (str(grasps.with_name(name)) for name in ("t.csv", "columns.toml", "again.grasps"))
    replace(GraspSet.load(grasps), simulated='scene "x", seed 1').save(grasps)
    assert run(["export", str(grasps), "-o", table, "--columns", columns]) == 0
    assert run(["import", table, "-o", again, "--columns", columns]) == 0
    assert GraspSet.load(again).simulated == 'scene "x", seed 1'
    assert Path(again).read_bytes() == grasps.read_bytes()


def test_a_damaged_set_is_refused_with_the_reason(grasps: Path) -> None:
    grasps.write_bytes(grasps.read_bytes()[:-1])
    for arguments in (("export", grasps, "-o", grasps.with_name("t.csv")), ("info", grasps)):
        assert refusal(*arguments).startswith("thenar: set.grasps is truncated: ")

import hashlib
import json
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from msgspec.structs import replace as replace_fields

from thenar.runtime.manifest import manifest_from_bytes, manifest_to_bytes
from thenar.runtime.tables import tables_from_bytes, tables_to_bytes

Thenar = Callable[..., subprocess.CompletedProcess[str]]


def _silence_joints(folder: Path) -> None:
    tables = tables_from_bytes((folder / "tables.bin").read_bytes())
    rows = tuple(0 * rows for rows in tables.joint_rows)
    data = tables_to_bytes(replace(tables, joint_rows=rows, joint_means=0 * tables.joint_means))
    manifest = manifest_from_bytes((folder / "build.json").read_bytes())
    (folder / "tables.bin").write_bytes(data)
    described = replace_fields(manifest, tables_sha256=hashlib.sha256(data).hexdigest())
    (folder / "build.json").write_bytes(manifest_to_bytes(described))


def test_a_sound_build_holds(thenar: Thenar, set_file: Path, build_folder: Path) -> None:
    done = thenar("verify", build_folder, set_file)
    assert done.returncode == 0, done.stderr
    assert "60 rows, the ones that the build was made from" in done.stdout
    assert done.stdout.endswith("holds\n")


def test_the_worst_of_all_frames_is_printed_beside_its_bounds(
    thenar: Thenar, set_file: Path, build_folder: Path
) -> None:
    lines = thenar("verify", build_folder, set_file).stdout.splitlines()
    worst = json.loads(thenar("verify", build_folder, set_file, "--json").stdout)["worst"]
    codes = " ".join(map(str, worst["codes"]))
    assert (
        f"worst frame there is: {worst['leader']} loses {worst['loss']:.3f} steps of its lead over {worst['rival']}, "
        f"allowed {worst['bound']:.3f} ({len(worst['closed'])} switches closed, codes {codes})"
    ) in lines
    assert (
        f"margin above {worst['safe_margin']:.3f} steps, all that the worst frames ask for: "
        f"{worst['covered']} rows, of which 0 change class"
    ) in lines
    assert (
        f"furthest sum there is, whole or with inputs missing: {worst['reach']} for {worst['reaching']}, allowed 32767"
    ) in lines


def test_a_broken_bound_exits_with_1_and_lists_rows(thenar: Thenar, set_file: Path, build_folder: Path) -> None:
    _silence_joints(build_folder)
    done = thenar("verify", build_folder, set_file)
    assert done.returncode == 1
    assert "DOES NOT HOLD" in done.stdout
    assert "  row " in done.stdout


def test_json_lists_every_changed_row(thenar: Thenar, set_file: Path, build_folder: Path) -> None:
    _silence_joints(build_folder)
    done = thenar("verify", build_folder, set_file, "--json")
    found = json.loads(done.stdout)
    assert done.returncode == 1
    assert found["holds"] is False
    assert all(row["ensemble"] != row["integers"] for row in found["changed"])
    assert found["changed"]

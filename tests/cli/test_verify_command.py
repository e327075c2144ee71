import hashlib
import json
from pathlib import Path

import pytest
from msgspec import to_builtins
from msgspec.structs import replace as replace_fields

from thenar.cli.verify_command import print_firmware, verdict
from thenar.compiler.artifact.verify_firmware import Difference, FirmwareVerification, TargetCheck
from thenar.runtime.manifest_file import manifest_from_bytes, manifest_to_bytes
from thenar.runtime.model.integers import tables_from_bytes, tables_to_bytes

from ..conftest import tool
from .conftest import refusal, thenar, works


def _silence_joints(folder: Path) -> None:
    tables = tables_from_bytes((folder / "tables.bin").read_bytes())
    rows = tuple(0 * rows for rows in tables.joint_rows)
    silent = tables.changed(joint_rows=rows, joint_means=0 * tables.joint_means)
    data = tables_to_bytes(silent)
    manifest = manifest_from_bytes((folder / "build.json").read_bytes())
    (folder / "tables.bin").write_bytes(data)
    proof = replace_fields(manifest.proof, bound=silent.bound)
    described = replace_fields(manifest, tables_sha256=hashlib.sha256(data).hexdigest(), proof=proof)
    (folder / "build.json").write_bytes(manifest_to_bytes(described))


def test_a_sound_build_holds(set_file: Path, build_folder: Path) -> None:
    done = works("verify", build_folder, set_file)
    assert "60 rows of 60 trials; the build was trained on 60 of these trials" in done.stdout
    assert done.stdout.endswith("holds\n")


def test_the_worst_of_all_frames_is_printed_beside_its_bounds(set_file: Path, build_folder: Path) -> None:
    lines = thenar("verify", build_folder, set_file).stdout.splitlines()
    worst = json.loads(thenar("verify", build_folder, set_file, "--json").stdout)["worst"]
    codes = " ".join(map(str, worst["codes"]))
    assert (
        f"worst possible frame: {worst['leader']} loses {worst['loss']:.3f} steps of its lead over "
        f"{worst['competitor']}, allowed {worst['bound']:.3f} ({len(worst['closed'])} switches closed, codes {codes})"
    ) in lines
    assert (
        f"margin above {worst['safe_margin']:.3f} steps, which covers the worst frames: "
        f"{worst['covered']} rows, of which 0 change class"
    ) in lines
    assert f"largest possible sum, with or without missing inputs: {worst['reach']}, allowed 32767" in lines


def test_a_broken_bound_exits_with_1_and_lists_rows(set_file: Path, build_folder: Path) -> None:
    _silence_joints(build_folder)
    done = thenar("verify", build_folder, set_file)
    assert done.returncode == 1
    assert "DOES NOT HOLD" in done.stdout
    assert "  row " in done.stdout


@pytest.mark.slow
def test_firmware_is_compiled_and_held_against_python(set_file: Path, build_folder: Path) -> None:
    tool("gcc")
    done = works("verify", build_folder, set_file, "--firmware", "host")
    assert "host: every score, grasp type, margin and probability of " in done.stdout
    assert "the build carries the firmware that thenar makes of it now" in done.stdout
    found = json.loads(thenar("verify", build_folder, set_file, "--firmware", "host", "--json").stdout)
    checks = found["firmware"]["checks"]
    assert [(check["missing"], check["differing"]) for check in checks] == [(False, 0), (True, 0)]
    assert found["holds"] is True


def test_firmware_that_is_not_the_builds_is_exit_code_1(set_file: Path, build_folder: Path) -> None:
    tool("gcc")
    (build_folder / "firmware" / "thenar_glove.h").write_text("")
    done = thenar("verify", build_folder, set_file, "--firmware", "host")
    assert done.returncode == 1
    assert "firmware/thenar_glove.h: not what thenar makes of the build now" in done.stdout
    assert done.stdout.endswith("DOES NOT HOLD: compile the build again\n")


def test_firmware_for_what_there_is_not_is_refused_with_what_there_is(set_file: Path, build_folder: Path) -> None:
    assert "there is no target 'pdp11': choose one of host, avr, micropython" in refusal(
        "verify", build_folder, set_file, "--firmware", "host,pdp11"
    )


def test_a_difference_is_shown_with_both_answers(capsys: pytest.CaptureFixture[str]) -> None:
    first = Difference("row 3", ("s1",), (7, 8), "cup", (5, 4), "pen", (5, 6), (1, 40000), (1, 40001))
    check = TargetCheck(
        part="atmega328p",
        missing=False,
        shares=True,
        frames=10,
        differing=2,
        first=first,
        misnamed=3,
        worst=900,
        unit="instructions",
        stack=None,
    )
    found = FirmwareVerification(rows=4, extreme=3, random=3, checks=(check,), outdated=None)
    print_firmware(found)
    assert capsys.readouterr().out.splitlines() == [
        "firmware, on 4 rows, 3 extreme and 3 random frames:",
        "  atmega328p: 2 of 10 frames DIFFER; the first:",
        "    3 of the grasp types have ANOTHER NAME",
        "    row 3: Python cup, scores 5 4; compiled pen, scores 5 6; --json has the frame",
        "  the build carries no firmware",
    ]
    assert verdict(found).endswith("a bug of thenar or of the compiler: report it, with the first frame shown")
    assert "compile the build again" not in verdict(found)


def test_the_worst_faults_are_in_build_json_report_and_spec(set_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "build"
    done = works("compile", set_file, "-o", folder, "--rounds", "5", "--folds", "0")
    printed = thenar("verify", folder, set_file, "--faults").stdout.splitlines()
    found = json.loads(thenar("verify", folder, set_file, "--faults", "--json").stdout)
    manifest = manifest_from_bytes((folder / "build.json").read_bytes())
    assert manifest.faults is not None
    assert found["worst"] == json.loads(json.dumps(to_builtins(manifest.faults)))
    assert [each["name"] for each in found["inputs"]] == [
        *(switch.name for switch in manifest.switches),
        *(joint.name for joint in manifest.joints),
    ]
    assert min(each["lost"] for each in found["inputs"]) == found["worst"]["lost"]["correct"]
    assert min(each["stuck"] for each in found["inputs"]) == found["worst"]["stuck"]["correct"]
    page, spec = (folder / "report.html").read_text(), json.loads((folder / "spec" / "spec.json").read_text())
    assert spec["expected"]["faults"] == found["worst"]
    for sentence in manifest.faults.sentences:
        assert f"  {sentence}" in printed
        assert f"<dd>{sentence.replace(chr(39), '&#39;')}</dd>" in page
        assert f"at worst, on training rows: {sentence}" in done.stdout
    assert "give one of them" in refusal("verify", folder, set_file, "--faults", "--firmware", "host")

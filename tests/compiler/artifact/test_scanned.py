"""A build compiled for a harness: its scan map, its bytes, and its verification."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.artifact.documents import REPORT_NAME
from thenar.compiler.artifact.staging import MEMBERS
from thenar.compiler.artifact.verify import ScanCheck, check_scan, verify
from thenar.runtime import Build
from thenar.runtime.build import SCAN_NAME
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.wiring import BusWiring, Harness
from thenar.runtime.scanning.plan import check_harness
from thenar.runtime.scanning.propose import propose_harness
from thenar.runtime.scanning.scanmap import scanmap_to_bytes


@pytest.fixture(scope="module")
def harness(grasp_set: GraspSet) -> Harness:
    """All switches of the recordings, seven a chip; kept ones among them."""
    return propose_harness(grasp_set.switch_names, "mcp23008")


def _bytes(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_the_build_holds_a_map_of_the_harness_and_says_its_checksum(
    grasp_set: GraspSet, harness: Harness, tmp_path: Path
) -> None:
    report = compile_build(grasp_set, tmp_path / "build", rounds=4, folds=0, harness=harness)
    files = _bytes(tmp_path / "build")
    assert set(files) == MEMBERS - {REPORT_NAME}
    assert report.manifest.scan_sha256 == hashlib.sha256(files[SCAN_NAME]).hexdigest()
    assert report.scan is not None
    assert files[SCAN_NAME] == scanmap_to_bytes(report.scan)
    build = Build.load(tmp_path / "build")
    assert build.scan == report.scan
    check_harness(report.scan, harness, [switch.name for switch in build.manifest.switches])


def test_all_but_the_map_is_as_without_a_harness(grasp_set: GraspSet, harness: Harness, tmp_path: Path) -> None:
    compile_build(grasp_set, tmp_path / "with", rounds=4, folds=0, harness=harness)
    assert compile_build(grasp_set, tmp_path / "without", rounds=4, folds=0).scan is None
    found, plain = _bytes(tmp_path / "with"), _bytes(tmp_path / "without")
    assert {name: found[name] for name in ("tables.bin", "ensemble.bin")} == {
        name: plain[name] for name in ("tables.bin", "ensemble.bin")
    }
    assert set(plain) == MEMBERS - {SCAN_NAME, REPORT_NAME}
    described, bare = (json.loads(files["build.json"]) for files in (found, plain))
    assert set(described) - set(bare) == {"scan_sha256"}
    for document in (described, bare):
        document.pop("checksum")
    described.pop("scan_sha256")
    assert described == bare


def test_the_same_recordings_and_wiring_give_the_same_bytes(
    grasp_set: GraspSet, harness: Harness, tmp_path: Path
) -> None:
    compile_build(grasp_set, tmp_path / "one", rounds=4, folds=0, harness=harness)
    (bus,) = harness.buses
    moved = replace(harness, name="moved", buses=(replace(bus, device="/dev/i2c-7"),))
    compile_build(grasp_set, tmp_path / "two", rounds=4, folds=0, harness=moved)
    assert _bytes(tmp_path / "one") == _bytes(tmp_path / "two")


def test_compiling_again_without_a_harness_takes_the_map_away(
    grasp_set: GraspSet, harness: Harness, tmp_path: Path
) -> None:
    compile_build(grasp_set, tmp_path / "build", rounds=2, folds=0, harness=harness)
    compile_build(grasp_set, tmp_path / "build", rounds=2, folds=0)
    assert SCAN_NAME not in _bytes(tmp_path / "build")


def test_a_harness_that_lacks_a_kept_switch_makes_no_build(grasp_set: GraspSet, tmp_path: Path) -> None:
    with pytest.raises(HarnessError, match="'bare' has no pin or key for s"):
        compile_build(grasp_set, tmp_path / "build", rounds=2, folds=0, harness=Harness(name="bare"))
    assert not (tmp_path / "build").exists()


def test_a_build_of_joints_alone_reads_no_port(grasp_set: GraspSet, harness: Harness, tmp_path: Path) -> None:
    report = compile_build(grasp_set, tmp_path / "build", rounds=2, inputs="joints", folds=0, harness=harness)
    assert report.scan is not None
    assert report.scan.ports == ()
    found = verify(tmp_path / "build", grasp_set)
    assert found.scan == ScanCheck(0, 0.0, 0)
    assert found.holds


def test_verification_scans_every_row_and_no_row_changes(grasp_set: GraspSet, harness: Harness, tmp_path: Path) -> None:
    compile_build(grasp_set, tmp_path / "build", rounds=8, folds=0, harness=harness)
    found = verify(tmp_path / "build", grasp_set)
    assert found.scan is not None
    assert found.scan.changed == 0
    assert 1.0 <= found.scan.mean_read <= found.scan.ports == 2
    assert found.holds


def test_verification_of_a_build_for_no_harness_says_nothing_of_scans(grasp_set: GraspSet, tmp_path: Path) -> None:
    compile_build(grasp_set, tmp_path / "build", rounds=2, folds=0)
    assert verify(tmp_path / "build", grasp_set).scan is None


def test_a_row_that_a_scan_would_call_otherwise_is_counted(
    grasp_set: GraspSet, harness: Harness, tmp_path: Path
) -> None:
    report = compile_build(grasp_set, tmp_path / "build", rounds=8, folds=0, harness=harness)
    build, scan = Build.load(tmp_path / "build"), report.scan
    assert scan is not None
    bits = grasp_set.switches[:, [switch.column for switch in build.manifest.switches]]
    deployed = np.array(
        [build.grasps.index(build.classify(*row)) for row in zip(bits, grasp_set.codes, strict=True)], np.intp
    )
    whole = check_scan(scan, build.tables, bits, grasp_set.codes, deployed)
    assert whole.changed == 0
    deployed[[3, 5]] = (deployed[[3, 5]] + 1) % 4
    assert check_scan(scan, build.tables, bits, grasp_set.codes, deployed) == replace(whole, changed=2)


def test_verification_does_not_hold_where_a_row_changes(
    grasp_set: GraspSet, harness: Harness, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compile_build(grasp_set, tmp_path / "build", rounds=2, folds=0, harness=harness)
    monkeypatch.setattr("thenar.compiler.artifact.verify.check_scan", lambda *_: ScanCheck(2, 1.0, 1))
    assert not verify(tmp_path / "build", grasp_set).holds


def test_buses_without_chips_are_no_hindrance(grasp_set: GraspSet, harness: Harness, tmp_path: Path) -> None:
    more = replace(harness, buses=(*harness.buses, BusWiring(device="/dev/i2c-9")))
    compile_build(grasp_set, tmp_path / "build", rounds=2, folds=0, harness=more)
    assert Build.load(tmp_path / "build").scan is not None

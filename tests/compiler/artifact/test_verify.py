import hashlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from shutil import copytree
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace as replace_fields

from thenar.compiler import TRAINERS, GraspSet, Recipe, compile_build
from thenar.compiler.artifact import CompileError
from thenar.compiler.artifact.compile import MEMBERS
from thenar.compiler.artifact.documents import REPORT_NAME
from thenar.compiler.artifact.ensemble import ensemble_from_bytes
from thenar.compiler.artifact.verify import Verification, verify
from thenar.compiler.glove.propose import propose_harness
from thenar.compiler.model.collapse import collapse
from thenar.compiler.scan_file import SCAN_NAME, load_scan, scanmap_to_bytes
from thenar.compiler.trainers.base import Training
from thenar.runtime import Build, BuildError
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.manifest_file import manifest_from_bytes, manifest_to_bytes
from thenar.runtime.model.integers import IntegerTables, tables_from_bytes, tables_to_bytes

from ...conftest import calls
from ..conftest import make_set

Make = Callable[..., GraspSet]


@pytest.fixture(scope="module", params=TRAINERS, ids=str)
def built(grasp_set: GraspSet, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """Return a build of each trainer, its settings given so that nothing is chosen."""
    trainer = request.param
    settings = Training.candidates(Recipe(trainer=trainer))[0].settings
    given: dict[str, Any] = {name: value for name, value in settings.items() if value is not None}
    given |= {"rounds": 15} if "rounds" in given else {}
    build = tmp_path_factory.mktemp("built") / "build"
    made = compile_build(grasp_set, build, trainer=trainer, folds=0, refuse=0, **given)
    assert made.manifest.fit.trainer == trainer
    assert bool(made.tables.lines) == (trainer in ("discriminant", "linear"))
    return made.folder


@pytest.fixture
def folder(built: Path, tmp_path: Path) -> Path:
    """Return a copy of it, to be damaged."""
    return copytree(built, tmp_path / "build")


def _seal(folder: Path, tables: IntegerTables) -> None:
    """Write tables into a build that says their checksum, as a faulty compiler would."""
    data = tables_to_bytes(tables)
    manifest = manifest_from_bytes((folder / "build.json").read_bytes())
    (folder / "tables.bin").write_bytes(data)
    proof = replace_fields(manifest.proof, scale=tables.scale, bound=tables.bound)
    described = replace_fields(manifest, tables_sha256=hashlib.sha256(data).hexdigest(), proof=proof)
    (folder / "build.json").write_bytes(manifest_to_bytes(described))


def test_a_build_holds_on_the_recordings_it_was_made_from(folder: Path, grasp_set: GraspSet) -> None:
    found = verify(folder, grasp_set)
    proof = manifest_from_bytes((folder / "build.json").read_bytes()).proof
    assert found.holds
    assert found.trained_on == found.trials > 0
    assert found.collapse_difference <= found.collapse_bound
    assert 0 < found.integer_difference <= found.integer_bound == proof.error
    assert (found.covered, len(found.changed)) == (proof.covered, proof.changed)
    assert found.covered_changed == 0


def test_the_worst_frame_is_told_whether_recorded_or_not(folder: Path, grasp_set: GraspSet) -> None:
    worst = verify(folder, grasp_set).worst
    build = Build.load(folder)
    bits = [switch.name in worst.closed for switch in build.manifest.switches]
    stumps = ensemble_from_bytes((folder / "ensemble.bin").read_bytes())
    exact = collapse(stumps, len(bits)).scores(np.array([bits]), np.array([worst.codes], np.uint16))[0]
    leader, competitor = build.grasps.index(worst.leader), build.grasps.index(worst.competitor)
    deployed = build.scores(bits, np.array(worst.codes, np.uint16))
    lost = (exact[leader] - exact[competitor]) * build.tables.scale - (deployed[leader] - deployed[competitor])
    assert lost == pytest.approx(worst.loss, abs=1e-9)
    assert 0 < worst.loss < worst.bound
    assert worst.bound == pytest.approx(build.manifest.proof.safe_margin, rel=1e-11, abs=1e-9)
    assert worst.loss - 1 <= worst.safe_margin <= worst.loss
    assert worst.covered >= build.manifest.proof.covered
    assert worst.covered_changed == 0
    assert abs(worst.reach) == build.manifest.proof.bound == build.tables.bound <= worst.limit == 32767


def test_a_fault_that_no_recorded_row_shows_does_not_hold(folder: Path, grasp_set: GraspSet) -> None:
    # A bin above all codes that were recorded.
    tables = tables_from_bytes((folder / "tables.bin").read_bytes())
    assert grasp_set.codes.max() < 300
    fault = np.array([-30 - 400 * bool(tables.lines), 0, 0, 0], np.int16)
    rows = np.vstack([tables.joint_rows[0], tables.joint_rows[0][-1:] + fault])
    thresholds = (np.append(tables.thresholds[0], np.uint16(300)), *tables.thresholds[1:])
    _seal(folder, tables.changed(thresholds=thresholds, joint_rows=(rows, *tables.joint_rows[1:])))
    found = verify(folder, grasp_set)
    assert found.integer_difference <= found.integer_bound
    assert found.worst.loss > found.worst.bound
    assert found.worst.codes[0] == 301
    assert not found.holds


def test_other_recordings_with_their_columns_in_another_order_will_do(folder: Path) -> None:
    other = make_set(seed=5)
    shuffled = replace(
        other,
        switches=other.switches[:, ::-1],
        switch_names=other.switch_names[::-1],
        codes=other.codes[:, ::-1],
        joints=other.joints[::-1],
    )
    found, straight = verify(folder, shuffled), verify(folder, other)
    assert found.trained_on < found.trials
    assert found.holds
    assert found == straight
    assert found.recognised[0].integers > found.rows / 2


def test_every_changed_row_is_told(folder: Path, grasp_set: GraspSet) -> None:
    # Joints that say nothing.
    tables = tables_from_bytes((folder / "tables.bin").read_bytes())
    rows = tuple(0 * row for row in tables.joint_rows)
    _seal(folder, tables.changed(joint_rows=rows, joint_means=0 * tables.joint_means, further=()))
    found = verify(folder, grasp_set)
    assert found.changed
    assert found.covered_changed > 0
    for row in found.changed:
        assert row.recorded == grasp_set.grasps[row.row]
        assert row.ensemble != row.integers
        assert row.margin >= 0
    gained = sum(row.integers == row.recorded for row in found.changed)
    lost = sum(row.ensemble == row.recorded for row in found.changed)
    (counted,) = found.recognised
    assert counted.integers == counted.ensemble + gained - lost < counted.ensemble


def test_codes_that_mean_something_else_are_refused(folder: Path, grasp_set: GraspSet) -> None:
    first, second, third = grasp_set.joints
    for other, said in (
        (replace(second, value_a=10.0), "j1 is coded differently here: code 0 is 10 deg, but 0 deg in the build"),
        (replace(second, value_b=200.0), r"code 255 is 200 deg, but 127\.5 deg in the build"),
    ):
        joints = (first, other, third)
        with pytest.raises(CompileError, match=said):
            verify(folder, replace(grasp_set, joints=joints))


def test_the_ensemble_of_another_build_is_refused(folder: Path, tmp_path: Path) -> None:
    compile_build(make_set(seed=3), tmp_path / "other", rounds=15, folds=0)
    (folder / "ensemble.bin").write_bytes((tmp_path / "other" / "ensemble.bin").read_bytes())
    with pytest.raises(BuildError, match=r"ensemble\.bin is not the one"):
        verify(folder, make_set())


def test_recordings_without_rows_are_refused(folder: Path, grasp_set: GraspSet) -> None:
    with pytest.raises(CompileError, match="no rows"):
        verify(folder, grasp_set.rows(np.array([], int)))


@pytest.mark.slow
def test_verifying_hundreds_of_classes_is_no_more_work_than_compiling_them(tmp_path: Path) -> None:
    many, found = make_set(rows=1200, switches=40, types=400), list[Verification]()
    compiling = calls(lambda: compile_build(many, tmp_path / "build", rounds=10, folds=0))
    verifying = calls(lambda: found.append(verify(tmp_path / "build", many)))
    print(f"{compiling} calls to compile, {verifying} to verify")
    assert found[0].holds
    assert verifying <= compiling


@pytest.fixture(scope="module")
def harness(grasp_set: GraspSet) -> Harness:
    """All switches of the recordings, seven a chip; kept ones among them."""
    return propose_harness(grasp_set.switch_names, "mcp23008")


def test_the_build_holds_a_map_of_the_harness_and_says_its_checksum(
    grasp_set: GraspSet, harness: Harness, tmp_path: Path
) -> None:
    report = compile_build(grasp_set, tmp_path / "build", rounds=4, folds=0, harness=harness)
    files = {path.name: path.read_bytes() for path in (tmp_path / "build").iterdir() if path.is_file()}
    assert set(files) == MEMBERS - {REPORT_NAME}
    assert report.manifest.scan_sha256 == hashlib.sha256(files[SCAN_NAME]).hexdigest()
    assert report.scan is not None
    assert files[SCAN_NAME] == scanmap_to_bytes(report.scan)
    build = Build.load(tmp_path / "build")
    assert load_scan(tmp_path / "build", build.manifest) == report.scan

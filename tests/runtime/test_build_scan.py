"""The scan map of a build folder: vouched for by build.json, or not there at all."""

import hashlib
from pathlib import Path

import pytest
from msgspec.structs import replace

from thenar.compiler.glove.propose import propose_harness
from thenar.compiler.scan_file import SCAN_NAME, load_scan, scanmap_to_bytes
from thenar.runtime.build import MANIFEST_NAME, Build
from thenar.runtime.errors import BuildError
from thenar.runtime.live.system import LiveSystem
from thenar.runtime.manifest_file import manifest_from_bytes, manifest_to_bytes
from thenar.runtime.scanning.plan import plan_scan
from thenar.runtime.scanning.scanmap import SCHEMA, Port, ScanMap, StreamRead

SCAN = ScanMap(SCHEMA, (Port(0, 0, "AB", tuple((bit, bit) for bit in range(9)), False),), ())


def add(folder: Path, scan: ScanMap) -> Path:
    path = folder / SCAN_NAME
    path.write_bytes(scanmap_to_bytes(scan))
    manifest = manifest_from_bytes((folder / MANIFEST_NAME).read_bytes())
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    (folder / MANIFEST_NAME).write_bytes(manifest_to_bytes(replace(manifest, scan_sha256=digest)))
    return path


def loaded(folder: Path) -> ScanMap | None:
    return load_scan(folder, Build.load(folder).manifest)


def test_a_build_without_harness_has_no_map(folder: Path) -> None:
    assert loaded(folder) is None
    assert b"scan" not in (folder / MANIFEST_NAME).read_bytes()


def test_a_build_for_a_harness_has_its_map(folder: Path) -> None:
    add(folder, SCAN)
    assert loaded(folder) == SCAN


def test_a_map_that_is_not_there_is_named(folder: Path) -> None:
    add(folder, SCAN).unlink()
    with pytest.raises(BuildError, match=r"scan\.json cannot be read: No such file"):
        loaded(folder)


def test_a_map_of_another_build_is_refused(folder: Path) -> None:
    add(folder, SCAN).write_bytes(scanmap_to_bytes(replace(SCAN, streams=(StreamRead((), ()),))))
    with pytest.raises(BuildError, match=r"scan\.json is not the one that build\.json describes"):
        loaded(folder)


def test_a_map_of_other_switches_is_refused_even_if_vouched_for(folder: Path) -> None:
    add(folder, replace(SCAN, ports=(Port(0, 0, "A", ((0, 0),), False),)))
    with pytest.raises(BuildError, match="does not read each of the 9 kept switches once"):
        loaded(folder)


def test_a_run_plans_its_own_map_for_the_wiring_that_it_is_given(folder: Path) -> None:
    add(folder, SCAN)
    build = Build.load(folder)
    names = [switch.name for switch in build.manifest.switches]
    harness = propose_harness(names[::-1])
    assert LiveSystem.of(build, harness).scan == plan_scan(names, harness) != loaded(folder)

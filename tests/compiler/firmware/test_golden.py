"""The generated firmware of a small build, byte by byte: two folders stand in tests/golden/firmware, and of the others
digests. So do digests of the numbers of a check, and of the code that is the same for every glove but for two tables.
The core is no generated file: it goes into every folder as it is.

After a change that is meant: pytest tests/compiler/firmware/test_golden.py --update-golden, and read the difference.
"""

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.firmware.classifier import CORE_FILES
from thenar.compiler.firmware.generate import firmware_files
from thenar.compiler.firmware.rows import rows_files
from thenar.firmware_templates.rendering import file_text
from thenar.runtime.build import Build
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.manifest import SCHEMA, Calibration, Manifest, Origin, Proof, Switch
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.quantise import in_bytes
from thenar.runtime.recipe import Recipe

GOLDEN = Path(__file__).resolve().parents[2] / "golden" / "firmware"
WHOLE = ("host", "rows")
DIGESTS = GOLDEN / "digests.json"

SWITCHES = ("thumb tip", "index tip", "index middle", "middle tip", "palm radial", "palm ulnar")
JOINTS = ("thumb_rotation", "index_pij")
GRASPS = ("power grip", "tip pinch", "lateral pinch")

GLOVE = f"""\
name = "golden"
[[stream]]
port = "/dev/ttyACM0"
rate_hz = 100
switches = {[*SWITCHES]}
joints = {{ thumb_rotation = [0, 1023], index_pij = [0, 1023] }}
[stream.board]
pins = {{ "thumb tip" = "2", thumb_rotation = "A0", index_pij = "A1.3" }}
select = ["4", "5", "6", "7"]
matrix = {{ rows = ["8", "9"], columns = ["10"], keys = [["index tip"], ["index middle"]], diodes = true }}
[[stream.board.chip]]
kind = "mcp23017"
address = 0x20
pins = {{ GPA0 = "middle tip", GPA3 = "palm radial", GPB0 = "palm ulnar" }}
"""

CASES = ("host", "avr328p", "avr2560", "cortex-m0plus", "cortex-m4", "rv32imac", "arduino", "rows")


def small_build() -> Build:
    exact = IntegerTables.of(
        bias=np.array([120, -40, 7], np.int16),
        switch_rows=np.array(
            [[310, 205, -80], [-45, 260, 33], [90, -12, -7], [150, -300, 41], [400, -390, -120], [77, -8, 260]],
            np.int16,
        ),
        thresholds=(np.array([60, 61, 140], np.uint16), np.array([90, 200], np.uint16)),
        joint_rows=(
            np.array([[-200, 180, 90], [-90, 100, 80], [10, 20, 30], [250, -170, -60]], np.int16),
            np.array([[-310, 40, 220], [15, 130, -25], [330, -90, -240]], np.int16),
        ),
        switch_means=np.array([[155, 102, -40]] * 6, np.int16),
        joint_means=np.array([[1, 2, 3], [4, 5, 6]], np.int16),
        scale=100.0,
    )
    tables = in_bytes(exact)
    manifest = Manifest(
        schema=SCHEMA,
        checksum="",
        thenar="0.1.0",
        tables_sha256="0123456789abcdef" * 4,
        ensemble_sha256="0" * 64,
        source=Origin("1" * 64, 60, "own", 160, joints=22),
        options=Recipe(13, 100, "both", 1.0, 4, 1),
        grasps=GRASPS,
        switches=tuple(Switch(number, name, 0.5) for number, name in enumerate(SWITCHES)),
        joints=tuple(Calibration(n, name, "raw", 1, 1.0, 255, 255.0) for n, name in enumerate(JOINTS)),
        proof=Proof(16, tables.scale, tables.bound, 4.5, 9.0, 60, 0),
        rates=(),
    )
    return Build(manifest, tables)


def made(case: str) -> dict[str, str]:
    build = small_build()
    if case == "rows":
        return rows_files("board", build.manifest, parse_harness(GLOVE, "glove.toml"))
    files = firmware_files(build.tables, build.manifest, case)
    core = {path: text for path, text in files.items() if Path(path).name in CORE_FILES}
    assert {Path(path).name: text for path, text in core.items()} == {
        name: file_text(f"core/{name}") for name in CORE_FILES
    }
    return {path: text for path, text in files.items() if path not in core}


def content(folder: Path) -> dict[str, str]:
    paths = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes().decode() for path in paths}


def write(folder: Path, files: dict[str, str]) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(text.encode())


def stands_whole(case: str, name: str) -> bool:
    return case in WHOLE and not name.endswith(("_check.h", "_codes.c"))


def digests(case: str) -> dict[str, str]:
    files = {name: text for name, text in sorted(made(case).items()) if not stands_whole(case, name)}
    return {name: hashlib.sha256(text.encode()).hexdigest()[:16] for name, text in files.items()}


@pytest.mark.parametrize("case", WHOLE)
def test_firmware_is_what_it_was(case: str, update_golden: bool) -> None:
    files = {name: text for name, text in made(case).items() if stands_whole(case, name)}
    if update_golden:
        write(GOLDEN / case, files)
    assert files == content(GOLDEN / case)


def test_the_other_firmware_is_what_it_was(update_golden: bool) -> None:
    found = {case: several for case in CASES if (several := digests(case))}
    if update_golden:
        DIGESTS.write_text(json.dumps(found, indent=1) + "\n")
    assert found == json.loads(DIGESTS.read_text())


def test_there_are_no_other_golden_files() -> None:
    assert {path.name for path in GOLDEN.iterdir()} == {*WHOLE, DIGESTS.name}


@pytest.mark.parametrize("case", CASES)
def test_generated_files_have_tidy_lines_of_at_most_120_characters(case: str) -> None:
    for name, text in made(case).items():
        assert text.endswith("\n"), name
        assert not text.endswith("\n\n"), name
        for number, line in enumerate(text.splitlines(), 1):
            assert len(line) <= 120 or name.endswith(".md"), f"{name}:{number}"
            assert line == line.rstrip(), f"{name}:{number}"

"""The firmware of a small build, byte by byte: three folders stand in tests/golden/firmware, of the others digests.

After a change that is meant: pytest tests/compiler/firmware/test_golden.py --update-golden, and read the difference.
"""

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.firmware.board import parse_board
from thenar.compiler.firmware.generate import Firmware
from thenar.compiler.firmware.targets.base import Mode
from thenar.runtime.build import Build
from thenar.runtime.manifest import SCHEMA, Calibration, Manifest, Options, Origin, Proof, Switch
from thenar.runtime.tables import IntegerTables

GOLDEN = Path(__file__).resolve().parents[2] / "golden" / "firmware"
WHOLE = ("host", "avr328p", "glove-avr2560")
DIGESTS = GOLDEN / "digests.json"

SWITCHES = ("thumb tip", "index tip", "index middle", "middle tip", "palm radial", "palm ulnar")
JOINTS = ("thumb_rotation", "index_pij")
GRASPS = ("power grip", "tip pinch", "lateral pinch")

SCAN_BOARD = """\
part = "atmega328p"
[pins]
"thumb tip" = "PD2"
"index tip" = "PD3"
"index middle" = "PD4"
"middle tip" = "PD5"
"palm radial" = "PB0"
"palm ulnar" = "PB1"
"""

GLOVE_BOARD = """\
part = "atmega2560"
[[chip]]
kind = "mcp23017"
address = 0x20
pins = { GPA0 = "thumb tip", GPA1 = "index tip", GPA2 = "index middle", GPB0 = "middle tip" }
[[chip]]
kind = "pca9555"
address = 0x21
pins = { P00 = "palm radial", P01 = "palm ulnar" }
[cyberglove]
uart = 1
sensors = 18
"""

SKETCH_BOARD = """\
part = "esp32"
[wifi]
[pins]
"thumb tip" = "GPIO4"
"index tip" = "GPIO5"
"index middle" = "GPIO13"
"middle tip" = "GPIO14"
"palm radial" = "GPIO18"
"palm ulnar" = "GPIO19"
"""

CASES: dict[str, tuple[str, Mode, str | None]] = {
    "host": ("host", "classify", None),
    "avr328p": ("avr328p", "classify", None),
    "avr2560": ("avr2560", "classify", None),
    "cortex-m0plus": ("cortex-m0plus", "classify", None),
    "cortex-m4": ("cortex-m4", "classify", None),
    "rv32imac": ("rv32imac", "classify", None),
    "arduino": ("arduino", "classify", None),
    "scan-avr328p": ("avr328p", "scan", SCAN_BOARD),
    "scan-esp32": ("esp32", "scan", SKETCH_BOARD),
    "glove-avr2560": ("avr2560", "glove", GLOVE_BOARD),
}


def small_build() -> Build:
    tables = IntegerTables(
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
    manifest = Manifest(
        schema=SCHEMA,
        checksum="",
        thenar="0.1.0",
        tables_sha256="0123456789abcdef" * 4,
        ensemble_sha256="0" * 64,
        source=Origin("1" * 64, 60, "own", 160, joints=22),
        options=Options(13, 100, "both", 1.0, 4, 1),
        grasps=GRASPS,
        switches=tuple(Switch(number, name, 0.5) for number, name in enumerate(SWITCHES)),
        joints=tuple(Calibration(n, name, "raw", 1, 1.0, 255, 255.0) for n, name in enumerate(JOINTS)),
        proof=Proof(16, tables.scale, tables.bound, 4.5, 9.0, 60, 0),
        rates=(),
    )
    return Build(manifest, tables)


def made(case: str) -> dict[str, str]:
    target, mode, board = CASES[case]
    build = small_build()
    wiring = None if board is None else parse_board(board)
    return Firmware(build.tables, build.manifest, target, mode, board=wiring).files()


def content(folder: Path) -> dict[str, str]:
    paths = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes().decode() for path in paths}


def write(folder: Path, files: dict[str, str]) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(text.encode())


def digests(files: dict[str, str]) -> dict[str, str]:
    return {path: hashlib.sha256(text.encode()).hexdigest()[:16] for path, text in sorted(files.items())}


@pytest.mark.parametrize("case", WHOLE)
def test_firmware_is_what_it_was(case: str, update_golden: bool) -> None:
    files = made(case)
    if update_golden:
        write(GOLDEN / case, files)
    assert files == content(GOLDEN / case)


def test_the_other_firmware_is_what_it_was(update_golden: bool) -> None:
    found = {case: digests(made(case)) for case in CASES if case not in WHOLE}
    if update_golden:
        DIGESTS.write_text(json.dumps(found, indent=1) + "\n")
    assert found == json.loads(DIGESTS.read_text())


def test_there_are_no_other_golden_files() -> None:
    assert {path.name for path in GOLDEN.iterdir()} == {*WHOLE, DIGESTS.name}


@pytest.mark.parametrize("case", CASES)
def test_every_file_ends_with_one_newline_and_is_at_most_120_wide_without_trailing_blanks(case: str) -> None:
    for name, text in made(case).items():
        assert text.endswith("\n"), name
        assert not text.endswith("\n\n"), name
        for number, line in enumerate(text.splitlines(), 1):
            assert len(line) <= 120 or name.endswith(".md"), f"{name}:{number}"
            assert line == line.rstrip(), f"{name}:{number}"

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.firmware.board import parse_board
from thenar.compiler.firmware.board_files import board_files, config_of, whole_folder
from thenar.compiler.firmware.classifier import classifier_files
from thenar.compiler.firmware.layout import arrange
from thenar.compiler.firmware.protocol import protocol_files
from thenar.compiler.firmware.targets.base import Mode
from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.runtime.manifest import Calibration, Manifest, Options, Origin, Proof, Switch
from thenar.runtime.tables import IntegerTables

Tool = Callable[[str], str]

SWITCHES = tuple(f"s{n}" for n in range(7))
GRASPS = tuple(f"grasp {n}" for n in range(14))
FLASH = {"atmega328p": 32 << 10, "atmega2560": 256 << 10}

# Of the pins, those that both parts have and neither needs for its UART or its bus.
PINS = "[pins]\n" + "".join(
    f'{name} = "{pin}"\n' for name, pin in zip(SWITCHES, ("PD2", "PD4", "PD5", "PD6", "PB0", "PB1", "PB5"), strict=True)
)
MATRIX = (
    '[matrix]\nrows = ["PD4", "PD5"]\ncolumns = ["PB0", "PB1", "PB2", "PC3"]\ndiodes = {}\n'
    'switches = [["s0", "s1", "", "s2"], ["s3", "s4", "s5", "s6"]]\n'
)
CHIPS = (
    '[[chip]]\nkind = "mcp23017"\naddress = 0x20\npins = { GPA0 = "s0", GPB6 = "s1" }\n'
    '[[chip]]\nkind = "tca6424a"\naddress = 0x22\nclosed = "high"\npins = { P00 = "s2", P21 = "s3" }\n'
    '[[chip]]\nkind = "pca9555"\naddress = 0x21\npins = { P00 = "s4", P07 = "s5", P17 = "s6" }\n'
)
ANALOG = '[analog]\nthumb_rotation = "ADC1"\nwrist_yaw = "ADC7"\n'
JOINTS = ("thumb_rotation", "wrist_yaw")
TAXELS = (
    '[taxels]\ninputs = ["ADC0", "ADC3"]\nselect = ["PD7", "PB2", "PB3", "PB4"]\n'
    f"names = {['t0', '', *(f't{n}' for n in range(2, 20))]}\n"
)
SLOW = "scan_us = 5000\n"

CASES: dict[str, tuple[str, Mode, tuple[str, ...]]] = {
    "pins": (PINS, "scan", ()),
    "pins that recognise": (PINS, "glove", ()),
    "pins and analog joints": (PINS + ANALOG, "glove", JOINTS),
    "pins and taxels behind multiplexers": (PINS + TAXELS, "scan", ()),
    "matrix": (MATRIX.format("true"), "scan", ()),
    "matrix without diodes that recognises": (MATRIX.format("false"), "glove", ()),
    "chips": (CHIPS, "scan", ()),
    "chips that recognise": (SLOW + CHIPS, "glove", ()),
}
GLOVES: dict[str, tuple[str, Mode, tuple[str, ...]]] = {
    "chips and a CyberGlove": (f"{SLOW}{CHIPS}[cyberglove]\nuart = 3\n", "glove", SENSORS_18),
    "taxels on channels of their own": (
        '[taxels]\ninputs = ["ADC0", "ADC9"]\nnames = ["t0", "t1"]\n' + PINS,
        "scan",
        (),
    ),
    "analog channels from 8 on": (PINS + ANALOG.replace("ADC1", "ADC9"), "glove", JOINTS),
    "a wide matrix and pins of JTAG": (
        '[matrix]\nrows = ["PA0"]\ncolumns = [{}]\ndiodes = false\nswitches = [["s0", "s1", "s2", "s3", "s4", "s5", '
        '"s6"{}]]\n'.format(
            ", ".join(f'"P{port}{bit}"' for port in "CFL" for bit in range(8)), ', ""' * (24 - len(SWITCHES))
        ),
        "glove",
        (),
    ),
}
ALL = [(part, case) for part in FLASH for case in CASES] + [("atmega2560", case) for case in GLOVES]


def tables_of(joints: int) -> IntegerTables:
    random = np.random.default_rng(joints)

    def rows(*shape: int) -> np.ndarray:
        return random.integers(-300, 300, shape).astype(np.int16)

    k = len(GRASPS)
    return IntegerTables(
        bias=rows(k),
        switch_rows=rows(len(SWITCHES), k),
        thresholds=tuple(np.sort(random.choice(250, 6, replace=False)).astype(np.uint16) for _ in range(joints)),
        joint_rows=tuple(rows(7, k) for _ in range(joints)),
        switch_means=rows(len(SWITCHES), k),
        joint_means=rows(joints, k),
        scale=10.0,
    )


def manifest_of(joints: tuple[str, ...]) -> Manifest:
    return Manifest(
        schema=1,
        checksum="",
        thenar="0.1.0",
        tables_sha256="0" * 64,
        ensemble_sha256="0" * 64,
        source=Origin("1" * 64, 10, "own", 20, joints=22),
        options=Options(0, 100, "both", 1.0, 4, 1),
        grasps=GRASPS,
        switches=tuple(Switch(number, name, 0.5) for number, name in enumerate(SWITCHES)),
        joints=tuple(Calibration(number, name, "raw", 1, 0.0, 255, 1.0) for number, name in enumerate(joints)),
        proof=Proof(16, 10.0, 1, 1.0, 1.0, 1, 0),
        rates=(),
    )


def files_of(part: str, text: str, mode: Mode, joints: tuple[str, ...]) -> dict[str, str]:
    board, tables, manifest = parse_board(f'part = "{part}"\n{text}'), tables_of(len(joints)), manifest_of(joints)
    layout = arrange(tables)
    files = protocol_files(config_of(board, SWITCHES, tables, recognises=mode == "glove"))
    files |= board_files("hand", manifest, layout, board, mode)
    if mode == "glove":
        files |= classifier_files("hand", manifest, layout, avr=True)
    return whole_folder("hand", board, mode, files)


def written(files: dict[str, str], folder: Path) -> Path:
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(("part", "case"), ALL, ids=[f"{part}: {case}" for part, case in ALL])
def test_every_board_compiles_without_a_warning_and_fits(part: str, case: str, tool: Tool, tmp_path: Path) -> None:
    """-std=c99 -Wall -Wextra -Wconversion -pedantic, as the Makefile has it, and -Werror."""
    make, _ = tool("make"), tool("avr-gcc")
    files = files_of(part, *(CASES | GLOVES)[case])
    done = subprocess.run(
        [make, "-s", "-C", str(written(files, tmp_path)), "CFLAGS=-Os -flto -Werror", "all", "size"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    print(f"{part}, {case}:", *re.findall(r"(?:Program|Data): +\d+ bytes", done.stdout))
    program, data = (int(size) for size in re.findall(r"(?:Program|Data): +(\d+) bytes", done.stdout))
    assert 2000 < program < FLASH[part]
    assert data < 1024
    assert list(tmp_path.glob("thenar_hand_*.hex"))


@pytest.mark.parametrize("flag", ["-Wall -Wextra -Wconversion -pedantic", "-std=c99", "CFLAGS ?= -Os -flto\n"])
def test_the_makefile_asks_for_what_that_test_relies_on(flag: str) -> None:
    makefile = files_of("atmega328p", PINS, "scan", ())["Makefile"]
    assert flag in makefile


def test_a_reset_by_the_watchdog_stops_it_before_anything_else_runs(tool: Tool, tmp_path: Path) -> None:
    """What starts the watchdog's shortest period anew, from which a boot would be reset again, comes within .init3."""
    make, disassemble = tool("make"), tool("avr-objdump")
    folder = written(files_of("atmega328p", PINS, "scan", ()), tmp_path)
    subprocess.run([make, "-s", "-C", str(folder), "all"], check=True)
    elf = str(folder / "thenar_hand_scan.elf")
    text = subprocess.run([disassemble, "-d", elf], check=True, capture_output=True, text=True).stdout
    before_main = text.partition("<__ctors_end>:")[2].partition("<main>")[0]
    assert "wdr" in before_main
    assert before_main.index("wdr") < before_main.index("<__do_clear_bss>")


JTAG: dict[str, tuple[str, Mode, tuple[str, ...]]] = {
    "pins": (PINS.replace("PB5", "PF4"), "scan", ()),
    "taxels": (PINS + TAXELS.replace("ADC3", "ADC5"), "scan", ()),
    "matrix": (MATRIX.format("true").replace("PC3", "PF7"), "scan", ()),
    "analog joints": (PINS + ANALOG.replace("ADC1", "ADC5"), "glove", JOINTS),
}


@pytest.mark.parametrize("case", JTAG)
def test_jtag_is_switched_off_by_two_writes_that_no_interrupt_parts(case: str, tool: Tool, tmp_path: Path) -> None:
    """Both to MCUCR (0x35), within four cycles."""
    make, disassemble = tool("make"), tool("avr-objdump")
    subprocess.run([make, "-s", "-C", str(written(files_of("atmega2560", *JTAG[case]), tmp_path)), "all"], check=True)
    elf = str(next(tmp_path.glob("*.elf")))
    done = subprocess.run([disassemble, "-d", "--no-show-raw-insn", elf], check=True, capture_output=True, text=True)
    lines = [line.partition(":\t")[2].partition(";")[0].split() for line in done.stdout.splitlines()]
    places = [at for at, line in enumerate(lines) if line[:2] == ["out", "0x35,"]]
    assert len(places) == 2
    assert places[1] == places[0] + 1
    assert lines[places[0] - 1] == ["cli"]
    assert lines[places[1] + 1][:2] == ["out", "0x3f,"], "interrupts are as they were"

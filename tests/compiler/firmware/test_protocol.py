"""The files of a board: what they are made from, what is refused, and that every compiler takes them."""

import subprocess
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.protocol import MOST_KEYS, BoardConfig, protocol_files

Tool = Callable[[str], str]
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-c")
COMPILERS = {
    "gcc": ("gcc",),
    "clang": ("clang",),
    "avr 328p": ("avr-gcc", "-mmcu=atmega328p", "-Os"),
    "avr 2560": ("avr-gcc", "-mmcu=atmega2560", "-Os"),
    "cortex-m0plus": ("arm-none-eabi-gcc", "-mcpu=cortex-m0plus", "-mthumb", "-Os"),
    "cortex-m4": ("arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-Os"),
}
CONFIGS = [BoardConfig(1, 1), BoardConfig(1, 33, press_us=5000, release_us=10_000), BoardConfig(40, 49, diodes=False)]


def write(files: dict[str, str], folder: Path) -> list[str]:
    """Write the files, and return which of them are compiled."""
    for name, text in files.items():
        (folder / name).write_text(text)
    return [name for name in files if name.endswith(".c")]


def test_the_files_of_a_board() -> None:
    parts = {f"thenar_{part}.{end}" for part in ("frames", "debounce", "board") for end in "hc"}
    assert protocol_files(BoardConfig(1, 8)).keys() == {"thenar_config.h", "thenar_time.h", *parts}


def test_the_configuration_is_what_the_preprocessor_sees(tool: Tool, tmp_path: Path) -> None:
    config = BoardConfig(3, 11, False, 0xFFFFFFFF, 4000, 5000, 6000, 7000, 8000, 250, channels=5)
    write(protocol_files(config), tmp_path)
    names = {"ROWS", "COLUMNS", "KEYS", "DIODES", "BOARD_ID", *(f"{one}_US" for one in ("SCAN", "STATE", "HEARTBEAT"))}
    names |= {"PRESS_US", "RELEASE_US", "FASTEST_US", "CHANNELS", "CODE_BITS"}
    prints = "".join(f'printf("{name} %lu\\n", (unsigned long)THENAR_{name});' for name in sorted(names))
    (tmp_path / "main.c").write_text(f'#include <stdio.h>\n#include "thenar_config.h"\nint main(void) {{ {prints} }}\n')
    subprocess.run([tool("gcc"), "-std=c99", "main.c", "-o", "main"], cwd=tmp_path, check=True)
    said = subprocess.run([str(tmp_path / "main")], capture_output=True, text=True, check=True).stdout
    expected = {name.upper(): int(value) for name, value in asdict(config).items()}
    del expected["SEGMENTS"]  # which is said by what the board's C holds
    expected |= {"KEYS": 33, "BOARD_ID": expected.pop("BOARD")}
    assert {name: int(value) for name, value in map(str.split, said.splitlines())} == expected


@pytest.mark.parametrize("number", range(len(CONFIGS)))
@pytest.mark.parametrize("compiler", COMPILERS)
def test_compilers_have_nothing_to_say(tool: Tool, tmp_path: Path, compiler: str, number: int) -> None:
    program, *options = COMPILERS[compiler]
    sources = write(protocol_files(CONFIGS[number]), tmp_path)
    command = [tool(program), *options, *STRICT, *sources]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_board_of_33_keys_needs_little_memory(tool: Tool, tmp_path: Path) -> None:
    """RAM on an AVR, and flash, in bytes."""
    sources = write(protocol_files(CONFIGS[1]), tmp_path)
    subprocess.run([tool("avr-gcc"), "-mmcu=atmega328p", "-Os", "-std=c99", "-c", *sources], cwd=tmp_path, check=True)
    objects = [name.replace(".c", ".o") for name in sources]
    said = subprocess.run([tool("avr-size"), *objects], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    text, data, bss = (sum(int(line.split()[column]) for line in said.splitlines()[1:]) for column in range(3))
    print(f"frames, debouncing and protocol of 33 keys: {text} bytes of flash, {data + bss} of RAM")
    assert data + bss <= 300
    assert text <= 4096


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"rows": 0}, "rows of the board is 0: it must be 1 to 65535"),
        ({"columns": 65_536}, "columns of the board is 65536"),
        ({"columns": MOST_KEYS + 1}, f"the board has 1 x {MOST_KEYS + 1} keys: it can report at most {MOST_KEYS}"),
        ({"rows": 2, "columns": 981}, "2 x 981 keys"),
        ({"board": 1 << 32}, "board of the board is 4294967296"),
        ({"state_us": -1}, "state_us of the board is -1"),
        ({"heartbeat_us": 1 << 32}, "heartbeat_us"),
        ({"press_us": 65_536}, "press_us of the board is 65536: it must be 0 to 65535"),
        ({"release_us": 65_536}, "release_us"),
        ({"fastest_us": 0}, "fastest_us"),
        ({"scan_us": 99}, "scan_us of the board is 99: it must be at least 100 us"),
    ],
)
def test_a_board_that_the_protocol_cannot_describe_is_refused(wrong: dict[str, int], said: str) -> None:
    right: dict[str, Any] = {"rows": 1, "columns": 8}
    with pytest.raises(FirmwareError, match=said):
        BoardConfig(**{**right, **wrong})


def test_lines_are_120_columns_at_most() -> None:
    for text in protocol_files(BoardConfig(40, 49)).values():
        assert max(map(len, text.splitlines())) <= 120


def test_the_same_board_gives_the_same_bytes() -> None:
    assert protocol_files(BoardConfig(2, 8)) == protocol_files(BoardConfig(2, 8))

"""cppcheck, with its MISRA add-on, says nothing of the C of any target and mode but what misra.md explains."""

import re
import subprocess
from collections.abc import Callable, Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path

import pytest
from msgspec.structs import replace

from thenar.compiler.firmware.board import parse_board
from thenar.compiler.firmware.generate import Firmware
from thenar.compiler.firmware.one_hand import for_one_hand
from thenar.compiler.firmware.sensors import sensors_of
from thenar.compiler.firmware.targets.base import Mode
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.runtime.build import Build
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.manifest import Calibration, Manifest, Threshold
from thenar.runtime.segmenting.model import SegmentModel
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]
Tool = Callable[[str], str]
Finding = tuple[str, str]  # what cppcheck calls it, and the file's name

pytestmark = pytest.mark.slow

EXPLAINED = Path(__file__).with_name("misra.md")
OPTIONS = ("--enable=all", "--addon=misra", "--std=c99", "--quiet", "--template={id}\t{file}\t{line}\t{message}")
DEFINED = {
    "atmega328p": ("--platform=avr8", "-D__AVR__", "-D__AVR_ATmega328P__"),
    "atmega2560": ("--platform=avr8", "-D__AVR__", "-D__AVR_ATmega2560__"),
}

PINS = "[pins]\n" + "".join(f's{n} = "PD{n + 2}"\n' for n in range(6)) + 's6 = "PB0"\ns7 = "PB1"\ns8 = "PB2"\n'
ON_GPIO = "[pins]\n" + "".join(f's{n} = "GPIO{pin}"\n' for n, pin in enumerate((4, 5, 13, 14, 18, 19, 21, 22, 23)))
MATRIX = '[matrix]\nrows = ["PC0", "PC1", "PC2"]\ncolumns = ["PB0", "PB1", "PB2"]\nswitches = ' + str(
    [[f"s{3 * row + column}" for column in range(3)] for row in range(3)]
)
WIDE = '[matrix]\nrows = ["PA0"]\ncolumns = {}\ndiodes = false\nswitches = [{}]\n'.format(
    [f"P{port}{bit}" for port in "CFL" for bit in range(8)], [f"s{n}" for n in range(9)] + [""] * 15
)
CHIPS = (
    '[[chip]]\nkind = "mcp23008"\naddress = 0x20\npins = { GP0 = "s0", GP1 = "s1", GP2 = "s2" }\n'
    '[[chip]]\nkind = "mcp23017"\naddress = 0x21\npins = { '
    + ", ".join(f'GPA{n - 3} = "s{n}"' for n in range(3, 9))
    + " }\n"
)
ANALOG = '[analog]\nj0 = "ADC3"\nj1 = "ADC4"\nj2 = "ADC5"\n'
CYBERGLOVE = '[cyberglove]\nsensors = 18\njoints = ["j0", "j1", "j2"' + ', ""' * 15 + "]\n"
HAND = GloveCalibration(sensors=tuple(SensorCalibration(f"j{n}", 40, 0.0, 200, 90.0) for n in range(3)))
STREAM = """
name = "glove"
[[stream]]
port = "/dev/ttyUSB0"
joints = { j0 = [0, 1023], j1 = [1023, 0], j2 = [200, 800] }
taxels = { pad = [0, 1023] }
"""

# platform, mode, board.toml, and how the tables are made
CASES: dict[str, tuple[str, Mode, str, Mapping[str, int]]] = {
    "host": ("host", "classify", "", {}),
    "host, many grasp types": ("host", "classify", "", {"classes": 30}),
    "host, codes of 16 bits": ("host", "classify", "", {"highest": 900}),
    "cortex-m0plus": ("cortex-m0plus", "classify", "", {}),
    "cortex-m4": ("cortex-m4", "classify", "", {}),
    "arduino": ("arduino", "classify", "", {}),
    "avr": ("avr328p", "classify", "", {}),
    "avr, codes of 16 bits": ("avr2560", "classify", "", {"highest": 900}),
    "host, a glove's readings": ("host", "classify", "", {}),
    "avr, a glove's readings": ("avr328p", "classify", "", {"highest": 900}),
    "host, segments": ("host", "classify", "", {}),
    "avr, segments": ("avr328p", "classify", "", {}),
    "scan pins": ("avr328p", "scan", PINS, {}),
    "scan a matrix": ("avr328p", "scan", MATRIX + "\ndiodes = true\n", {}),
    "scan a wide matrix without diodes": ("avr2560", "scan", WIDE, {}),
    "scan chips": ("avr328p", "scan", CHIPS, {}),
    "glove, analog": ("avr328p", "glove", PINS + ANALOG, {}),
    "glove, CyberGlove": ("avr2560", "glove", CHIPS + CYBERGLOVE, {}),
    "sketch, scan, Wi-Fi": ("esp32", "scan", "[wifi]\n" + ON_GPIO, {}),
    "sketch, glove, chips": ("rp2040", "glove", "scan_us = 3000\n" + CHIPS + CYBERGLOVE, {}),
}
PART = {"avr328p": "atmega328p", "avr2560": "atmega2560", "esp32": "esp32", "rp2040": "rp2040"}


def files_of(case: str, make_tables: MakeTables, describe: Describe) -> dict[str, str]:
    platform, mode, text, shape = CASES[case]
    tables = make_tables(**shape)
    manifest = describe(tables)
    if case.endswith(", segments"):
        manifest = replace(manifest, segments=SegmentModel.usual(tables.n_classes, False, tables.scale))
    build = Build(manifest, tables)
    sensors = None
    if case.endswith(" a glove's readings"):
        level = Threshold(90, 0.0, Calibration(0, "pad", "counts", 0, 0.0, 1, 1.0))
        manifest = replace(manifest, switches=(replace(manifest.switches[0], threshold=level), *manifest.switches[1:]))
        raw = tuple(replace(joint, unit="raw", code_a=1, code_b=255) for joint in manifest.joints)
        manifest = replace(manifest, joints=raw)
        build, sensors = Build(manifest, tables), sensors_of(manifest, parse_harness(STREAM, "glove.toml"))
    board = parse_board(f'part = "{PART[platform]}"\n{text}') if text else None
    build = for_one_hand(build, HAND) if mode == "glove" else build
    return Firmware(build.tables, build.manifest, platform, mode, board=board, sensors=sensors).files()


def looked_at(program: str, files: Mapping[str, str], folder: Path, options: tuple[str, ...]) -> set[Finding]:
    """Return what cppcheck says of the C in `files`, written to `folder`."""
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    sources = sorted(name for name in files if name.endswith(".c"))
    searched = sorted({f"-I{Path(name).parent}" for name in files if name.endswith(".h")} - {"-I."})
    command = [program, *OPTIONS, *options, *searched, *sources]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    said = [line.split("\t") for line in done.stderr.splitlines()]
    return {(what, Path(file).name) for what, file, _, _ in said if what != "missingIncludeSystem"}


@pytest.fixture(scope="module")
def findings(
    tool: Tool, make_tables: MakeTables, describe: Describe, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, set[Finding]]:
    """What cppcheck says of each case."""
    program, found = tool("cppcheck"), {}
    for case, (platform, *_) in CASES.items():
        folder, options = tmp_path_factory.mktemp("c"), DEFINED.get(PART.get(platform, ""), ())
        found[case] = looked_at(program, files_of(case, make_tables, describe), folder, options)
    return found


def rows() -> Iterator[tuple[str, str]]:
    """The rows of the table: what cppcheck calls it, and the pattern of a file of a build called glove."""
    for line in EXPLAINED.read_text().splitlines():
        if re.match(r"\| (`\w+`|\d+\.\d+) \|", line):
            rule, files, why = (cell.strip() for cell in line.strip("|").split("|"))
            assert why, line
            name = rule.strip("`") if rule.startswith("`") else f"misra-c2012-{rule}"
            yield from ((name, pattern.replace("NAME", "glove")) for pattern in re.findall("`([^`]+)`", files))


def explains(row: tuple[str, str], finding: Finding) -> bool:
    return row[0] == finding[0] and fnmatchcase(finding[1], row[1])


@pytest.mark.parametrize("case", CASES)
def test_cppcheck_says_nothing_but_what_is_explained(case: str, findings: dict[str, set[Finding]]) -> None:
    table = list(rows())
    assert not sorted(one for one in findings[case] if not any(explains(row, one) for row in table))


def test_nothing_is_explained_that_does_not_occur(findings: dict[str, set[Finding]]) -> None:
    occurs = set[Finding]().union(*findings.values())
    assert not [row for row in rows() if not any(explains(row, one) for one in occurs)]

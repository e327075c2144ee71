"""cppcheck, with its MISRA add-on, says nothing of the C of any target but what misra.md explains."""

import re
import subprocess
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path

import pytest
from msgspec.structs import replace

from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.costs import fit_for
from thenar.compiler.firmware.sensors import sensors_of
from thenar.compiler.firmware.targets import TARGETS
from thenar.runtime.build import Build
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.manifest import Calibration, Threshold
from thenar.runtime.segmenting.model import SegmentModel

from ...conftest import tool
from ...tables import describe
from .conftest import make_tables

Finding = tuple[str, str]  # what cppcheck calls it, and the file's name

pytestmark = pytest.mark.slow

EXPLAINED = Path(__file__).with_name("misra.md")
OPTIONS = ("--enable=all", "--addon=misra", "--std=c99", "--quiet", "--template={id}\t{file}\t{line}\t{message}")
DEFINED = {
    "avr328p": ("--platform=avr8", "-D__AVR__", "-D__AVR_ATmega328P__"),
    "avr2560": ("--platform=avr8", "-D__AVR__", "-D__AVR_ATmega2560__"),
}

STREAM = """
name = "glove"
[[stream]]
port = "/dev/ttyUSB0"
joints = { j0 = [0, 1023], j1 = [1023, 0], j2 = [200, 800] }
taxels = { pad = [0, 1023] }
"""

# The target, and how the tables are made. Those with segments hold all of a plain build, too.
CASES: dict[str, tuple[str, Mapping[str, int]]] = {
    "host, many grasp types": ("host", {"classes": 30}),
    "host, codes of 16 bits": ("host", {"highest": 900}),
    "cortex-m0plus": ("cortex-m0plus", {}),
    "arduino": ("arduino", {}),
    "avr, codes of 16 bits": ("avr2560", {"highest": 900}),
    "host, a glove's readings": ("host", {}),
    "avr, a glove's readings": ("avr328p", {"highest": 900}),
    "host, segments": ("host", {}),
    "avr, segments": ("avr328p", {}),
}


def files_of(case: str) -> dict[str, str]:
    platform, shape = CASES[case]
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
    fit = fit_for(TARGETS[platform], build.tables)
    return TARGETS[platform].files(Library("glove", build.manifest, fit.layout, fit.notes(), sensors))


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
def findings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[Finding]]:
    """What cppcheck says of each case."""
    program, found = tool("cppcheck"), {}
    for case, (platform, *_) in CASES.items():
        folder, options = tmp_path_factory.mktemp("c"), DEFINED.get(platform, ())
        found[case] = looked_at(program, files_of(case), folder, options)
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

"""The package as a library for Arduino, compiled by Arduino's own builder, and its example, run in simavr."""

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler.firmware.classifier import Library as Files
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.sensors import sensors_of
from thenar.compiler.firmware.targets import TARGETS
from thenar.runtime.build import Build
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.manifest import Manifest

from ....conftest import tool
from ....tables import describe
from ..conftest import make_tables

# Compilers and simulators of whole programs: minutes, together.
pytestmark = pytest.mark.slow


BOARDS = {"uno": ("atmega328p", "uno"), "mega": ("atmega2560", "mega:cpu=atmega2560")}
GLOVE = 'name = "glove"\n[[stream]]\nport = "/dev/ttyUSB0"\njoints = {{ {} }}\n'

# As many as the board has pins for, but for simavr, in which inputs 12 to 14 of the larger part read full scale.
ON_A_BOARD = {
    "uno": {"seed": 1, "switches": 11, "joints": 6},
    "mega": {"seed": 1, "classes": 14, "switches": 33, "joints": 12},
}


def on_pins(manifest: Manifest) -> Manifest:
    """Return a build of what a board's pins measured."""
    return replace(manifest, joints=tuple(replace(j, unit="raw", code_a=1, code_b=255) for j in manifest.joints))


def glove(manifest: Manifest) -> Harness:
    """Return a board that sends the counts of its pins."""
    return parse_harness(
        GLOVE.format(", ".join(f"{joint.name} = [0, 1023]" for joint in manifest.joints)), "glove.toml"
    )


@pytest.fixture
def library(tmp_path: Path) -> Callable[..., Path]:
    """Return what writes the library "hand" of a layout."""

    def library(layout: Layout, known: bool = True) -> Path:
        manifest = on_pins(describe(layout.tables))
        sensors = sensors_of(manifest, glove(manifest)) if known and manifest.joints else None
        for name, text in TARGETS["arduino"].files(Files("hand", manifest, layout, glove=sensors)).items():
            path = tmp_path / "thenar_hand" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return tmp_path / "thenar_hand"

    return library


@pytest.fixture
def sketch(arduino: Callable[..., Path]) -> Callable[..., Path]:
    """Return what has Arduino's builder compile a library and its example for a board, without a warning about them."""

    def sketch(library: Path, board: str, given: str = "") -> Path:
        example = library / "examples/Recognise/Recognise.ino"
        return arduino(example, "thenar", BOARDS[board][1], library.parent, given)

    return sketch


Library = Callable[..., Path]
Sketch = Callable[..., Path]


@pytest.mark.parametrize("entry_bits", [16, 8])
@pytest.mark.parametrize("board", list(BOARDS))
def test_the_example_prints_the_grasp_that_python_finds(
    library: Library, sketch: Sketch, board: str, entry_bits: int
) -> None:
    tables = make_tables(**ON_A_BOARD[board], reach=20 if entry_bits == 8 else 300)
    elf = sketch(library(Layout(tables)), board)
    build = Build(describe(tables), tables)
    # Nothing is wired: pulled up, every switch is open; the simulator's analog inputs are at 0 V.
    codes = np.ones(tables.n_joints, np.uint16)
    wanted = build.classify(np.zeros(tables.n_switches, bool), codes)
    assert wanted != build.classify(np.ones(tables.n_switches, bool), codes)
    assert first_line(tool("simavr"), elf, BOARDS[board][0]) == wanted


def first_line(simavr: str, elf: Path, part: str) -> str:
    """Return the first line that a program prints at its UART: simavr repeats it in colours, on standard output."""
    command = [simavr, "-m", part, "-f", "16000000", str(elf)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        assert process.stdout is not None
        try:
            lines = (re.sub(r"\x1b\[[0-9;]*m", "", line).strip() for line in process.stdout)
            return next(line.rstrip(".") for line in lines if line.startswith("grasp"))
        finally:
            process.kill()


@pytest.mark.parametrize(
    "inputs",
    [{"switches": 12, "joints": 6}, {"switches": 2, "joints": 7}, {"switches": 40, "joints": 17, "bins": 3}],
    ids=["switches", "joints", "both"],
)
def test_inputs_beyond_the_boards_pins_are_read_by_other_parts(
    library: Library, sketch: Sketch, inputs: dict[str, int]
) -> None:
    sketch(library(Layout(make_tables(**inputs))), "uno")


def test_it_refuses_readings_of_which_nothing_is_known(library: Library, sketch: Sketch) -> None:
    made = library(Layout(make_tables(highest=1000)), known=False)
    assert "{0, 0}, /* j0: code 0 and code 50 */" in (made / "examples/Recognise/Recognise.ino").read_text()
    for given in ("-DCALIBRATED=1", "-DSHOW_READINGS"):
        sketch(made, "uno", given)
    with pytest.raises(AssertionError, match=r"#error .unknown readings: thenar firmware --glove, or SHOW_READINGS"):
        sketch(made, "uno")


def test_the_properties_are_those_that_the_specification_asks_for(library: Library) -> None:
    lines = (library(Layout(make_tables())) / "library.properties").read_text().splitlines()
    fields = dict(line.split("=", 1) for line in lines)
    # The page that `url` names is whoever's who publishes the library: one that is empty is worse than none.
    given = ["name", "version", "author", "maintainer", "sentence", "paragraph", "category", "architectures"]
    assert [*fields] == [*given, "includes"]
    assert re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_. -]{,62}", fields["name"])
    assert re.fullmatch(r"\d+\.\d+\.\d+", fields["version"])
    assert (fields["architectures"], fields["includes"], fields["category"]) == ("*", "thenar_hand.h", "Sensors")
    assert fields["sentence"] == "Recognises 5 grasp types from 9 switches and 3 joints of a glove."


def test_names_that_are_no_words_of_c_do_no_harm(library: Library, sketch: Sketch, tmp_path: Path) -> None:
    tables = make_tables(switches=2, joints=1)
    layout = Layout(tables)
    manifest = describe(tables)
    names = ["*/ int \\", "tip\n#error \u00e9"]
    switches = tuple(replace(switch, name=name) for switch, name in zip(manifest.switches, names, strict=True))
    joints = (replace(manifest.joints[0], name="roll ??/"),)
    made = library(layout)
    named = replace(manifest, switches=switches, joints=joints)
    odd = TARGETS["arduino"].files(Files("hand", named, layout))
    (made / "examples/Recognise/Recognise.ino").write_text(odd["examples/Recognise/Recognise.ino"])
    sketch(made, "uno", "-DCALIBRATED=1")

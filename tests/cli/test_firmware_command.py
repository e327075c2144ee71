import dataclasses
import json
import re
from pathlib import Path

import pytest

from thenar.compiler import GraspSet, compile_build
from thenar.runtime.build import Build

from ..conftest import tool
from .conftest import refusal, thenar, works


@pytest.fixture(scope="module")
def build(small_set: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_build(small_set, tmp_path_factory.mktemp("builds") / "build", rounds=10, folds=0).folder


def content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


NEXT_STEP = {
    "avr328p": "`make -C {made}` compiles it",
    "avr2560": "`make -C {made}` compiles it",
    "cortex-m0plus": "{made} holds the sources to compile",
    "cortex-m4": "{made} holds the sources to compile",
    "rv32imac": "{made} holds the sources to compile",
    "arduino": "copy it into `libraries` of your sketchbook; {made}/README.md lists other build systems",
    "esp32": "{made}/README.md explains how to use it in each ecosystem",
}


@pytest.mark.parametrize("target", NEXT_STEP)
def test_firmware_writes_a_folder_and_reports_cost_and_next_steps(build: Path, tmp_path: Path, target: str) -> None:
    done = works("firmware", build, "--target", target, "-o", tmp_path / "made")
    cost = r"about \d+ (cycles|instructions) a frame, \d+ bytes of flash, \d+ of RAM$"
    assert re.search(rf"^cost for [^:]*: {cost}", done.stdout, re.MULTILINE)
    made = tmp_path / "made"
    assert done.stdout.endswith(f"{made}: firmware for {target}; {NEXT_STEP[target].format(made=made)}\n")
    assert ("Makefile" in content(made)) == ("`make " in done.stdout)
    assert any(path.endswith("thenar_glove.h") for path in content(made))


def test_on_this_machine_no_microcontroller_and_no_cost_is_told_of(build: Path, tmp_path: Path) -> None:
    done = works("firmware", build, "--target", "host", "-o", tmp_path / "made")
    assert done.stdout == (
        f"{tmp_path / 'made'}: firmware for host; `make -C {tmp_path / 'made'} check` compiles and tests it\n"
    )
    told = json.loads(thenar("firmware", build, "--target", "host", "-o", tmp_path / "json", "--json").stdout)
    assert (told["part"], told["cost"]) == ("host", None)
    assert not re.search("atmega|cycles", done.stdout)
    assert "atmega" not in (tmp_path / "made" / "thenar_glove.h").read_text()


def test_a_cost_has_a_unit(build: Path, tmp_path: Path) -> None:
    for target, unit in (("avr328p", "cycles"), ("cortex-m4", "instructions")):
        told = json.loads(thenar("firmware", build, "--target", target, "-o", tmp_path / target, "--json").stdout)
        assert told["cost"]["unit"] == unit


def test_a_flash_limit_is_kept(build: Path, tmp_path: Path) -> None:
    limited = ("firmware", build, "--target", "avr328p", "-o", tmp_path / "made", "--json", "--overwrite")
    cost = json.loads(thenar(*limited).stdout)["cost"]
    assert json.loads(thenar(*limited, "--flash-limit", cost["flash"]).stdout)["cost"] == cost
    less = json.loads(thenar(*limited, "--flash-limit", cost["flash"] - 1).stdout)["cost"]
    assert less["flash"] < cost["flash"]
    assert less["time"] > cost["time"]
    said = refusal(*limited, "--flash-limit", 100)
    assert said == (
        f"thenar: the classifier takes about {less['flash']} bytes of flash and {less['ram']} of RAM on an atmega328p, "
        "but 100 and 2048 are allowed: compile with a higher --prune, fewer --rounds or a smaller --max-bins, or use a "
        "larger part\n"
    )


@pytest.mark.slow
def test_what_was_measured_stands_in_the_header(build: Path, tmp_path: Path) -> None:
    for name in ("avr-gcc", "make"):
        tool(name)
    done = works("firmware", build, "--target", "avr328p", "-o", tmp_path / "made", "--measure", "--json")
    measured = json.loads(done.stdout)["measured"]
    for what in ("time", "flash", "ram"):
        assert measured[what] > 0
    opening = " ".join((tmp_path / "made" / "thenar_glove.h").read_text().split("*/")[0].replace("\n *", "\n").split())
    assert f"at most {measured['time']} {measured['unit']} a frame; " in opening
    assert f"{measured['flash']} bytes of flash; " in opening


def glove_toml(build: Path, without: str = "", no_pin: str = "", matrix: str = "") -> str:
    """Return a glove.toml with the elements of a build on pins of a board, except one, and one without a pin."""
    manifest = Build.load(build).manifest
    switches, joints = (
        [each.name for each in kind if each.name != without] for kind in (manifest.switches, manifest.joints)
    )
    pins = {name: str(pin) for pin, name in enumerate(switches, 2)} | {
        name: f"A{pin}" for pin, name in enumerate(joints)
    }
    pins.pop(no_pin, None)
    wired = ", ".join(f'"{name}" = "{pin}"' for name, pin in pins.items())
    ranges = ", ".join(f"{name} = [0, 1023]" for name in joints)
    columns = [*switches, *["x", "y", "z"] * bool(matrix)]
    return (
        f'name = "glove"\n[[stream]]\nport = "/dev/ttyACM0"\nswitches = {columns}\n'
        f"joints = {{ {ranges} }}\n[stream.board]\npins = {{ {wired} }}\n{matrix}"
    )


@pytest.fixture
def glove(build: Path, tmp_path: Path) -> Path:
    """Return a glove.toml with all elements of the build on pins of a board."""
    (tmp_path / "glove.toml").write_text(glove_toml(build))
    return tmp_path / "glove.toml"


def test_a_sketch_that_prints_rows_is_written(build: Path, glove: Path, tmp_path: Path) -> None:
    made = tmp_path / "made"
    done = works("firmware", build, "--mode", "rows", "--glove", glove, "--name", "left", "-o", made)
    assert done.stdout == f"{made}: a sketch for Arduino's cores; {made}/README.md explains how to compile it\n"
    assert content(made).keys() == {"left/left.ino", "README.md", "SHA256SUMS"}
    again = ("firmware", build, "--mode", "rows", "--glove", glove, "-o", made, "--overwrite", "--json")
    assert json.loads(thenar(*again).stdout) == {"files": ["README.md", "glove/glove.ino"]}


def test_firmware_is_replaced_when_asked_and_the_users_files_stay(build: Path, tmp_path: Path) -> None:
    made = ("firmware", build, "--target", "host", "-o", tmp_path / "made")
    assert thenar(*made).returncode == 0
    (tmp_path / "made" / "mine.c").write_text("int mine;\n")
    assert "already holds firmware: name another folder, or add --overwrite" in refusal(*made)
    assert thenar(*made, "--name", "left_hand", "--overwrite").returncode == 0
    assert {"mine.c", "thenar_left_hand.c"} <= content(tmp_path / "made").keys()
    assert "thenar_glove.c" not in content(tmp_path / "made")


def test_a_gloves_ranges_calibrate_its_pins(build: Path, tmp_path: Path) -> None:
    joints = [joint.name for joint in Build.load(build).manifest.joints]
    ranges = ", ".join(f"{name} = [0, 1023]" for name in joints)
    glove = tmp_path / "glove.toml"
    glove.write_text(f'name = "glove"\n[[stream]]\nport = "/dev/ttyUSB0"\njoints = {{ {ranges} }}\n')
    for given, known in (((), 0), (("--glove", glove), 1)):
        made = tmp_path / f"made{known}"
        works("firmware", build, "--target", "arduino", *given, "-o", made)
        header = (made / "src" / "thenar_glove_codes.h").read_text()
        assert f"#define THENAR_GLOVE_CALIBRATED {known} " in header
        sketch = (made / "examples/Recognise/Recognise.ino").read_text()
        assert ("unknown readings" in sketch) != bool(known)
    glove.write_text(glove.read_text().replace("[0, 1023]", "[0, 3.3]"))
    assert "0 to 3.3, must be whole numbers" in refusal(
        "firmware", build, "--target", "arduino", "--glove", glove, "-o", tmp_path / "none"
    )
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--target", "avr328p"), "name a folder to write with -o"),
        (("-o", "made"), "A library needs a target: name one with --target"),
        (("--mode", "rows", "-o", "made"), "name them with --glove and -o"),
        (("--mode", "rows", "--glove", "{glove}"), "name them with --glove and -o"),
        (("--mode", "rows", "--target", "avr328p", "--glove", "{glove}", "-o", "made"), "--target is for libraries"),
        (("--mode", "rows", "--measure", "--glove", "{glove}", "-o", "made"), "--measure is for libraries"),
        (
            ("--mode", "rows", "--flash-limit", "9", "--glove", "{glove}", "-o", "made"),
            "--flash-limit is for libraries",
        ),
        (("--mode", "rows", "--name", "../x", "--glove", "{glove}", "-o", "made"), "'../x' cannot be the name"),
        (("--target", "avr328p", "--flash-limit", "32769", "-o", "made"), "an atmega328p has 32768 bytes"),
        (("--target", "avr328p", "--name", "../x", "-o", "made"), "'../x' cannot be the name: use lower-case"),
        (("--target", "avr328p", "-o", "nowhere/made"), "nowhere is no folder: make it first"),
    ],
)
def test_what_cannot_be_is_one_sentence(build: Path, glove: Path, arguments: tuple[str, ...], message: str) -> None:
    said = refusal("firmware", build, *(argument.format(glove=glove) for argument in arguments))
    assert message in said
    assert len(said.splitlines()) == 1
    assert not Path("made").exists()


GHOSTS = 'matrix = { rows = ["20", "21"], columns = ["22", "23"], keys = [["s0", "x"], ["y", "z"]], diodes = false }'


@pytest.mark.parametrize(
    ("glove", "message"),
    [
        ({"without": "s0"}, "harness 'glove' has no s0, which the build keeps: add it"),
        ({"no_pin": "s0"}, "the board at /dev/ttyACM0 has no pin for s0, which the build keeps: add it"),
        (
            {"no_pin": "s0", "matrix": GHOSTS},
            "the matrix has no diodes, so that of s0, y, x, z the fourth reads closed when three are: put a diode",
        ),
    ],
)
def test_a_board_that_cannot_read_a_kept_element_is_refused(
    build: Path, tmp_path: Path, glove: dict[str, str], message: str
) -> None:
    (tmp_path / "glove.toml").write_text(glove_toml(build, **glove))
    assert message in refusal(
        "firmware", build, "--mode", "rows", "--glove", tmp_path / "glove.toml", "-o", tmp_path / "made"
    )
    assert not (tmp_path / "made").exists()


def test_a_stream_without_a_board_has_no_sketch(build: Path, glove: Path, tmp_path: Path) -> None:
    glove.write_text(glove.read_text().partition("[stream.board]")[0])
    assert "no stream of harness 'glove' has a board with elements of the build: describe the board's" in refusal(
        "firmware", build, "--mode", "rows", "--glove", glove, "-o", tmp_path / "made"
    )


def test_a_name_that_ends_a_column_is_refused(small_set: GraspSet, tmp_path: Path) -> None:
    named = dataclasses.replace(small_set, switch_names=("tip, left", *small_set.switch_names[1:]))
    build = compile_build(named, tmp_path / "build", rounds=10, folds=0).folder
    (tmp_path / "glove.toml").write_text(glove_toml(build))
    assert "'tip, left' cannot be the name of a column, which ends at a comma or an asterisk" in refusal(
        "firmware", build, "--mode", "rows", "--glove", tmp_path / "glove.toml", "-o", tmp_path / "made"
    )


def test_a_folder_that_is_no_build_is_named(tmp_path: Path) -> None:
    assert f"is {tmp_path} a build?" in refusal("firmware", tmp_path, "--target", "avr328p", "-o", tmp_path / "made")

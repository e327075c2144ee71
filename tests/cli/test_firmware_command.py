import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler import GraspSet, Joint, Options, compile_build
from thenar.compiler.recordings.taxonomy import own
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.runtime.build import Build

Thenar = Callable[..., subprocess.CompletedProcess[str]]
Tool = Callable[[str], str]

BOARD = 'part = "atmega328p"\n[pins]\n' + "\n".join(f's{number} = "PD{number + 2}"' for number in range(6)) + "\n"


@pytest.fixture(scope="module")
def build(small_set: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_build(small_set, tmp_path_factory.mktemp("builds") / "build", rounds=10, folds=0).folder


@pytest.fixture
def board(tmp_path: Path) -> Path:
    (tmp_path / "board.toml").write_text(BOARD)
    return tmp_path / "board.toml"


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
def test_a_folder_is_written_and_its_cost_told_and_what_to_do_next(
    thenar: Thenar, build: Path, tmp_path: Path, target: str
) -> None:
    done = thenar("firmware", build, "--target", target, "-o", tmp_path / "made")
    assert done.returncode == 0, done.stderr
    cost = r"about \d+ (cycles|instructions) a frame, \d+ bytes of flash, \d+ of RAM$"
    assert re.search(rf"^layout for [^:]*: \d+-bit entries.*, {cost}", done.stdout, re.MULTILINE)
    made = tmp_path / "made"
    assert done.stdout.endswith(f"{made}: firmware for {target}; {NEXT_STEP[target].format(made=made)}\n")
    assert ("Makefile" in content(made)) == ("`make " in done.stdout)
    assert any(path.endswith("thenar_glove.h") for path in content(made))


def test_on_this_machine_no_microcontroller_and_no_cost_is_told_of(thenar: Thenar, build: Path, tmp_path: Path) -> None:
    done = thenar("firmware", build, "--target", "host", "-o", tmp_path / "made")
    assert done.returncode == 0, done.stderr
    layout, ending = done.stdout.splitlines()
    assert layout.startswith("layout for this machine: ")
    assert (
        ending == f"{tmp_path / 'made'}: firmware for host; `make -C {tmp_path / 'made'} check` compiles and tests it"
    )
    told = json.loads(thenar("firmware", build, "--target", "host", "-o", tmp_path / "json", "--json").stdout)
    assert (told["part"], told["cost"]) == ("host", None)
    assert not re.search("atmega|cycles", done.stdout + told["layout"])
    assert "atmega" not in (tmp_path / "made" / "thenar_glove.h").read_text()


def test_a_cost_has_a_unit(thenar: Thenar, build: Path, tmp_path: Path) -> None:
    for target, unit in (("avr328p", "cycles"), ("cortex-m4", "instructions")):
        told = json.loads(thenar("firmware", build, "--target", target, "-o", tmp_path / target, "--json").stdout)
        assert told["cost"]["unit"] == unit


def test_the_same_build_gives_the_same_bytes(thenar: Thenar, build: Path, tmp_path: Path) -> None:
    for name in ("one", "two"):
        assert thenar("firmware", build, "--target", "avr328p", "-o", tmp_path / name).returncode == 0
    assert content(tmp_path / "one") == content(tmp_path / "two")


def test_a_flash_limit_is_kept(thenar: Thenar, build: Path, tmp_path: Path) -> None:
    limited = ("firmware", build, "--target", "avr328p", "-o", tmp_path / "made", "--json", "--overwrite")
    cost = json.loads(thenar(*limited).stdout)["cost"]
    assert json.loads(thenar(*limited, "--flash-limit", cost["flash"]).stdout)["cost"] == cost
    done = thenar(*limited, "--flash-limit", cost["flash"] - 1)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"thenar: the classifier takes about {cost['flash']} bytes of flash and {cost['ram']} of RAM on an atmega328p, "
        f"but {cost['flash'] - 1} and 2048 are allowed: compile with a higher --prune, fewer --rounds or "
        "--table-bits 8, or use a larger part\n"
    )


@pytest.mark.slow
def test_what_was_measured_stands_in_the_header(thenar: Thenar, build: Path, tmp_path: Path, tool: Tool) -> None:
    for name in ("avr-gcc", "make"):
        tool(name)
    done = thenar("firmware", build, "--target", "avr328p", "-o", tmp_path / "made", "--measure", "--json")
    assert done.returncode == 0, done.stderr
    measured = json.loads(done.stdout)["measured"]
    for what in ("time", "flash", "flash_classify", "ram"):
        assert measured[what] > 0
    opening = " ".join((tmp_path / "made" / "thenar_glove.h").read_text().split("*/")[0].replace("\n *", "\n").split())
    assert f"at most {measured['time']} {measured['unit']} a frame, " in opening
    assert f"{measured['flash']} bytes of flash, " in opening


def test_on_this_machine_there_is_nothing_to_count(thenar: Thenar, build: Path) -> None:
    done = thenar("firmware", build, "--target", "host", "--measure")
    assert done.returncode == 2
    assert "The host has no cycle counts" in done.stderr


def test_a_board_that_scans_is_written(thenar: Thenar, build: Path, board: Path, tmp_path: Path) -> None:
    arguments = ("--target", "avr328p", "--mode", "scan", "--board", board, "-o", tmp_path / "made")
    done = thenar("firmware", build, *arguments)
    assert done.returncode == 0, done.stderr
    assert {"main.c", "Makefile", "glove.toml", "thenar_board.c"} <= content(tmp_path / "made").keys()
    assert "thenar_glove.c" not in content(tmp_path / "made")
    assert "layout" not in done.stdout


def test_firmware_is_replaced_when_asked_and_the_users_files_stay(thenar: Thenar, build: Path, tmp_path: Path) -> None:
    made = ("firmware", build, "--target", "host", "-o", tmp_path / "made")
    assert thenar(*made).returncode == 0
    (tmp_path / "made" / "mine.c").write_text("int mine;\n")
    again = thenar(*made)
    assert again.returncode == 2
    assert "already holds firmware: name another folder, or add --overwrite" in again.stderr
    assert thenar(*made, "--name", "left_hand", "--overwrite").returncode == 0
    assert {"mine.c", "thenar_left_hand.c"} <= content(tmp_path / "made").keys()
    assert "thenar_glove.c" not in content(tmp_path / "made")


def test_a_glove_s_ranges_are_what_its_pins_read_and_boards_that_fit_are_told(
    thenar: Thenar, build: Path, tmp_path: Path
) -> None:
    joints = [joint.name for joint in Build.load(build).manifest.joints]
    ranges = ", ".join(f"{name} = [0, 1023]" for name in joints)
    glove = tmp_path / "glove.toml"
    glove.write_text(f'name = "glove"\n[[stream]]\nport = "/dev/ttyUSB0"\njoints = {{ {ranges} }}\n')
    for given, known in (((), 0), (("--glove", glove), 1)):
        made = tmp_path / f"made{known}"
        done = thenar("firmware", build, "--target", "arduino", *given, "-o", made)
        assert done.returncode == 0, done.stderr
        assert "\nthe example Recognise fits Arduino Uno and Nano and Mega as it is.\n" in done.stdout
        header = (made / "src" / "thenar_glove_codes.h").read_text()
        assert f"#define THENAR_GLOVE_CALIBRATED {known} " in header
        sketch = (made / "examples/Recognise/Recognise.ino").read_text()
        assert ("unknown readings" in sketch) != bool(known)
    glove.write_text(glove.read_text().replace("[0, 1023]", "[0, 3.3]"))
    done = thenar("firmware", build, "--target", "arduino", "--glove", glove, "-o", tmp_path / "none")
    assert done.returncode == 2
    assert "0 to 3.3, must be whole numbers" in done.stderr
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--target", "avr328p"), "name a folder to write with -o"),
        (("--target", "pdp11", "-o", "made"), "there is no target 'pdp11': choose one of host"),
        (("--target", "avr328p", "--mode", "scan", "-o", "made"), "the mode scan needs a board.toml"),
        (("--target", "avr328p", "--mode", "scan", "--measure"), "A board that only scans has no classifier"),
        (
            ("--target", "avr328p", "--mode", "scan", "--calibration", "{board}", "-o", "made"),
            "a scanning board reads no CyberGlove",
        ),
        (
            ("--target", "avr328p", "--mode", "glove", "--glove", "{board}", "-o", "made"),
            "--glove is for --mode classify",
        ),
        (
            ("--target", "avr328p", "--calibration", "{board}", "--glove", "{board}", "-o", "made"),
            "leave out --calibration, or --glove",
        ),
        (("--target", "avr328p", "--board", "{board}", "-o", "made"), "the mode classify reads no board"),
        (
            ("--target", "avr2560", "--mode", "scan", "--board", "{board}", "-o", "made"),
            "the board has an atmega328p, but the target avr2560 is an atmega2560",
        ),
        (("--target", "avr328p", "--flash-limit", "32769", "-o", "made"), "an atmega328p has 32768 bytes"),
        (("--target", "avr328p", "--name", "../x", "-o", "made"), "'../x' cannot be the name: use lower-case"),
        (("--target", "avr328p", "-o", "nowhere/made"), "nowhere is no folder: make it first"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    thenar: Thenar, build: Path, board: Path, arguments: tuple[str, ...], message: str
) -> None:
    done = thenar("firmware", build, *(argument.format(board=board) for argument in arguments))
    assert (done.returncode, done.stdout) == (2, "")
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not Path("made").exists()


def test_a_matrix_that_lacks_a_kept_switch_names_it(thenar: Thenar, build: Path, tmp_path: Path) -> None:
    first, *others = [switch.name for switch in Build.load(build).manifest.switches]
    columns = [f"PB{number}" for number in range(len(others))]
    matrix = {"rows": ["PD2"], "columns": columns, "switches": [others]}
    lines = (f"{key} = {json.dumps(value)}\n" for key, value in matrix.items())
    (tmp_path / "board.toml").write_text(f'part = "atmega328p"\n[matrix]\ndiodes = true\n{"".join(lines)}')
    for mode in ("glove", "scan"):
        made = ("--mode", mode, "--board", tmp_path / "board.toml", "-o", tmp_path / "made")
        done = thenar("firmware", build, "--target", "avr328p", *made)
        assert (done.returncode, done.stdout) == (2, "")
        assert f"the board has no pin or column for {first}, which the build keeps" in done.stderr


def test_tables_too_large_for_a_glove_name_a_remedy_that_works(thenar: Thenar, tmp_path: Path) -> None:
    joints, types, random = [f"j{number}" for number in range(16)], 8, np.random.default_rng(1)
    labels = np.arange(10 * types) % types
    centres = random.integers(40, 200, (types, len(joints)))
    grasp_set = GraspSet(
        switches=(labels[:, np.newaxis] == np.arange(2)),
        switch_names=("s0", "s1"),
        codes=(centres[labels] + random.integers(-9, 10, (len(labels), len(joints)))).astype(np.uint16),
        joints=tuple(Joint(name, "deg", 0, 0.0, 255, 127.5) for name in joints),
        grasps=np.array([f"g{label}" for label in labels]),
        taxonomy=own([f"g{label}" for label in range(types)]),
        subjects=np.full(len(labels), "A"),
        objects=np.full(len(labels), "thing"),
        trials=np.arange(len(labels)),
    )
    sensors = f"[cyberglove]\njoints = {json.dumps([*joints, '', ''])}\n"
    (tmp_path / "board.toml").write_text(f'part = "atmega2560"\n[pins]\ns0 = "PA0"\ns1 = "PA1"\n{sensors}')
    hand = GloveCalibration(sensors=tuple(SensorCalibration(name, 40, 0.0, 200, 90.0) for name in joints))
    (tmp_path / "hand.toml").write_text(hand.to_toml())
    said = {}
    for linear in (1, 0):
        settings: dict[str, float | str] = {"penalty": 1.0, "smoothness": 1.0, "linear": linear}
        options = Options(trainer="logit", max_bins=16, settings=settings, folds=0, refuse=0.0)
        made = compile_build(grasp_set, tmp_path / "build", options, jobs=1)
        wired = ("--board", tmp_path / "board.toml", "--calibration", tmp_path / "hand.toml", "-o", tmp_path / "made")
        said[linear] = thenar("firmware", made.folder, "--target", "avr2560", "--mode", "glove", *wired)
    assert said[1].returncode == 2
    assert "an array of an AVR has at most 32767: compile with --linear 0 --max-bins 16" in said[1].stderr
    assert said[0].returncode == 0, said[0].stderr


def test_a_folder_that_is_no_build_is_named(thenar: Thenar, tmp_path: Path) -> None:
    done = thenar("firmware", tmp_path, "--target", "avr328p", "-o", tmp_path / "made")
    assert done.returncode == 2
    assert f"is {tmp_path} a build?" in done.stderr

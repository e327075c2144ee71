from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.targets import TARGETS, Target, kinds, timed

from ....conftest import tool
from ....tables import describe
from ..conftest import make_tables, probed, same_as_python


@pytest.mark.parametrize("name", TARGETS)
def test_every_target_describes_itself_and_its_folder(name: str) -> None:
    target = TARGETS[name]
    assert (target.name, bool(target.help), bool(target.part)) == (name, True, True)
    assert "{folder}" in target.next_step
    assert not target.kind or target.missing() is None or "apt-get install" in str(target.missing())
    if target.kind and target.formula:
        assert target.compiler is not None


def test_the_page_on_firmware_names_every_target() -> None:
    page = (Path(__file__).parents[4] / "docs" / "how-to" / "firmware.md").read_text()
    assert [name for name in TARGETS if f"`{name}`" not in page] == []


def test_what_is_verified_and_what_is_timed_is_read_off_the_targets() -> None:
    assert kinds() == ("host", "avr", "micropython")
    assert timed() == ("avr328p", "avr2560", "cortex-m0plus", "cortex-m4", "rv32imac", "host", "pi")


def test_a_target_without_a_simulator_says_so() -> None:
    core = Target(name="rv64", part="rv64gc", help="a core", flash=1 << 17, ram=1 << 14)
    layout = Layout(make_tables())
    assert core.missing() == "thenar has no simulator of an rv64gc: measure its cost on the board"
    with pytest.raises(FirmwareError, match="no simulator of an rv64gc"):
        core.run({}, "hand", layout, np.zeros((1, 5), np.uint8))


UNITS = {
    "host": "",
    "avr328p": "cycles",
    "avr2560": "cycles",
    "cortex-m0plus": "instructions",
    "cortex-m4": "instructions",
    "rv32imac": "instructions",
}


@pytest.mark.parametrize("part", list(UNITS))
def test_every_target_answers_as_python_does(request: pytest.FixtureRequest, part: str) -> None:
    target = TARGETS[part]
    runs = target if target.kind else request.getfixturevalue("cores")[part]
    if (missing := runs.missing()) is not None:
        tool(missing.split()[0])
    tables = make_tables(classes=7, switches=12, joints=4)
    layout, frames = Layout(tables), probed(tables, 500)
    files = Library("hand", describe(tables), layout).files
    sent = layout.frame_bytes(frames.bits, frames.codes)
    answers = runs.run(files, "hand", layout, sent)
    same_as_python(answers, tables, frames)
    assert answers.unit == UNITS[part]
    assert (answers.cost is None) == (part == "host")
    assert answers.cost is None or bool(np.all(answers.cost > 0))


NEEDED = {
    "host": "gcc or clang not found; Debian: apt-get install gcc",
    "avr328p": "avr-gcc and gcc or clang and make not found; Debian: apt-get install gcc-avr avr-libc gcc make",
}


@pytest.mark.parametrize("part", list(NEEDED))
def test_missing_tools_are_named_before_anything_is_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, part: str
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert TARGETS[part].missing() == NEEDED[part]

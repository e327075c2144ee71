from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.targets import TARGETS

from ....conftest import tool
from ....tables import describe
from ..conftest import make_tables, probed, same_as_python

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

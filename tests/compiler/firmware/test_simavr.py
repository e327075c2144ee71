from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.targets import TARGETS, Target
from thenar.firmware_templates.rendering import file_text
from thenar.runtime.model.integers import IntegerTables

from ...conftest import tool

SMALL, LARGE = TARGETS["avr328p"], TARGETS["avr2560"]
TABLES = """
#define THENAR_TEST_MEMORY 12u
extern const thenar_model thenar_test_model;
"""
# A hundred turns more where the switch is closed; eight bytes on the stack. The grasp is the switch.
SOURCE = """
#include "thenar_test.h"
const thenar_model thenar_test_model;
void thenar_init(thenar *hand, const thenar_model *model, uint16_t *memory)
{
    hand->model = model;
    hand->switches = (uint8_t *)memory;
    hand->scores = (int16_t *)(memory + 1);
}
uint16_t thenar_classify(thenar *hand)
{
    const uint8_t closed = hand->switches[0];
    uint8_t turns = (uint8_t)(1u + 100u * closed);
    __asm__ volatile (".rept 8\\n push r0\\n .endr\\n .rept 8\\n pop r0\\n .endr\\n"
                      "1: dec %0\\n brne 1b" : "+r" (turns));
    hand->scores[0] = closed;
    hand->scores[1] = -2;
    return closed;
}
"""
HEADER = '#include "thenar.h"\n' + TABLES
BY_HAND = {"thenar.h": file_text("core/thenar.h"), "thenar_test.h": HEADER, "thenar_test.c": SOURCE}
BOTH = pytest.mark.parametrize("target", [SMALL, LARGE], ids=["328P", "2560"])


@pytest.fixture(autouse=True)
def installed() -> None:
    tool("avr-gcc")
    if (gone := SMALL.missing()) is not None:
        assert "libsimavr" in gone, gone
        tool("libsimavr-dev")


def one_switch() -> IntegerTables:
    one = np.ones((1, 2), np.int16)
    return IntegerTables.of(
        bias=0 * one[0],
        switch_rows=one,
        thresholds=(),
        joint_rows=(),
        switch_means=0 * one,
        joint_means=np.empty((0, 2), np.int16),
        scale=1.0,
    )


@BOTH
def test_stack_cycles_and_answers_are_those_of_the_function_alone(target: Target) -> None:
    """A classifier by hand: its stack is eight bytes and the return address, its loop takes three cycles a turn."""
    tables = one_switch()
    layout = Layout(tables)
    frames = layout.frame_bytes(np.array([[False], [True]]), np.empty((2, 0), np.uint16))
    answers = target.run(BY_HAND, "test", layout, frames)
    assert answers.cost is not None
    assert answers.cost.tolist()[1] - answers.cost.tolist()[0] == 3 * 100
    assert answers.stack == 8 + (2 if target is SMALL else 3)
    assert answers.classes.tolist() == [0, 1]
    assert answers.scores.tolist() == [[0, -2], [1, -2]]


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"thenar_test.c": "int unused(void) { int x; return 0; }"}, "unused variable"),
        ({"thenar_test.h": HEADER.replace("12u", "14u")}, "memory has 28 bytes"),
        ({"thenar_test.c": SOURCE.replace("thenar_classify", "other")}, "thenar_classify"),
        ({"thenar_test.c": SOURCE.replace("brne", "rjmp")}, "does not return within"),
    ],
    ids=["warning", "another frame", "no classify", "hangs"],
)
def test_files_that_are_no_such_classifier_are_an_error(changed: dict[str, str], said: str) -> None:
    layout = Layout(one_switch())
    with pytest.raises(FirmwareError, match=said):
        SMALL.run({**BY_HAND, **changed}, "test", layout, np.ones((1, 2), np.uint8))


def test_what_is_missing_is_named_with_the_packages_that_bring_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with monkeypatch.context() as changed:
        changed.setenv("THENAR_SIMAVR", str(tmp_path))
        assert "has no harness for simavr: set THENAR_SIMAVR" in str(SMALL.missing())
        lacks_libsimavr = "all:\n%:\n\t@echo 'fatal error: simavr/sim_avr.h: No such file' >&2; exit 1\n"
        (tmp_path / "Makefile").write_text(lacks_libsimavr)
        (tmp_path / "simavr_classify.c").touch()
        assert SMALL.missing() == "libsimavr not found; Debian: apt-get install libsimavr-dev"
    monkeypatch.setenv("PATH", str(tmp_path))
    gone = SMALL.missing()
    assert gone is not None
    assert gone.endswith("Debian: apt-get install gcc-avr avr-libc gcc make")

"""The core on emulated 32-bit cores: its instructions are counted exactly, and few."""

from typing import Any

import numpy as np
import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.probes import extreme_frames, joined, random_frames
from thenar.compiler.firmware.words import numbered
from thenar.firmware_templates.rendering import file_text
from thenar.runtime.model.quantise import in_bytes
from thenar.runtime.model.terms.line import Line

from ..conftest import make_tables

# Compilers and simulators of whole programs: minutes, together.
pytestmark = pytest.mark.slow

PARTS = ("cortex-m0plus", "cortex-m4", "rv32imac")
# Of classify() for 33 switches and 16 joints with 14 classes, by bins or by lines.
MOST_INSTRUCTIONS = {"cortex-m0plus": (2300, 1850), "cortex-m4": (1750, 1400), "rv32imac": (1900, 1550)}


@pytest.mark.parametrize("lines", [False, True], ids=["bins", "lines"])
@pytest.mark.parametrize("part", PARTS)
def test_a_frame_takes_few_instructions(cores: Any, part: str, lines: bool) -> None:
    tables = make_tables(classes=14, switches=33, joints=16, reach=200)
    if lines:
        rows = np.arange(-7, 7, dtype=np.int8)
        tables = tables.changed(
            thresholds=tuple(each[:0] for each in tables.thresholds),
            joint_rows=tuple(each[:1] for each in tables.joint_rows),
            further=tuple(Line(joint, 3, 240, rows, 0) for joint in range(16)),
        )
    tables = in_bytes(tables)
    layout, frames = Layout(tables), joined(extreme_frames(tables), random_frames(tables, 1000, 1))
    sent = layout.frame_bytes(frames.bits, frames.codes)
    answers = cores[part].run(Library("hand", numbered(tables), layout).files, "hand", layout, sent)
    assert answers.unit == "instructions"
    assert answers.cost.shape == (len(frames),)
    print(f"{part}, {'lines' if lines else 'bins'}: at most {answers.most} instructions")
    assert answers.most <= MOST_INSTRUCTIONS[part][lines]


# A stand-in for a classifier, whose classify() is given: in assembly its instructions can be counted by hand.
TABLES = """
#include "thenar.h"
#ifdef __riscv
#define UNDEFINED "unimp"
#else
#define UNDEFINED "udf #0"
#endif
#define THENAR_HAND_MEMORY 32u
#define THENAR_HAND_NAME_BYTES 8u
extern const thenar_model thenar_hand_model;
"""
# The switches come first in a hand: the first byte of the frame.
STATE = """
#include "thenar_hand.h"
const thenar_model thenar_hand_model = {.switches = 9u, .joints = 3u};
void thenar_init(thenar *hand, const thenar_model *model, uint16_t *memory)
{
    hand->model = model;
    hand->switches = (uint8_t *)memory;
    hand->scores = (int16_t *)(memory + 4);
}
void thenar_set_switch(thenar *hand, uint16_t number, bool closed)
{
    uint8_t *const byte = &hand->switches[number / 8u];
    *byte = (uint8_t)((*byte & ~(1u << (number % 8u))) | ((unsigned)closed << (number % 8u)));
}
void thenar_set_code(thenar *hand, uint16_t joint, uint16_t code)
{
    hand->scores[joint] = (int16_t)code;
}
void thenar_lose_switch(thenar *hand, uint16_t number, bool lost) { thenar_set_switch(hand, number, lost); }
void thenar_lose_joint(thenar *hand, uint16_t joint, bool lost) { thenar_set_code(hand, joint, lost); }
uint16_t thenar_decide(const thenar *hand, uint16_t grasp) { return hand != NULL ? grasp : 0u; }
uint16_t thenar_margin(const thenar *hand) { return hand->switches[0]; }
uint16_t thenar_probability(const thenar *hand, uint16_t grasp) { return (uint16_t)(hand->switches[0] + grasp); }
uint16_t thenar_name(const thenar_model *model, uint16_t grasp, char *text, uint16_t size)
{
    text[0] = '\\0';
    (void)model;
    (void)grasp;
    (void)size;
    return 0u;
}
"""

# The first byte of the frame says how often the loop is run: 4 instructions, 2 per turn, and 1.
COUNTED = """
__attribute__((naked)) uint16_t thenar_classify(__attribute__((unused)) thenar *hand)
{
#ifdef __riscv
    __asm volatile("    lw   a1, 8(a0)\\n"
                   "    lbu  a0, 0(a1)\\n"
                   "    mv   a2, a0\\n"
                   "    addi a2, a2, 1\\n"
                   "1:  addi a2, a2, -1\\n"
                   "    bnez a2, 1b\\n"
                   "    ret\\n");
#else
    __asm volatile(".syntax unified\\n"
                   "    ldr  r1, [r0, #8]\\n"
                   "    ldrb r0, [r1, #0]\\n"
                   "    movs r2, r0\\n"
                   "    adds r2, r2, #1\\n"
                   "1:  subs r2, r2, #1\\n"
                   "    bne  1b\\n"
                   "    bx   lr\\n"
                   ".ltorg\\n");
#endif
}
"""
FAULTING = """
uint16_t thenar_classify(thenar *hand)
{
    __asm volatile(UNDEFINED);
    return hand->scores[0] > 0;
}
"""


def stand_in(classify: str) -> dict[str, str]:
    return {"thenar.h": file_text("core/thenar.h"), "thenar_hand.h": TABLES, "thenar_hand.c": STATE + classify}


@pytest.fixture
def layout() -> Layout:
    """A layout of frames of two bytes of switches and six of codes, for five classes."""
    return Layout(make_tables())


@pytest.mark.parametrize("part", PARTS)
def test_the_count_of_instructions_is_exact(cores: Any, layout: Layout, part: str) -> None:
    turns = np.arange(256).repeat(4)
    frames = np.zeros((len(turns), 8), np.uint8)
    frames[:, 0] = turns
    answers = cores[part].run(stand_in(COUNTED), "hand", layout, frames)
    assert np.array_equal(answers.classes, turns)
    assert answers.cost is not None
    assert np.array_equal(answers.cost, 4 + 2 * (turns + 1) + 1)


@pytest.mark.parametrize("part", PARTS)
def test_a_classifier_that_faults_is_an_error_that_says_so(cores: Any, layout: Layout, part: str) -> None:
    with pytest.raises(FirmwareError, match=r"qemu-system-\w+ ended with 1: the program faulted"):
        cores[part].run(stand_in(FAULTING), "hand", layout, np.zeros((1, 8), np.uint8), limit_s=60)

"""The portable C on emulated cores: every score is Python's, and the instructions are counted exactly."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import classifier_files
from thenar.compiler.firmware.layout import Layout, arrange
from thenar.compiler.firmware.probes import Predictions, Probes
from thenar.runtime.manifest import Manifest
from thenar.runtime.tables import IntegerTables

# Compilers and simulators of whole programs: minutes, together.
pytestmark = pytest.mark.slow

PARTS = ("cortex-m0plus", "cortex-m4", "rv32imac")
# Of classify() for 33 switches and 16 joints with 14 classes.
MOST_INSTRUCTIONS = {
    ("cortex-m0plus", 16): 930,
    ("cortex-m0plus", 8): 1090,
    ("cortex-m4", 16): 720,
    ("cortex-m4", 8): 680,
    ("rv32imac", 16): 720,
    ("rv32imac", 8): 770,
}

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]
Probed = Callable[[IntegerTables, int], Probes]
SameAsPython = Callable[[Predictions, IntegerTables, Probes], None]


@pytest.mark.parametrize("incremental", [False, True], ids=["classify", "update"])
@pytest.mark.parametrize("entry_bits", [16, 8])
@pytest.mark.parametrize("part", PARTS)
def test_every_score_and_class_is_python_s_in_few_instructions(
    make_tables: MakeTables,
    describe: Describe,
    probed: Probed,
    same_as_python: SameAsPython,
    cores: Any,
    part: str,
    entry_bits: int,
    incremental: bool,
) -> None:
    tables = make_tables(classes=14, switches=33, joints=16, reach=20 if entry_bits == 8 else 300)
    layout, frames = arrange(tables), probed(tables, 10_000)
    files = classifier_files("hand", describe(tables), layout, avr=False)
    sent = layout.frame_bytes(frames.bits, frames.codes)
    answers = cores[part].run(files, "hand", layout, sent, incremental=incremental)
    same_as_python(answers, tables, frames)
    assert answers.unit == "instructions"
    assert answers.cost is not None
    assert answers.cost.shape == (len(frames),)
    assert incremental or answers.cost.max() <= MOST_INSTRUCTIONS[part, entry_bits]


SHAPES = {
    "one_switch": {"switches": 1, "joints": 0},
    "one_joint_two_classes": {"switches": 0, "joints": 1, "classes": 2},
    "more_than_256_classes": {"classes": 260, "reach": 3},
    "wide_codes_after_an_odd_byte": {"switches": 11, "highest": 4095},
}


@pytest.mark.parametrize("shape", list(SHAPES))
@pytest.mark.parametrize("part", PARTS)
def test_so_it_is_for_builds_of_any_shape(
    make_tables: MakeTables,
    describe: Describe,
    probed: Probed,
    same_as_python: SameAsPython,
    cores: Any,
    part: str,
    shape: str,
) -> None:
    tables = make_tables(**SHAPES[shape])
    layout, frames = arrange(tables), probed(tables, 100)
    files = classifier_files("hand", describe(tables), layout, avr=False)
    sent = layout.frame_bytes(frames.bits, frames.codes)
    same_as_python(cores[part].run(files, "hand", layout, sent), tables, frames)


# A stand-in for a classifier, whose classify() is given: in assembly its instructions can be counted by hand.
HEADER = """
#include <stdbool.h>
#include <stdint.h>
#ifdef __riscv
#define UNDEFINED "unimp"
#else
#define UNDEFINED "udf #0"
#endif
typedef struct { uint8_t switches[2]; uint8_t codes[3]; } thenar_hand_frame;
typedef struct { int16_t scores[5]; thenar_hand_frame input; } thenar_hand;
void thenar_hand_init(thenar_hand *glove);
typedef uint8_t thenar_hand_class;
typedef uint8_t thenar_hand_switch;
uint8_t thenar_hand_classify(thenar_hand *glove);
uint8_t thenar_hand_update(thenar_hand *glove);
void thenar_hand_set_switch(thenar_hand *glove, thenar_hand_switch number, bool closed);
const char *thenar_hand_grasp(thenar_hand_class grasp);
uint16_t thenar_hand_margin(const thenar_hand *glove);
uint16_t thenar_hand_probability(const thenar_hand *glove, thenar_hand_class grasp);
"""
STATE = """
#include "thenar_hand.h"
void thenar_hand_init(thenar_hand *glove) { glove->scores[0] = 0; }
void thenar_hand_set_switch(thenar_hand *glove, thenar_hand_switch number, bool closed)
{
    if (number == 1 && closed) glove->scores[2]++;
}
const char *thenar_hand_grasp(thenar_hand_class grasp) { return grasp == 4 ? "last" : ""; }
uint16_t thenar_hand_margin(const thenar_hand *glove) { return glove->input.codes[0]; }
uint16_t thenar_hand_probability(const thenar_hand *glove, thenar_hand_class grasp)
{
    return (uint16_t)(glove->input.codes[0] + grasp);
}
"""
UPDATE = "uint8_t thenar_hand_update(thenar_hand *glove) { return thenar_hand_classify(glove); }\n"

# The first byte of the frame says how often the loop is run: 4 instructions, 2 per turn, and 1.
COUNTED = """
__attribute__((naked)) uint8_t thenar_hand_classify(__attribute__((unused)) thenar_hand *glove)
{
#ifdef __riscv
    __asm volatile("    mv   a1, a0\\n"
                   "    lbu  a0, 10(a1)\\n"
                   "    mv   a2, a0\\n"
                   "    addi a2, a2, 1\\n"
                   "1:  addi a2, a2, -1\\n"
                   "    bnez a2, 1b\\n"
                   "    ret\\n");
#else
    __asm volatile(".syntax unified\\n"
                   "    movs r1, r0\\n"
                   "    ldrb r0, [r1, #10]\\n"
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
uint8_t thenar_hand_classify(thenar_hand *glove)
{
    __asm volatile(UNDEFINED);
    return glove->scores[0] > 0;
}
"""


def stand_in(classify: str) -> dict[str, str]:
    return {"thenar_hand.h": HEADER, "thenar_hand.c": STATE + classify + UPDATE}


@pytest.fixture
def layout(make_tables: MakeTables) -> Layout:
    """A layout of frames of two bytes of switches and three of codes, for five classes."""
    return arrange(make_tables())


@pytest.mark.parametrize("part", PARTS)
def test_the_count_of_instructions_is_exact(cores: Any, layout: Layout, part: str) -> None:
    turns = np.arange(256).repeat(4)
    frames = np.zeros((len(turns), 5), np.uint8)
    frames[:, 0] = turns
    answers = cores[part].run(stand_in(COUNTED), "hand", layout, frames)
    assert np.array_equal(answers.classes, turns)
    assert answers.cost is not None
    assert np.array_equal(answers.cost, 4 + 2 * (turns + 1) + 1)


@pytest.mark.parametrize("part", PARTS)
def test_a_classifier_that_faults_is_an_error_that_says_so(cores: Any, layout: Layout, part: str) -> None:
    with pytest.raises(FirmwareError, match=r"qemu-system-\w+ ended with 1: the program faulted"):
        cores[part].run(stand_in(FAULTING), "hand", layout, np.zeros((1, 5), np.uint8), limit_s=60)

"""The C core: every score, grasp type, margin and probability is Python's, on this machine and on every part."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import GROUPS, Layout
from thenar.compiler.firmware.probes import Lost, Predictions, Probes, joined, lost_inputs, random_frames
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.targets.host import MEMBER as HOST
from thenar.compiler.firmware.tools import STRICT, call, workshop
from thenar.compiler.firmware.words import numbered
from thenar.runtime.model.integers import COARSE, IntegerTables
from thenar.runtime.model.quantise import in_bytes
from thenar.runtime.model.terms.grid import Grid
from thenar.runtime.model.terms.line import Line

from ...conftest import tool
from .conftest import make_tables, probed, same_as_python

# Sizes of tables, and how their terms differ from a bit for each switch and bins for each joint.
SHAPES: dict[str, dict[str, Any]] = {
    "all terms": {"classes": 14, "switches": 33, "joints": 16, "bins": 7, "reach": 200, "lines": 4, "pairs": 0},
    "bits and bins": {"classes": 14, "switches": 33, "joints": 16, "bins": 20, "reach": 300},
    "lines alone": {"classes": 14, "switches": 0, "joints": 3, "lines": 3},
    "lines of wide codes": {"classes": 9, "switches": 5, "joints": 4, "lines": 2, "highest": 60_000},
    "coarse rows": {"classes": 6, "switches": 6, "joints": 4, "lines": 3, "reach": 1, "unit": COARSE},
    "bits and lines": {"classes": 14, "switches": 33, "joints": 16, "lines": 16, "constant": (0,), "highest": 3000},
    "coarse bits and lines": {
        "classes": 14,
        "switches": 9,
        "joints": 6,
        "lines": 6,
        "constant": (0,),
        "reach": 1,
        "unit": COARSE,
    },
    "lines alone, in three passes": {"classes": 30, "switches": 0, "joints": 5, "lines": 5, "constant": (0,)},
    "two types of bits alone": {"classes": 2, "switches": 20, "joints": 0},
    "grids": {"classes": 17, "switches": 7, "joints": 5, "pairs": 2},
    "grids of wide codes": {"classes": 4, "switches": 5, "joints": 5, "pairs": 2, "highest": 65535},
    "grids alone": {"classes": 3, "switches": 0, "joints": 4, "pairs": 2},
    "a constant joint": {"joints": 2, "constant": (1,)},
    "one switch": {"switches": 1, "joints": 0},
    "one joint, two classes": {"switches": 0, "joints": 1, "classes": 2, "bins": 2},
    "8 classes": {"classes": 8, "switches": 16, "joints": 1},
    "9 classes": {"classes": 9, "switches": 17, "joints": 2},
    "more than 256 classes": {"classes": 260, "reach": 3},
    "many switches": {"switches": 300, "joints": 0, "reach": 5},
    "254 thresholds": {"joints": 1, "bins": 255},
    "codes to the highest": {"highest": 65535, "reach": 1000},
}
EACH = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
# Every shape with every size of groups; the quick half takes the sizes in turn.
PAIRED = [
    pytest.param(shape, group, id=f"{name}-{group}", marks=[pytest.mark.slow] * (group != GROUPS[place % len(GROUPS)]))
    for place, (name, shape) in enumerate(SHAPES.items())
    for group in GROUPS
]


def made(
    seed: int = 0,
    *,
    lines: int = 0,
    pairs: int = 0,
    constant: tuple[int, ...] = (),
    unit: int = 1,
    **sizes: Any,
) -> IntegerTables:
    """Return random tables, the last `lines` joints with lines, and the first 2 `pairs` in pairs."""
    tables, random = make_tables(seed, **sizes), np.random.default_rng(seed)
    classes, joints, top = tables.n_classes, tables.n_joints, sizes.get("highest", 254)
    last = np.arange(classes) < classes - (unit > 1)  # coarse rows are relative to the last class

    def rows(given: np.ndarray) -> np.ndarray:
        return (given * unit * last).astype(np.int16)

    thresholds = [
        each[: 0 if joint in constant or joint >= joints - lines + 1 else None]
        for joint, each in enumerate(tables.thresholds)
    ]
    shaped = tables.changed(
        bias=rows(tables.bias),
        switch_rows=rows(tables.switch_rows),
        switch_means=rows(tables.switch_means),
        joint_means=rows(tables.joint_means),
        thresholds=tuple(thresholds),
        joint_rows=tuple(rows(each[: len(t) + 1]) for each, t in zip(tables.joint_rows, thresholds, strict=True)),
        further=[
            *(_line(random, joint, last, top, lines) for joint in range(joints - lines, joints)),
            *(_pair(random, (2 * n, 2 * n + 1), classes, top) for n in range(pairs)),
        ],
        grid=unit,
    )
    return in_bytes(shaped)


def _line(random: np.random.Generator, joint: int, last: np.ndarray, top: int, share: int) -> Line:
    span = int(random.choice([1, 5, 100, min(top, 254), min(top, 3000)]))
    low = int(random.choice([0, top - span]))
    gain = next(gain for gain in range(7, -17, -1) if (span << gain if gain > 0 else span >> -gain) <= 254)
    return Line(joint, low, low + span, (random.integers(-128, 128, len(last)) // share * last).astype(np.int8), gain)


def _pair(random: np.random.Generator, joints: tuple[int, int], classes: int, top: int) -> Grid:
    one, other = (
        np.sort(random.choice(top, count, replace=False)).astype(np.uint16) for count in (7 * joints[0] % 9, 4)
    )
    rows = random.integers(-20, 21, (len(one) + 1, len(other) + 1, classes)).astype(np.int16)
    return Grid(joints, (one, other), rows)


def with_missing(tables: IntegerTables, *whole: Probes) -> tuple[Probes, Lost]:
    """Return whole frames, then others with inputs missing, alone and several, and some of these whole again."""
    several = random_frames(tables, 60, seed=2)
    frames = joined(*whole, several, Probes(several.bits[:20], several.codes[:20]))
    lost = np.zeros((len(frames), tables.n_switches + tables.n_joints), bool)
    lost[-80:-20] = lost_inputs(tables, 60, seed=1)
    return frames, lost


def is_exact(tables: IntegerTables, runs: Any, frames: Probes, group: int, apart: bool = False) -> None:
    """Compare all results on a target with Python's, those with missing inputs among them.

    apart  whole frames have a program of their own: on an AVR they go straight into the classifier's memory
    """
    layout = Layout(tables, group)
    files = Library("hand", numbered(tables), layout).files
    for some, lost in [(frames, None), with_missing(tables)] if apart else [with_missing(tables, frames)]:
        sent = layout.frame_bytes(some.bits, some.codes)
        same_as_python(runs.run(files, "hand", layout, sent, lost=lost), tables, some, lost)


@EACH
def test_results_on_this_machine_are_pythons_without_warnings(shape: dict[str, Any]) -> None:
    tool("gcc")
    tables = made(**shape)
    is_exact(tables, HOST, probed(tables, 500), GROUPS[0])


@pytest.mark.slow
@EACH
def test_so_they_are_by_clang_and_with_groups_of_any_size(shape: dict[str, Any]) -> None:
    name, tables = Path(tool("clang")).name, made(1, **shape)
    group = GROUPS[[*SHAPES.values()].index(shape) % len(GROUPS)]  # on an AVR, every size with every shape
    is_exact(tables, dataclasses.replace(HOST, compiler=((name,), "clang")), probed(tables, 500), group)


@pytest.mark.parametrize(("shape", "group"), PAIRED)
def test_on_an_avr_results_are_python_s(avr: None, shape: dict[str, Any], group: int) -> None:
    tables = made(2, **shape)
    part = TARGETS["avr2560" if tables.n_classes > 20 or tables.n_switches > 100 else "avr328p"]
    is_exact(tables, part, probed(tables, 20), group, apart=True)


@pytest.mark.slow
@pytest.mark.parametrize("part", ["cortex-m0plus", "cortex-m4", "rv32imac"])
@EACH
def test_on_cores_of_32_bits_results_are_python_s(cores: Any, shape: dict[str, Any], part: str) -> None:
    tables = made(3, **shape)
    is_exact(tables, cores[part], probed(tables, 100), GROUPS[0])


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.integers(0, 1000), st.integers(2, 40), st.integers(0, 40), st.integers(0, 6), st.integers(0, 3), st.booleans()
)
def test_any_tables_give_python_s_results(
    seed: int, classes: int, switches: int, joints: int, more: int, paired: bool
) -> None:
    tool("gcc")
    joints = max(joints, int(switches == 0))
    terms: dict[str, Any] = {"pairs": min(more, joints // 2)} if paired else {"lines": min(more, joints)}
    tables = made(seed, classes=classes, switches=switches, joints=joints, **terms)
    is_exact(tables, HOST, random_frames(tables, 60, seed), GROUPS[seed % len(GROUPS)])


def test_tables_at_the_16_bit_limit_borrow_and_carry_correctly() -> None:
    # Neighbouring classes at opposite ends: whatever leaks from one half of a word into the other shows.
    tool("gcc")
    row = np.array([16383, -16383, -16383, 16383, 16383], np.int16)
    rows = np.stack([row, -row, row, -row])
    zero = np.zeros((0, 5), np.int16)
    tables = IntegerTables.of(np.full(5, -1, np.int16), rows, (), (), 0 * rows, zero, 1.0)
    bits = np.array([[b >> i & 1 for i in range(4)] for b in range(16)], bool)
    for group in GROUPS:
        is_exact(tables, HOST, Probes(bits, np.zeros((16, 0), np.uint16)), group)


def test_every_code_finds_its_row(avr: None) -> None:
    tables = make_tables(seed=3, switches=2, joints=2, bins=12, highest=1000)
    every = np.arange(1024, dtype=np.uint16)
    frames = Probes(np.zeros((1024, 2), bool), np.stack([every, every[::-1]], axis=1))
    for target in (HOST, TARGETS["avr328p"]):
        is_exact(tables, target, frames, GROUPS[0], apart=target is not HOST)


# A hand beside another, in memory whose neighbours are watched; unknown inputs; names of every length of buffer.
PROGRAM = r"""
#include <stdio.h>
#include "thenar_hand.h"

static uint16_t memory[2][THENAR_HAND_MEMORY + 2];
static thenar hands[2];

int main(void)
{
    for (unsigned hand = 0; hand < 2; hand++) {
        memory[hand][0] = memory[hand][THENAR_HAND_MEMORY + 1] = 0xABCD;
        thenar_init(&hands[hand], &thenar_hand_model, memory[hand] + 1);
    }
    for (uint16_t number = 0; number < 40; number++) {
        thenar_set_switch(&hands[0], number, true);
        thenar_set_code(&hands[0], number, 255);
        thenar_lose_switch(&hands[0], number, number % 2 == 0);
        thenar_lose_joint(&hands[0], number, number == 1 || number > 20);
    }
    (void)thenar_classify(&hands[0]);
    const uint16_t untouched = thenar_classify(&hands[1]);
    thenar_init(&hands[0], &thenar_hand_model, memory[0] + 1);
    printf("%d\n", thenar_classify(&hands[0]) == untouched);
    for (unsigned hand = 0; hand < 2; hand++) {
        printf("%d\n", memory[hand][0] == 0xABCD && memory[hand][THENAR_HAND_MEMORY + 1] == 0xABCD);
    }
    for (uint16_t grasp = 0; grasp < 6; grasp++) {
        char text[THENAR_HAND_NAME_BYTES];
        const unsigned length = thenar_name(&thenar_hand_model, grasp, text, sizeof text);
        printf("%u %s\n", length, text);
    }
    for (uint16_t size = 1; size < 4; size++) {
        char text[] = "....";
        const unsigned length = thenar_name(&thenar_hand_model, 1, text, size);
        printf("%u %s%s\n", length, text, text + size);
    }
    /* Found again, an input that was set in the meantime begins anew. */
    const int16_t before = hands[1].scores[0];
    thenar_lose_switch(&hands[1], 5, true);
    thenar_lose_joint(&hands[1], 1, true);
    (void)thenar_classify(&hands[1]);
    printf("%d\n", hands[1].scores[0] != before);
    thenar_set_switch(&hands[1], 5, true);
    thenar_set_code(&hands[1], 1, 255);
    thenar_lose_switch(&hands[1], 5, false);
    thenar_lose_joint(&hands[1], 1, false);
    (void)thenar_classify(&hands[1]);
    printf("%d\n", hands[1].scores[0] == before);
    return thenar_name(&thenar_hand_model, 1, NULL, 0) != 3;
}
"""


def test_hands_share_nothing_and_unknown_numbers_do_nothing() -> None:
    tables = make_tables(1, switches=33, joints=3)
    names = replace(numbered(tables), grasps=('say "Ü"\\n??/', "abc", "", "12", "three"))
    sanitized = ("-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    with workshop(Library("hand", names, Layout(tables)).files | {"main.c": PROGRAM}) as folder:
        sources = sorted(path.name for path in folder.glob("*.c"))
        call([tool("gcc"), *STRICT, *sanitized, *sources, "-o", "program"], folder)
        said = call([str(folder / "program")], folder).decode().splitlines()
    assert said[:3] == ["1", "1", "1"]
    assert said[3:9] == ['13 say "Ü"\\n??/', "3 abc", "0 ", "2 12", "5 three", "0 "]
    assert said[9:] == ["3 ...", "3 a..", "3 ab.", "1", "1"]


def test_the_core_is_the_same_for_every_build() -> None:
    texts = [Library("hand", numbered(t), Layout(t)).files for t in (make_tables(1), make_tables(2, classes=9))]
    assert [texts[0][name] == texts[1][name] for name in texts[0]] == [True, True, True, False, False]
    for name, text in texts[0].items():
        assert text.isascii()
        assert all(len(line) <= 120 and line == line.rstrip() for line in text.split("\n")), name
        assert "\n\n\n" not in text
    assert len(texts[0]["thenar.h"].splitlines()) <= 180
    assert len(texts[0]["thenar.c"].splitlines()) <= 350


def test_tables_beyond_16_bits_are_refused() -> None:
    with pytest.raises(FirmwareError, match=r"the tables have \d+ pairs of entries, but firmware has at most 65535"):
        Layout(make_tables(classes=400, switches=100, joints=0, reach=5))
    with pytest.raises(FirmwareError, match="no switch and no joint"):
        Layout(make_tables(switches=0, joints=0))


def test_means_that_bytes_do_not_hold_are_refused() -> None:
    tables = make_tables(switches=3, joints=0)
    finer = tables.changed(switch_means=np.full((3, 5), 1001, np.int16), switch_rows=np.full((3, 5), 2000, np.int16))
    with pytest.raises(FirmwareError, match="finer than firmware stores: compile the build again"):
        _ = Library("hand", numbered(finer), Layout(finer)).files


def test_the_same_frame_costs_the_same_whatever_the_results_were(avr: None) -> None:
    tables = make_tables(switches=9, joints=2)
    layout, frames = Layout(tables), Probes(np.ones((3, 9), bool), np.full((3, 2), 7, np.uint16))
    sent = layout.frame_bytes(frames.bits, frames.codes)
    found: Predictions = TARGETS["avr328p"].run(Library("hand", numbered(tables), layout).files, "hand", layout, sent)
    assert found.cost is not None
    assert len(set(found.cost.tolist())) == 1

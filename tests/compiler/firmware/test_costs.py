import re
import subprocess
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from thenar.compiler.firmware.assembly import glove_size
from thenar.compiler.firmware.avr_costs import Assembly, AvrCosts, rises, worst_frame
from thenar.compiler.firmware.classifier import classifier_files
from thenar.compiler.firmware.layout import Adding, Bins, Layout, arrange
from thenar.compiler.firmware.probes import changing_frames
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.words import numbered
from thenar.runtime.manifest import Manifest
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]
Tool = Callable[[str], str]

AVRS = ("avr328p", "avr2560")
# Classes, switches, joints and highest threshold: one pass and several, no joint, no switch, codes of 16 bits alone and
# where sums take all registers, more look-ups than rcall reaches across, members of the input,
# and of what is found, beyond the reach of ldd.
SHAPES = [
    (14, 13, 3, 200),
    (5, 9, 2, 254),
    (6, 9, 0, 9),
    (2, 0, 2, 90),
    (16, 6, 2, 200),
    (17, 6, 2, 200),
    (3, 330, 20, 254),
    (4, 12, 2, 900),
    (14, 12, 2, 900),
    (14, 60, 16, 900),
]
WAYS: list[tuple[Bins, Adding, int]] = [
    ("direct", "called", 16),
    ("direct", "unrolled", 8),
    ("trimmed", "unrolled", 16),
    ("trimmed", "called", 8),
    ("search", "called", 16),
    ("search", "unrolled", 8),
]


SECTIONS = ("-ffunction-sections", "-fdata-sections")
# Sections of update() and of what replaces missing inputs, and their bytes.
UNCALLED = (
    r"^\.(?:text\.thenar_hand_(?:update|lose_switch|lose_joint|leave_out|start_without)"
    r"|text\.(?:replace_by_mean|shift_start|replace_all|replace|leave_out|begin|move)"
    r"|(?:progmem\.data|rodata)\.thenar_hand_means) +(\d+)"
)
# What margin() and probability() take, which no answer needs.
UNCOUNTED = r"^\.(?:text\.thenar_hand_(?:margin|probability)|(?:progmem\.data|rodata)\.thenar_hand_powers) +(\d+)"
Size = Callable[[dict[str, str], list[str]], tuple[int, int, int]]


@pytest.fixture
def size(tool: Tool, tmp_path: Path) -> Size:
    """Return what compiles files and gives the bytes of flash, of what classify() does not need, and of variables."""

    def compiled(files: dict[str, str], command: list[str]) -> tuple[int, int, int]:
        for name, content in files.items():
            (tmp_path / name).write_text(content)
        sources = [name for name in files if name.endswith((".c", ".S"))]
        compiling = [tool(command[0]), *command[1:], "-std=c99", "-fno-common", *SECTIONS, "-c", *sources]
        subprocess.run(compiling, cwd=tmp_path, check=True)
        objects = [name.rsplit(".", 1)[0] + ".o" for name in sources]
        teller = [tool(command[0].replace("gcc", "size")), *objects]
        told = subprocess.run(teller, cwd=tmp_path, check=True, capture_output=True, text=True).stdout
        text, data, bss = (sum(int(line.split()[n]) for line in told.splitlines()[1:]) for n in range(3))
        teller.insert(1, "-A")
        told = subprocess.run(teller, cwd=tmp_path, check=True, capture_output=True, text=True).stdout
        updating, more = (sum(map(int, re.findall(each, told, re.MULTILINE))) for each in (UNCALLED, UNCOUNTED))
        return text + data - more, updating, data + bss

    return compiled


def _laid_out(
    make_tables: MakeTables, shape: tuple[int, int, int, int], bins: Bins, adding: Adding, entry_bits: int
) -> Layout:
    classes, switches, joints, highest = shape
    above = max(highest - 200, 0) if highest > 254 else 0
    tables = make_tables(3, classes=classes, switches=switches, joints=joints, highest=highest - above, reach=12)
    tables = replace(tables, thresholds=tuple(steps + np.uint16(above) for steps in tables.thresholds))
    wide = above and joints
    return arrange(tables, bins="trimmed" if wide and bins == "direct" else bins, adding=adding, entry_bits=entry_bits)


def _frames(layout: Layout, n: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(5)
    tables = layout.tables
    return random.random((n, tables.n_switches)) < 0.5, random.integers(
        0, 256 if layout.code_bits == 8 else 1200, (n, tables.n_joints)
    ).astype(np.uint16)


def _all_changing(layout: Layout, bits: np.ndarray, codes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    changing = changing_frames(layout.tables)
    return np.vstack([bits, changing.bits]), np.vstack([codes, changing.codes])


def _named(shape: tuple[int, int, int, int], way: tuple[Bins, Adding, int]) -> str:
    return "-".join(map(str, (*shape, *way)))


# Every shape in three ways, among which are all bins, both widths and both ways to add; in the slow tests in all six.
HALVES = ((0, 2, 5), (1, 3, 4))
COVERING = [
    pytest.param(shape, *WAYS[n], id=_named(shape, WAYS[n]))
    for number, shape in enumerate(SHAPES)
    for n in HALVES[number % 2]
]
EVERY = [pytest.param(shape, *way, id=_named(shape, way)) for shape, way in product(SHAPES, WAYS)]


@pytest.mark.parametrize(
    ("part", "shape", "bins", "adding", "entry_bits"),
    [
        *(pytest.param(AVRS[0], *each.values, id=f"{AVRS[0]}-{each.id}") for each in COVERING),
        *(pytest.param(AVRS[1], *each.values, id=f"{AVRS[1]}-{each.id}", marks=pytest.mark.slow) for each in EVERY),
    ],
)
def test_the_model_says_to_the_cycle_what_every_frame_takes_and_the_bound_is_near(
    tool: Tool,
    size: Size,
    make_tables: MakeTables,
    describe: Describe,
    part: str,
    shape: tuple[int, int, int, int],
    bins: Bins,
    adding: Adding,
    entry_bits: int,
) -> None:
    tool("avr-gcc")
    layout, target = _laid_out(make_tables, shape, bins, adding, entry_bits), TARGETS[part]
    costs = AvrCosts(layout, target.flash)
    bits, codes = _frames(layout, 60)
    worst = worst_frame(layout)
    bits, codes = np.vstack([bits, worst[0]]), np.vstack([codes, worst[1]])
    files = classifier_files("hand", describe(layout.tables), layout, avr=True)
    answers = target.run(files, "hand", layout, layout.frame_bytes(bits, codes))
    assert answers.cost is not None
    assert answers.stack is not None
    expected = costs.fixed_cycles + rises(layout, bits, codes)
    assert np.array_equal(answers.cost, expected)
    cost = target.cost(layout)
    assert answers.cost.max() == answers.cost[-1]
    assert answers.cost.max() <= cost.cycles <= 1.02 * answers.cost.max() + shape[0]
    changing = layout.frame_bytes(*_all_changing(layout, bits, codes))
    changed = target.run(files, "hand", layout, changing, incremental=True)
    assert changed.stack is not None
    assert changed.cost is not None
    # Few frames have every class better than the one before.
    assert changed.cost.max() <= cost.update_cycles <= 1.02 * changed.cost.max() + shape[0]
    _, _, variables = size(files, ["avr-gcc", *TARGETS[part].flags])
    assert 0 <= cost.ram - glove_size(layout) - variables - max(answers.stack, changed.stack) <= 4


@pytest.mark.parametrize(("shape", "bins", "adding", "entry_bits"), COVERING)
def test_an_avr_s_flash_is_what_the_model_allows_for_or_a_little_less(
    size: Size,
    make_tables: MakeTables,
    describe: Describe,
    shape: tuple[int, int, int, int],
    bins: Bins,
    adding: Adding,
    entry_bits: int,
) -> None:
    layout = _laid_out(make_tables, shape, bins, adding, entry_bits)
    files = classifier_files("hand", describe(layout.tables), layout, avr=True)
    for part in AVRS:
        flash, updating, _ = size(files, ["avr-gcc", *TARGETS[part].flags])
        cost = TARGETS[part].cost(layout)
        # Names have 15 bytes in the model, 7 or 8 here; code in C is rounded up, and pages of bins are aligned.
        allowed = 8 * (shape[0] + 1) + 500
        assert flash <= cost.flash <= flash + allowed
        assert flash - updating <= cost.flash_classify <= flash - updating + allowed
        assert updating > 0


def _stack(folder: Path) -> int:
    """Return the bytes of stack of update(), as the compiler says, with all that it may call."""
    lines = [line.split("\t") for path in sorted(folder.glob("*.su")) for line in path.read_text().splitlines()]
    frames = {place.rsplit(":", 1)[-1].split(".")[0]: int(size) for place, size, _ in lines}
    called = ("thenar_hand_update", "find", "leave_out", "replace_by_mean", "replace_all", "replace", "begin", "move")
    return sum(frames.get(name, 0) for name in called)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bins", "lowest"), [("direct", 0), ("trimmed", 0), ("trimmed", 40), ("trimmed", 600), ("search", 600)]
)
@pytest.mark.parametrize("entry_bits", [16, 8])
@pytest.mark.parametrize("part", ["cortex-m0plus", "cortex-m4"])
def test_a_cortex_takes_no_more_than_the_model_and_not_much_less(
    cores: Any,
    size: Size,
    make_tables: MakeTables,
    describe: Describe,
    tmp_path: Path,
    part: str,
    entry_bits: int,
    bins: Bins,
    lowest: int,
) -> None:
    tables = make_tables(1, classes=14, switches=33, joints=16, bins=25, reach=5, highest=200)
    tables = replace(tables, thresholds=tuple(steps + np.uint16(lowest) for steps in tables.thresholds))
    target = TARGETS[part]
    layout = arrange(tables, bins=bins, entry_bits=entry_bits)
    files, cost = classifier_files("hand", describe(tables), layout, avr=False), target.cost(layout)
    answers = cores[part].run(files, "hand", layout, layout.frame_bytes(*_frames(layout, 50)))
    assert answers.cost is not None
    assert answers.cost.max() <= cost.cycles <= 1.2 * answers.cost.max()
    changing = layout.frame_bytes(*_all_changing(layout, *_frames(layout, 50)))
    changed = cores[part].run(files, "hand", layout, changing, incremental=True)
    assert changed.cost is not None
    assert changed.cost.max() <= cost.update_cycles <= 1.3 * changed.cost.max()
    files["glove.c"] = '#include "thenar_hand.h"\nextern thenar_hand glove;\nthenar_hand glove;\n'
    flash, updating, variables = size(
        files, ["arm-none-eabi-gcc", f"-mcpu={part}", "-mthumb", "-O2", "-ffreestanding", "-fstack-usage"]
    )
    assert flash <= cost.flash <= 1.15 * flash
    assert flash - updating <= cost.flash_classify <= 1.1 * (flash - updating)
    assert updating > 0
    stack = _stack(tmp_path)
    assert variables + stack <= cost.ram <= variables + 1.5 * stack + 100


shapes = st.tuples(st.integers(2, 40), st.integers(0, 30), st.integers(0, 5), st.integers(9, 700)).filter(
    lambda shape: shape[1] + shape[2] > 0
)


@given(shape=shapes, bins=st.sampled_from(["trimmed", "search"]), entry_bits=st.sampled_from([8, 16]))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)
def test_no_frame_takes_longer_than_the_bound_and_more_look_ups_never_cost_less(
    make_tables: MakeTables, shape: tuple[int, int, int, int], bins: Bins, entry_bits: int
) -> None:
    layout = _laid_out(make_tables, shape, bins, "called", entry_bits)
    for part in AVRS:
        costs = AvrCosts(layout, TARGETS[part].flash)
        varying = rises(layout, *_frames(layout, 100))
        assert varying.min() >= 0
        assert costs.fixed_cycles + varying.max() <= costs.cost.cycles
    smaller = arrange(layout.tables, group_size=2, bins=bins, entry_bits=entry_bits)
    for target in TARGETS.values():
        assert target.cost(smaller).cycles >= target.cost(layout).cycles


def test_an_entry_takes_four_five_or_eight_cycles(make_tables: MakeTables) -> None:
    tables, coarse = (make_tables(1, classes=14, switches=20, joints=4, reach=reach) for reach in (12, 3))
    layouts = [arrange(tables), arrange(tables, entry_bits=8), arrange(coarse, entry_bits=8)]
    assert [(layout.entry_bits, layout.sum_bits) for layout in layouts] == [(16, 16), (8, 16), (8, 8)]
    # A look-up alone, less what is left without it.
    costs = [AvrCosts(layout, SMALL.flash) for layout in layouts]
    fewer = [AvrCosts(replace(layout, lookups=layout.lookups[1:]), SMALL.flash) for layout in layouts]
    called = 2 + 1 + 2 + 2 + 6 + 3 + 4  # its number taken, masked, kept and loaded, Z computed, call and return
    kept = 2 + 2  # which only sums that take all registers need
    cycles = [one.fixed_cycles - other.fixed_cycles for one, other in zip(costs, fewer, strict=True)]
    group = layouts[0].lookups[0]
    assert not group.joints
    assert cycles == [called + 14 * 8, called + 1 + 14 * 5, called - kept + 14 * 4]


@pytest.mark.parametrize("elpm", [False, True])
@given(seed=st.integers(0, 99), shape=st.integers(0, len(SHAPES) - 1), way=st.sampled_from(WAYS), shared=st.booleans())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=25, deadline=None)
def test_costs_are_those_of_the_whole_assembly_counted_at_once(
    make_tables: MakeTables, seed: int, shape: int, way: tuple[Bins, Adding, int], shared: bool, elpm: bool
) -> None:
    bins, adding, entry_bits = way
    layout = _laid_out(make_tables, SHAPES[shape], bins, adding, entry_bits)
    if shared and layout.tables.n_joints > 1:
        wide = "trimmed" if layout.code_bits == 16 and bins == "direct" else bins
        layout = arrange(layout.tables, entry_bits=entry_bits, bins=wide, adding=adding, shared=((None, (1, 0)),))
    files = classifier_files("hand", numbered(layout.tables), layout, avr=True)
    whole = Assembly(files["thenar_hand_avr.S"], elpm=elpm)
    costs = AvrCosts(layout, (256 if elpm else 32) << 10)
    cost = costs.cost
    assert cost.cycles == whole.cycles("thenar_hand_classify")[1]
    assert cost.update_cycles == whole.cycles("thenar_hand_update")[1]
    # A class that is better than all before it takes a cycle.
    assert cost.cycles - costs.fixed_cycles == layout.tables.n_classes - 1
    # What is linked only into a program that calls update(), or says that an input is missing.
    uncalled = whole.size(".text.thenar_hand_update") + whole.size(".text.thenar_hand_start_without")
    assert cost.flash - cost.flash_classify == uncalled + costs.losing


SMALL = TARGETS["avr328p"]


def _cycles(layout: Layout, bits: np.ndarray, codes: np.ndarray) -> int:
    return int(rises(layout, bits[np.newaxis], codes[np.newaxis])[0])


def _longest(layout: Layout) -> int:
    """Return the most cycles of all frames there are, one code for each bin."""
    tables = layout.tables
    steps = [[0, *(int(step) + 1 for step in thresholds)] for thresholds in tables.thresholds]
    frames = list(product(*[[0, 1]] * tables.n_switches, *steps))
    bits = np.array([frame[: tables.n_switches] for frame in frames], bool).reshape(len(frames), -1)
    codes = np.array([frame[tables.n_switches :] for frame in frames], np.uint16).reshape(len(frames), -1)
    return int(rises(layout, bits, codes).max())


@given(
    seed=st.integers(0, 1000),
    classes=st.integers(2, 8),
    shape=st.sampled_from([(6, 0), (4, 2), (0, 3)]),
    bins=st.sampled_from(["direct", "trimmed", "search"]),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40, deadline=None)
def test_in_small_tables_no_frame_takes_longer(
    make_tables: MakeTables, seed: int, classes: int, shape: tuple[int, int], bins: Bins
) -> None:
    switches, joints = shape
    layout = arrange(make_tables(seed, classes=classes, switches=switches, joints=joints, bins=5), bins=bins)
    assert _cycles(layout, *worst_frame(layout)) == _longest(layout)


@pytest.mark.parametrize("bins", ["direct", "trimmed", "search"])
def test_in_large_tables_it_takes_longer_than_any_of_many_frames_and_nearly_as_long_as_the_bound(
    make_tables: MakeTables, bins: Bins
) -> None:
    layout = arrange(make_tables(1, classes=14, switches=33, joints=16, bins=25), bins=bins)
    costs, random = AvrCosts(layout, SMALL.flash), np.random.default_rng(7)
    worst = costs.fixed_cycles + _cycles(layout, *worst_frame(layout))
    bits = random.random((20000, 33)) < 0.5
    codes = random.integers(0, 256, (20000, 16)).astype(np.uint16)
    assert worst > costs.fixed_cycles + rises(layout, bits, codes).max()
    assert 0.99 * costs.cost.cycles < worst <= costs.cost.cycles


def test_scores_that_rise_from_class_to_class_are_the_worst_there_are() -> None:
    rows = np.array([[0, 4, -4, 9], [9, 0, 9, 0]], np.int16)
    tables = IntegerTables(
        np.array([0, 1, 7, 3], np.int16), rows, (), (), np.zeros((2, 4), np.int16), np.zeros((0, 4), np.int16), 1.0
    )
    layout = arrange(tables)
    bits, codes = worst_frame(layout)
    # 0 1 7 3; 0 5 3 12; 9 1 16 3; 9 5 12 12: better twice in the first two, once in the others.
    assert _cycles(layout, bits, codes) == 2
    assert not bits[1]
    assert codes.shape == (0,)


def test_the_same_layout_has_the_same_worst_frame(make_tables: MakeTables) -> None:
    layout = arrange(make_tables(2, classes=9, switches=20, joints=4))
    one, other = worst_frame(layout), worst_frame(layout)
    assert np.array_equal(one[0], other[0])
    assert np.array_equal(one[1], other[1])

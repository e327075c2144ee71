"""Firmware of tables with slopes: exact to the bit on every target."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.firmware.assembly import products
from thenar.compiler.firmware.choose import features
from thenar.compiler.firmware.classifier import classifier_files
from thenar.compiler.firmware.layout import arrange
from thenar.compiler.firmware.probes import Probes, changing_frames, extreme_frames, joined, random_frames
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.words import numbered
from thenar.compiler.tables.quantise import integer_scores
from thenar.runtime.tables import COARSE, IntegerTables, Slope

Tool = Callable[[str], str]

# Classes, switches, joints, of which the first so many have bins and the last so many slopes; whether codes are wide,
# and rows multiples of 256, and scores relative to the last class.
Shape = tuple[int, int, int, int, int, bool, bool]
SHAPES: dict[str, Shape] = {
    "slopes alone": (14, 0, 3, 0, 3, False, False),
    "one slope": (2, 0, 1, 0, 1, False, False),
    "switches": (5, 7, 2, 0, 2, False, False),
    "switches, upper halves": (14, 13, 4, 0, 4, False, True),
    "bins and slopes": (7, 6, 4, 2, 3, False, False),
    "bins and slopes, upper halves": (6, 6, 4, 3, 3, False, True),
    "wide codes": (4, 5, 3, 2, 2, True, False),
    "wide codes, upper halves": (3, 5, 3, 2, 2, True, True),
    "parts": (17, 5, 3, 1, 3, False, False),
    "parts, upper halves": (31, 5, 3, 2, 2, True, True),
    "slopes alone in parts": (16, 0, 2, 0, 2, True, False),
}
EACH = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)


def _tables(seed: int, shape: Shape, most: int = 20) -> IntegerTables:
    """Return random tables: rows of bins are at most `most`, or multiples of 256."""
    classes, switches, joints, binned, slopes, wide, coarse = shape
    random = np.random.default_rng(seed)
    top, unit, most = (60_000 if wide else 255), (COARSE if coarse else 1), (2 if coarse else most)

    def rows(*size: int) -> np.ndarray:
        return (unit * random.integers(-most, most + 1, size)).astype(np.int16)

    def thresholds(joint: int) -> np.ndarray:
        first = int(random.integers(1, top - 200)) if wide else 0
        return np.sort(random.choice(200, 4 if joint < binned else 0, replace=False) + first).astype(np.uint16)

    steps = tuple(thresholds(joint) for joint in range(joints))
    made = IntegerTables(
        bias=random.integers(-99, 100, classes).astype(np.int16),
        switch_rows=rows(switches, classes),
        thresholds=steps,
        joint_rows=tuple(rows(len(each) + 1, classes) for each in steps),
        switch_means=rows(switches, classes),
        joint_means=rows(joints, classes),
        scale=100.0,
        slopes=tuple(_slope(random, joint, classes, top, slopes) for joint in range(joints - slopes, joints)),
    )
    return _relative(made) if coarse else made


def _relative(tables: IntegerTables) -> IntegerTables:
    """Return the tables with nothing for the last class, to which the scores of the others are relative."""

    def without(rows: np.ndarray) -> np.ndarray:
        return np.where(np.arange(tables.n_classes) == tables.n_classes - 1, 0, rows).astype(rows.dtype)

    held: dict[str, Any] = {
        name: without(getattr(tables, name)) for name in ("bias", "switch_rows", "switch_means", "joint_means")
    }
    slopes = tuple(replace(slope, row=without(slope.row)) for slope in tables.slopes)
    return replace(tables, **held, joint_rows=tuple(map(without, tables.joint_rows)), slopes=slopes, grid=COARSE)


def _slope(random: np.random.Generator, joint: int, classes: int, top: int, share: int) -> Slope:
    span = int(random.choice(np.array([1, 5, 100, 254, 255, min(top, 3000)])))
    low = int(random.choice(np.array([0, int(random.integers(0, top - span + 1)), top - span])))
    gain = next(gain for gain in range(0, -17, -1) if span >> -gain <= 254)
    while 0 <= gain < 3 and span << gain + 1 <= 254:
        gain += 1
    row = random.integers(-128, 128, classes) // share
    row[random.random(classes) < 0.2] = 0
    return Slope(joint, low, low + span, gain, row.astype(np.int8))


def _frames(tables: IntegerTables, n: int) -> Probes:
    return joined(extreme_frames(tables), random_frames(tables, n, 1), changing_frames(tables))


def _is_exact(tables: IntegerTables, runs: Any) -> None:
    """Hold classify() and update() of a target against Python."""
    layout = arrange(tables)
    target, frames = getattr(runs, "target", runs), _frames(tables, 40)
    expected = integer_scores(tables, frames.bits, frames.codes)
    assert np.array_equal(layout.scores(frames.bits, frames.codes), expected)
    files = classifier_files("hand", numbered(tables), layout, avr=target.avr)
    sent = layout.frame_bytes(frames.bits, frames.codes)
    for incremental in (False, True):
        answers = runs.run(files, "hand", layout, sent, incremental=incremental)
        assert np.array_equal(answers.scores, expected)
        assert np.array_equal(answers.classes, expected.argmax(axis=1))


# Rows whose entries fit in bytes, and rows that need words.
WIDTHS = pytest.mark.parametrize("most", [20, 300], ids=["bytes", "words"])


@EACH
def test_in_portable_c_scores_are_python_s(tool: Tool, shape: Shape) -> None:
    tool("cc")
    _is_exact(_tables(3, shape), TARGETS["host"])
    _is_exact(_tables(3, shape, 300), TARGETS["host"])


@WIDTHS
@EACH
def test_on_an_avr_scores_are_python_s(tool: Tool, shape: Shape, most: int) -> None:
    tool("avr-gcc")
    _is_exact(_tables(0, shape, most), TARGETS["avr328p"])


@pytest.mark.slow
@WIDTHS
@EACH
def test_so_they_are_of_more_tables_and_on_larger_parts(tool: Tool, cores: Any, shape: Shape, most: int) -> None:
    tool("avr-gcc")
    for seed in range(10, 13):
        tables = _tables(seed, shape, most)
        for part in (TARGETS["avr2560"], cores["cortex-m0plus"], cores["cortex-m4"]):
            _is_exact(tables, part)


@given(st.lists(st.integers(-128, 127), min_size=1, max_size=14))
def test_equal_entries_share_a_product(row: list[int]) -> None:
    added = [0] * len(row)
    for entry, classes in products(row):
        for k, alike in classes:
            added[k] += entry if alike else -entry
    assert added == row
    assert len(products(row)) == len({abs(entry) for entry in row} - {0})


def test_a_layout_says_that_entries_are_upper_halves() -> None:
    layout = arrange(_tables(1, SHAPES["switches, upper halves"]))
    assert features(layout) == "8-bit entries, the upper halves of steps"

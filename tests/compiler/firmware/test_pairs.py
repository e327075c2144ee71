"""Firmware of tables with pairs of joints: look-ups of both, exact to the bit, and counted to the cycle on an AVR."""

from collections.abc import Callable

import numpy as np
import pytest

from thenar.compiler.firmware.classifier import classifier_files
from thenar.compiler.firmware.layout import arrange
from thenar.compiler.firmware.probes import changing_frames, extreme_frames, joined, lost_inputs, random_frames
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.words import numbered
from thenar.compiler.tables.quantise import integer_scores
from thenar.runtime.scores import LANE_OFFSET, Scorer
from thenar.runtime.tables import IntegerTables, Pair

Tool = Callable[[str], str]
# Classes, switches, whether codes are wide.
SHAPES = {"bytes": (5, 7, False), "wide codes": (4, 5, True), "parts": (17, 3, False), "joints alone": (3, 0, False)}
EACH = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
JOINTS = 5


def _tables(seed: int, shape: tuple[int, int, bool], most: int = 20) -> IntegerTables:
    """Of five joints, pairs of four: one joint has no bins of its own, and one pair but one bin of a joint."""
    classes, switches, wide = shape
    random = np.random.default_rng(seed)
    first = 300 if wide else 0

    def rows(*size: int) -> np.ndarray:
        return random.integers(-most, most + 1, size).astype(np.int16)

    def thresholds(count: int) -> np.ndarray:
        return np.sort(random.choice(200, count, replace=False) + first).astype(np.uint16)

    steps = tuple(thresholds(count) for count in (3, 8, 0, 2, 4))
    pairs = []
    for joints, counts in (((0, 3), (7, 4)), ((1, 2), (0, 9))):
        one, other = (thresholds(count) for count in counts)
        pairs.append(Pair(joints, (one, other), rows(len(one) + 1, len(other) + 1, classes)))
    own = tuple(rows(len(each) + 1, classes) for each in steps)
    means = rows(switches, classes), rows(JOINTS, classes)
    return IntegerTables(rows(classes), rows(switches, classes), steps, own, *means, 100.0, (), tuple(pairs))


def _is_exact(tables: IntegerTables, name: str) -> None:
    layout = arrange(tables)
    frames = joined(extreme_frames(tables), random_frames(tables, 60, 1), changing_frames(tables))
    target, expected = TARGETS[name], integer_scores(tables, frames.bits, frames.codes)
    assert np.array_equal(layout.scores(frames.bits, frames.codes), expected)
    lost = lost_inputs(tables, len(frames), 1)
    files = classifier_files("hand", numbered(tables), layout, avr=target.avr)
    held, scorer = layout.frame_bytes(frames.bits, frames.codes), Scorer(tables)
    whole_and_lost = np.vstack([np.zeros_like(lost), lost])
    s, rows = tables.n_switches, zip(frames.bits, frames.codes, lost, strict=True)
    without = [scorer.lanes_without(b, c, m[:s], m[s:]) for b, c, m in rows]
    for incremental in (False, True):
        twice = target.run(files, "hand", layout, np.vstack([held, held]), incremental=incremental, lost=whole_and_lost)
        assert np.array_equal(twice.scores, np.vstack([expected, np.array(without) - LANE_OFFSET]))


@EACH
@pytest.mark.parametrize("most", [20, 300], ids=["bytes", "words"])
@pytest.mark.parametrize("name", ["host", "avr328p"])
def test_scores_are_python_s(tool: Tool, shape: tuple[int, int, bool], most: int, name: str) -> None:
    tool("cc" if name == "host" else "avr-gcc")
    _is_exact(_tables(3, shape, most), name)

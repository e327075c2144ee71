from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from thenar.compiler.firmware.avr_costs import AvrCosts, worst_frame
from thenar.compiler.firmware.layout import Bins, Layout, arrange
from thenar.compiler.firmware.targets import TARGETS
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
SMALL = TARGETS["avr328p"]


def _cycles(layout: Layout, bits: np.ndarray, codes: np.ndarray) -> int:
    return int(AvrCosts(layout, SMALL.flash).varying_cycles(bits[np.newaxis], codes[np.newaxis])[0])


def _longest(layout: Layout) -> int:
    """Return the most cycles of all frames there are, one code for each bin."""
    tables = layout.tables
    steps = [[0, *(int(step) + 1 for step in thresholds)] for thresholds in tables.thresholds]
    frames = list(product(*[[0, 1]] * tables.n_switches, *steps))
    bits = np.array([frame[: tables.n_switches] for frame in frames], bool).reshape(len(frames), -1)
    codes = np.array([frame[tables.n_switches :] for frame in frames], np.uint16).reshape(len(frames), -1)
    return int(AvrCosts(layout, SMALL.flash).varying_cycles(bits, codes).max())


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
    assert worst > costs.fixed_cycles + costs.varying_cycles(bits, codes).max()
    assert 0.99 * costs.most_cycles < worst <= costs.most_cycles


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

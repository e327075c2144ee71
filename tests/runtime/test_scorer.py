from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from thenar.runtime.errors import FrameError
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.scores import LANE_OFFSET, Scorer

from .conftest import make_tables

Drawn = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def summed(
    tables: IntegerTables,
    bits: Iterable[bool],
    codes: Iterable[int],
    lost_bits: Iterable[bool],
    lost_codes: Iterable[bool],
) -> np.ndarray:
    """The definition, term by term."""
    total = tables.bias.astype(np.int64)
    for bit, lost, row, mean in zip(bits, lost_bits, tables.switch_rows, tables.switch_means, strict=True):
        total = total + (mean if lost else row * int(bit))
    for a, (code, lost) in enumerate(zip(codes, lost_codes, strict=True)):
        bin_ = sum(int(threshold) < int(code) for threshold in tables.thresholds[a])
        total = total + (tables.joint_means[a] if lost else tables.joint_rows[a][bin_])
    return total


@st.composite
def frames(draw: st.DrawFn, switches: int, joints: int) -> Drawn:
    def flags(n: int) -> np.ndarray:
        return np.array(draw(st.lists(st.booleans(), min_size=n, max_size=n)), bool)

    codes = draw(st.lists(st.integers(0, 300) | st.just(65535), min_size=joints, max_size=joints))
    return flags(switches), np.array(codes, np.uint16), flags(switches), flags(joints)


@given(data=st.data(), seed=st.integers(0, 50), switches=st.integers(0, 12), joints=st.integers(0, 4))
def test_scores_are_the_sum_of_the_rows(data: st.DataObject, seed: int, switches: int, joints: int) -> None:
    tables = make_tables(seed, switches=switches, joints=joints)
    bits, codes, lost_bits, lost_codes = data.draw(frames(switches, joints))
    scorer, none = Scorer(tables), [False] * (switches + joints)
    whole = np.array(scorer.biased_scores(bits, codes)) - LANE_OFFSET
    assert np.array_equal(whole, summed(tables, bits, codes, none[:switches], none[:joints]))
    degraded = np.array(scorer.biased_scores(bits, codes, lost_bits, lost_codes)) - LANE_OFFSET
    assert np.array_equal(degraded, summed(tables, bits, codes, lost_bits, lost_codes))


def test_a_code_equal_to_a_threshold_goes_left_of_it() -> None:
    tables = make_tables(switches=0, joints=1)
    threshold = int(tables.thresholds[0][2])
    scorer = Scorer(tables)
    for code, bin_ in ((threshold, 2), (threshold + 1, 3)):
        expected = tables.bias.astype(int) + tables.joint_rows[0][bin_] + LANE_OFFSET
        assert scorer.biased_scores([], [code]) == tuple(expected)
        assert scorer.biased_scores([], [code], [], [False]) == tuple(expected)


@pytest.mark.parametrize("sign", [+1, -1])
def test_lanes_at_the_edge_of_int16_do_not_spill(sign: int) -> None:
    bias = np.array([32767 * sign, -32767 * sign, 0], np.int16)
    none = np.zeros((0, 3), np.int16)
    assert Scorer(IntegerTables.of(bias, none, (), (), none, none, 1.0)).biased_scores([], []) == tuple(
        bias.astype(int) + LANE_OFFSET
    )


@pytest.mark.parametrize("kind", [np.uint16, np.uint8, np.int32, np.int64, list])
def test_codes_may_come_in_any_integers(kind: type) -> None:
    scorer, codes = Scorer(make_tables()), [3, 200, 77]
    given_codes: ArrayLike = codes if kind is list else np.array(codes, kind)
    assert scorer.biased_scores([0, 1] * 4 + [1], given_codes) == scorer.biased_scores(
        np.array([0, 1] * 4 + [1], bool), np.array(codes, np.uint16)
    )


@pytest.mark.parametrize(
    ("bits", "codes", "reason"),
    [
        (np.zeros(8, bool), [0, 0, 0], r"switches of shape \(8,\), but the build has 9"),
        (np.zeros((9, 1), bool), [0, 0, 0], "the build has 9"),
        ([2] + [0] * 8, [0, 0, 0], "0 or 1, but this frame has 2"),
        (np.full(9, np.nan), [0, 0, 0], "0 or 1, but this frame has nan"),
        (np.zeros(9, bool), [0, 0], r"codes of shape \(2,\), but the build has 3 joints"),
        (np.zeros(9, bool), [0, -1, 0], "0 to 65535, but this frame has -1"),
        (np.zeros(9, bool), [0, 65536, 0], "0 to 65535, but this frame has 65536"),
        (np.zeros(9, bool), [0, 1.5, 0], "codes must be integers, but this frame has float64"),
        (np.zeros(9, bool), ["a", "b", "c"], "codes must be integers"),
    ],
)
def test_a_frame_that_does_not_fit_is_refused(bits: ArrayLike, codes: ArrayLike, reason: str) -> None:
    with pytest.raises(FrameError, match=reason):
        Scorer(make_tables()).biased_scores(bits, codes)


@pytest.mark.parametrize(
    ("lost_bits", "lost_codes", "reason"),
    [
        (np.zeros(8, bool), np.zeros(3, bool), r"^a frame has lost switches of shape \(8,\), but the build has 9$"),
        (np.zeros(9, bool), np.zeros(4, bool), r"^a frame has lost joints of shape \(4,\), but the build has 3$"),
        ([3] + [0] * 8, np.zeros(3, bool), "^lost switches must be 0 or 1, but this frame has 3$"),
    ],
)
def test_a_mask_that_does_not_fit_is_named(lost_bits: ArrayLike, lost_codes: ArrayLike, reason: str) -> None:
    with pytest.raises(FrameError, match=reason):
        Scorer(make_tables()).biased_scores(np.zeros(9, bool), [0, 0, 0], lost_bits, lost_codes)


def test_every_code_has_its_bins_row_also_when_cached() -> None:
    tables = make_tables(3, switches=0, joints=2)
    scorer, codes = Scorer(tables), np.arange(0, 65536, 7)
    bins = np.searchsorted(tables.thresholds[0], codes)
    expected = tables.bias.astype(np.int64) + tables.joint_rows[0][bins] + tables.joint_rows[1][0]
    for _ in range(2):
        found = [scorer.biased_scores([], np.array([code, 0], np.uint16)) for code in codes]
        assert np.array_equal(np.array(found) - LANE_OFFSET, expected)


def flags(mask: int, count: int) -> np.ndarray:
    return np.array([mask >> bit & 1 for bit in range(count)], bool)


@pytest.mark.parametrize(("classes", "switches", "joints"), [(5, 9, 3), (2, 0, 2), (14, 40, 16), (3, 4, 0), (4, 5, 1)])
@settings(deadline=None)
@given(data=st.data())
def test_any_state_has_the_scores_of_the_whole_frame(
    data: st.DataObject, classes: int, switches: int, joints: int
) -> None:
    tables, masks = make_tables(3, classes, switches, joints), st.integers(0, (1 << switches) - 1)
    scorer = Scorer(tables)
    closed, lost = data.draw(masks), data.draw(st.just(0) | masks)
    several = st.lists(st.integers(0, 260) | st.just(65535), min_size=joints, max_size=joints)
    codes, lost_joints = data.draw(st.none() | several), data.draw(st.just(0) | st.integers(0, (1 << joints) - 1))
    absent = np.full(joints, True) if codes is None else flags(lost_joints, joints)
    measured = np.array([0] * joints if codes is None else codes, np.uint16)
    expected = summed(tables, flags(closed, switches), measured, flags(lost, switches), absent)
    found = np.array(scorer.state_scores(closed, lost, codes, lost_joints)) - LANE_OFFSET
    assert found.tolist() == expected.tolist()


@pytest.mark.parametrize("sign", [+1, -1])
def test_changes_at_the_edge_of_int16_do_not_spill(sign: int) -> None:
    def rows(*values: int) -> np.ndarray:
        return np.array(values, np.int16).reshape(-1, 2) * np.int16(sign)

    tables = IntegerTables.of(rows(0, 7)[0], rows(32767, -32760), (), (), rows(-1, 1), rows(), 1.0)
    scorer = Scorer(tables)
    for closed, lost in [(1, 0), (0, 1), (1, 1), (0, 0), (1, 0)]:
        row = tables.switch_means[0] if lost else closed * tables.switch_rows[0]
        assert scorer.state_scores(closed, lost, []) == tuple((tables.bias.astype(int) + row + LANE_OFFSET).tolist())


@pytest.mark.parametrize(("closed", "lost"), [(1 << 9, 0), (0, 1 << 9), (-1, 0), (0, -1)])
def test_a_switch_that_the_build_does_not_have_is_refused(closed: int, lost: int) -> None:
    with pytest.raises(FrameError, match="beyond the 9 of the build"):
        Scorer(make_tables()).state_scores(closed, lost, None)


@pytest.mark.parametrize("codes", [[], [1, 2], [1, 2, 3, 4]])
def test_codes_of_another_glove_are_refused(codes: list[int]) -> None:
    with pytest.raises(FrameError, match="the build has 3 joints"):
        Scorer(make_tables()).state_scores(0, 0, codes)

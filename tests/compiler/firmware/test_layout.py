from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.layout import NO_SWITCH, Field, arrange, parts_of, ports_of_scan
from thenar.compiler.firmware.probes import Probes
from thenar.runtime.scanning.scanmap import Port, ScanMap, StreamRead
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]


def plain_scores(tables: IntegerTables, frames: Probes) -> np.ndarray:
    """The sum of runtime/tables.py, written down once more."""
    scores = tables.bias + frames.bits.astype(np.int64) @ tables.switch_rows.astype(np.int64)
    for codes, thresholds, rows in zip(frames.codes.T, tables.thresholds, tables.joint_rows, strict=True):
        scores = scores + rows[(codes[:, np.newaxis] > thresholds).sum(axis=1)]
    return np.asarray(scores)


def without_thresholds(tables: IntegerTables, joint: int) -> IntegerTables:
    """The same tables with a joint whose every code takes the same row."""
    thresholds, rows = list(tables.thresholds), list(tables.joint_rows)
    thresholds[joint], rows[joint] = thresholds[joint][:0], rows[joint][:1]
    return IntegerTables(
        tables.bias,
        tables.switch_rows,
        tuple(thresholds),
        tuple(rows),
        tables.switch_means,
        tables.joint_means,
        tables.scale,
    )


@given(
    st.integers(0, 99), st.integers(0, 12), st.integers(0, 3), st.sampled_from([3, 12, 300]), st.sampled_from([4, 12])
)
def test_scores_are_those_of_the_tables(
    make_tables: MakeTables, probed: Callable[..., Probes], seed: int, switches: int, joints: int, reach: int, bins: int
) -> None:
    tables = make_tables(seed, switches=switches, joints=joints, bins=bins, reach=reach)
    if switches + joints == 0:
        return
    frames = probed(tables, 30)
    layout = arrange(tables)
    assert (layout.entry_bits, layout.sum_bits) == (8 if reach < 300 else 16, 8 if tables.bound <= 127 else 16)
    assert np.array_equal(layout.scores(frames.bits, frames.codes), plain_scores(tables, frames))


@pytest.mark.parametrize("bins", [5, 9])
@pytest.mark.parametrize("reach", [20, 300])
def test_every_code_of_a_byte_finds_its_row(make_tables: MakeTables, bins: int, reach: int) -> None:
    tables = make_tables(seed=4, switches=0, joints=1, bins=bins, reach=reach)
    codes = np.arange(256, dtype=np.uint16)[:, np.newaxis]
    layout, frames = arrange(tables), Probes(np.zeros((256, 0), bool), codes)
    assert layout.joints[0].compared == (bins == 5)
    assert np.array_equal(layout.scores(frames.bits, codes), plain_scores(tables, frames))


def test_groups_are_consecutive_and_as_even_as_can_be(make_tables: MakeTables) -> None:
    tables = make_tables(switches=33)
    assert [len(group) for group in arrange(tables).groups] == [4] * 8 + [1]
    assert [number for group in arrange(tables).groups for number in group] == list(range(33))


def test_with_wide_entries_row_0_of_a_group_is_zero_and_row_2_to_the_b_its_switch_b(make_tables: MakeTables) -> None:
    tables = make_tables(switches=11, reach=300)
    layout = arrange(tables)
    for numbers, lookup in zip(layout.groups, layout.lookups, strict=False):
        rows = lookup.rows
        assert not rows[0].any()
        for bit, number in enumerate(numbers):
            assert np.array_equal(rows[1 << bit], tables.switch_rows[number])


@given(st.integers(0, 99))
def test_narrow_entries_are_bytes_of_which_every_class_has_a_zero_in_every_look_up(
    make_tables: MakeTables, seed: int
) -> None:
    layout = arrange(make_tables(seed))
    assert layout.biased
    for lookup in layout.lookups:
        assert lookup.rows.dtype == np.uint8
        assert not lookup.rows.min(axis=0).any()


def test_look_ups_lie_one_after_the_other(make_tables: MakeTables) -> None:
    layout = arrange(without_thresholds(make_tables(joints=4), 1))
    made = layout.lookups
    assert [lookup.index for lookup in made] == list(range(6))
    assert [lookup.group for lookup in made] == [0, 1, 2, None, None, None]
    assert [joint.number for joint in layout.joints] == [0, 2, 3]
    ends = np.cumsum([len(lookup.rows) for lookup in made]).tolist()
    assert [lookup.first_row for lookup in made] == [0, *ends[:-1]]
    assert ends[-1] == layout.n_rows


def test_a_constant_joint_is_part_of_the_start(make_tables: MakeTables, probed: Callable[..., Probes]) -> None:
    whole = make_tables(joints=3)
    tables = without_thresholds(whole, 1)
    frames = probed(whole, 20)
    layout = arrange(tables)
    assert [joint.number for joint in layout.joints] == [0, 2]
    assert np.array_equal(layout.scores(frames.bits, frames.codes), plain_scores(tables, frames))


def test_frames_hold_the_bytes_of_ports_then_codes(make_tables: MakeTables) -> None:
    tables, bits = make_tables(switches=7, joints=2), np.array([[1, 0, 0, 1, 0, 0, 1]], bool)
    layout = arrange(tables)
    assert layout.frame_bytes(bits, np.array([[7, 254]], np.uint16)).tolist() == [[0b1001001, 7, 254]]
    assert layout.frame_bytes(bits, np.array([[7, 60000]], np.uint16)).tolist() == [[0b1001001, 7, 255]]
    wired = arrange(tables, ports=((-1, 6, 0), (3, 4, 5, -1, 1, 2)))
    assert wired.frame_bytes(bits, np.array([[7, 254]], np.uint16)).tolist() == [[0b110, 0b1, 7, 254]]


def test_ports_of_a_harness_are_the_bytes_that_show_a_kept_switch_streams_first() -> None:
    ports, streams = (Port(0, 1, "GPIO", ((17, 3), (1, 2)), True),), (StreamRead(((9, 0), (40, 1)), ()),)
    scan = ScanMap(1, "0" * 64, ports, streams)
    none = NO_SWITCH
    assert ports_of_scan(scan) == (
        (none, 0, *[none] * 6),
        (1, *[none] * 7),
        (none, 2, *[none] * 6),
        (none, 3, *[none] * 6),
    )
    assert ports_of_scan(None) is None


def test_groups_are_of_one_port_each_where_no_more_are_needed(make_tables: MakeTables) -> None:
    eights = arrange(make_tables(switches=32))
    assert [[(f.port, f.bit, f.width, f.to) for f in fields] for fields in eights.fields[:3]] == [
        [(0, 0, 4, 0)],
        [(0, 4, 4, 0)],
        [(1, 0, 4, 0)],
    ]
    wired = arrange(make_tables(switches=9), ((-1, 8, 0, 1), (2, 3, 4), (5, 7, -1, 6)))
    assert wired.groups == ((8, 0, 1), (2, 3, 4), (5, 7, 6))
    assert [len(fields) for fields in wired.fields] == [1, 1, 2]
    spanning = arrange(make_tables(switches=8), ((0, 1, 2), (3, 4, 5), (6, 7)))
    assert spanning.groups == ((0, 1, 2, 3), (4, 5, 6, 7))
    assert spanning.fields[0] == (Field(0, 0, 3, 0), Field(1, 0, 1, 3))


def test_wide_codes_are_little_endian_at_even_offsets(make_tables: MakeTables) -> None:
    layout = arrange(make_tables(switches=3, joints=2, highest=700))
    frames = layout.frame_bytes(np.ones((1, 3), bool), np.array([[0x1234, 9]], np.uint16))
    assert layout.code_bits == 16
    assert frames.tolist() == [[7, 0, 0x34, 0x12, 9, 0]]


def test_a_threshold_of_254_is_the_last_that_a_byte_can_tell(make_tables: MakeTables) -> None:
    assert arrange(make_tables(highest=254)).code_bits == 8
    assert arrange(make_tables(highest=255)).code_bits == 16


def refused(tables: IntegerTables) -> str:
    with pytest.raises(FirmwareError) as raised:
        arrange(tables)
    return str(raised.value)


def test_what_cannot_be_laid_out_is_refused(make_tables: MakeTables) -> None:
    assert "uses no switch and no joint" in refused(make_tables(switches=0, joints=0))
    assert "300 rows" in refused(make_tables(bins=300, highest=3000))


@given(st.integers(2, 1024))
def test_parts_are_of_equal_width_and_cover_all_classes(classes: int) -> None:
    parts = parts_of(classes)
    covered = {first + k for first in parts.firsts for k in range(parts.width)}
    assert covered == set(range(classes))
    assert parts.width <= 14
    assert len(parts.firsts) == -(-classes // 14)
    assert parts_of(classes, 8).width <= 28

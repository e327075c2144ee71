import contextlib
import struct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.errors import BuildError, ThenarError
from thenar.runtime.model import integers as module
from thenar.runtime.model.integers import (
    COARSEST_SCALE,
    KIND,
    PAIRED,
    PLAIN,
    SLOPED,
    IntegerTables,
    tables_from_bytes,
    tables_to_bytes,
)
from thenar.runtime.model.terms.line import Line
from thenar.runtime.sealed import HEADER, seal

from ..conftest import peak_bytes
from .conftest import make_tables

Size = dict[str, int]

sizes = st.fixed_dictionaries(
    {
        "seed": st.integers(0, 99),
        "classes": st.integers(2, 6),
        "switches": st.integers(0, 9),
        "joints": st.integers(0, 3),
        "bins": st.integers(1, 5),
        "slopes": st.integers(0, 3),
    }
)


def _payload(tables: IntegerTables) -> bytearray:
    return bytearray(tables_to_bytes(tables)[56:])


@given(size=sizes)
def test_what_was_written_is_read_again(size: Size) -> None:
    data = tables_to_bytes(make_tables(**size))
    assert tables_to_bytes(tables_from_bytes(data)) == data


def test_the_bytes_are_as_documented() -> None:
    tables = IntegerTables.of(
        bias=np.array([1, -1], np.int16),
        switch_rows=np.array([[2, -2]], np.int16),
        thresholds=(np.array([258], np.uint16),),
        joint_rows=(np.array([[3, -3], [4, -4]], np.int16),),
        switch_means=np.array([[5, -5]], np.int16),
        joint_means=np.array([[6, -6]], np.int16),
        scale=1.0,
    )
    counts = bytes.fromhex("0200 0100 0100 0000 000000000000f03f 0100")
    rows = bytes.fromhex("0100ffff 0200feff 0500fbff 0600faff 0201 0300fdff 0400fcff")
    assert bytes(_payload(tables)) == counts + rows


def test_the_bytes_of_slopes_are_as_documented() -> None:
    none, row = np.zeros((0, 2), np.int16), np.zeros((1, 2), np.int16)
    slope = Line(0, 258, 300, np.array([7, -8], np.int8), -1)
    tables = IntegerTables.of(row[0], none, (np.array([], np.uint16),), (row,), none, row, 1.0, (slope,))
    counts = bytes.fromhex("0200 0000 0100 0100 000000000000f03f 0000")
    assert bytes(_payload(tables)) == counts + bytes(12) + bytes.fromhex("0100 0000 0201 2c01 ffff 07f8")
    for version, wrong in ((PLAIN, counts), (SLOPED, counts.replace(b"\1\0\1\0", b"\1\0\0\0"))):
        with pytest.raises(BuildError, match="offset 6"):
            tables_from_bytes(seal(KIND, version, wrong + bytes(12)))


@pytest.mark.parametrize(
    "ends", [(9, 9, 0), (9, 8, 0), (0, 65536, -9), (0, 65535, -8), (0, 255, 0), (0, 20, 4), (0, 20, -5), (0, 20, -17)]
)
def test_a_slope_that_fits_no_byte_is_refused(ends: tuple[int, int, int]) -> None:
    low, high, gain = ends
    with pytest.raises(BuildError, match="does not fit a byte"):
        Line(0, low, high, np.zeros(2, np.int8), gain)


def test_slopes_of_other_joints_or_shapes_are_refused() -> None:
    tables = make_tables(slopes=2)
    for joints in ((1, 0), (0, 0), (0, 3)):
        with pytest.raises(BuildError, match="they must rise"):
            tables.changed(further=tuple(replace(tables.lines[0], joint=joint) for joint in joints))
    with pytest.raises(BuildError, match="a line of scores"):
        tables.changed(further=(replace(tables.lines[0], gain=None),))
    with pytest.raises(BuildError, match="row of the slope"):
        tables.changed(further=(replace(tables.lines[0], row=np.zeros(4, np.int8)),))


def test_a_slope_that_could_overflow_is_refused() -> None:
    slopes = (Line(0, 0, 254, np.full(5, 127, np.int8), 0),)
    assert make_tables().changed(further=slopes).bound > 127 * 127
    two = (*slopes, replace(slopes[0], joint=1), replace(slopes[0], joint=2))
    with pytest.raises(BuildError, match="could overflow"):
        make_tables().changed(further=two)


@given(size=sizes, data=st.data())
def test_no_partial_sum_of_any_frame_leaves_the_bound(size: Size, data: st.DataObject) -> None:
    tables = make_tables(**size)
    terms = [tables.bias]
    for row, mean in zip(tables.switch_rows, tables.switch_means, strict=True):
        terms.append(data.draw(st.sampled_from([row, mean, 0 * row])))
    for rows, mean in zip(tables.joint_rows, tables.joint_means, strict=True):
        terms.append(data.draw(st.sampled_from([*rows, mean])))
    for slope in tables.lines:
        lost = (terms[1 + tables.n_switches + slope.joint] == tables.joint_means[slope.joint]).all()
        terms.append(0 * tables.bias if lost else slope.of(np.array([data.draw(st.integers(0, 500))]))[0])
    order = data.draw(st.permutations(terms))
    assert np.abs(np.cumsum(np.array(order, np.int64), axis=0)).max() <= tables.bound


def test_a_tampered_table_that_could_overflow_is_refused() -> None:
    tables = make_tables()
    payload = _payload(tables)
    start = 16 + 2 * tables.n_joints
    payload[start : start + 2] = (32767).to_bytes(2, "little")
    with pytest.raises(BuildError, match=r"tables\.bin is damaged: a sum could reach \d+, beyond 32767"):
        tables_from_bytes(seal(KIND, 1, bytes(payload)))


def test_the_most_negative_integer_does_not_slip_through() -> None:
    tables = make_tables(switches=0, joints=0)
    with pytest.raises(BuildError, match="a sum could reach 32768"):
        tables.changed(bias=np.full(5, -32768, np.int16))


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf"), 1e308, 2.0**31])
def test_a_scale_that_is_no_scale_is_refused(scale: float) -> None:
    with pytest.raises(BuildError, match="scale"):
        replace(make_tables(), scale=scale)


def test_a_file_holds_no_coarser_scale_than_an_ensemble_can_need() -> None:
    data = tables_to_bytes(replace(make_tables(), scale=COARSEST_SCALE))
    assert tables_from_bytes(data).scale == COARSEST_SCALE
    with pytest.raises(BuildError, match="at least 2"):
        tables_to_bytes(replace(make_tables(), scale=COARSEST_SCALE / 2))
    payload = data[HEADER.size :].replace(struct.pack("<d", COARSEST_SCALE), struct.pack("<d", COARSEST_SCALE / 2))
    with pytest.raises(BuildError, match="at least 2"):
        tables_from_bytes(seal(KIND, PLAIN, payload))


@pytest.mark.parametrize("change", [{"bias": np.zeros(4, np.int16)}, {"bias": np.zeros(5)}, {"joint_rows": ()}])
def test_arrays_that_do_not_belong_together_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(BuildError):
        make_tables().changed(**change)


@pytest.mark.parametrize(
    ("offset", "count", "reason"),
    [
        (0, 1, "1 grasp types"),
        (0, 1025, "1025 grasp types"),
        (2, 4097, "4097 switches"),
        (4, 257, "257 joints"),
        (2, 4096, "its counts call for"),
        (6, 1, "offset 6"),
    ],
)
def test_counts_are_held_against_their_caps_and_the_length(offset: int, count: int, reason: str) -> None:
    payload = _payload(make_tables())
    payload[offset : offset + 2] = count.to_bytes(2, "little")
    with pytest.raises(BuildError, match=reason):
        tables_from_bytes(seal(KIND, 1, bytes(payload)))


@given(payload=st.binary(max_size=300), version=st.sampled_from([PLAIN, SLOPED, PAIRED]))
def test_any_sealed_content_is_read_or_refused_without_much_memory(payload: bytes, version: int) -> None:
    def read() -> None:
        with contextlib.suppress(ThenarError):
            tables_from_bytes(seal(KIND, version, payload))

    assert peak_bytes(read) < 1 << 20


@given(size=sizes, data=st.data())
def test_mutated_content_is_read_or_refused(size: Size, data: st.DataObject) -> None:
    made = make_tables(**size)
    payload, version = _payload(made), SLOPED if made.lines else PLAIN
    for _ in range(data.draw(st.integers(1, 4))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    try:
        tables = tables_from_bytes(seal(KIND, version, bytes(payload)))
    except ThenarError:
        return
    assert tables_to_bytes(tables)[56:] == bytes(payload)


def test_counts_without_the_thresholds_counts_they_announce_are_refused() -> None:
    for length in (15, 16, 21):
        with pytest.raises(BuildError, match=f"{length} bytes of content"):
            tables_from_bytes(seal(KIND, 1, bytes(_payload(make_tables())[:length])))


def test_a_file_may_be_as_large_as_the_largest_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    made = make_tables()
    data = tables_to_bytes(made)
    monkeypatch.setattr(module, "MAX_BYTES", len(data))
    assert tables_to_bytes(tables_from_bytes(data)) == data
    monkeypatch.setattr(module, "MAX_BYTES", len(data) - 1)
    with pytest.raises(BuildError, match=f"at most {len(data) - 1}"):
        tables_from_bytes(data)
    with pytest.raises(BuildError, match="keep fewer inputs"):
        tables_to_bytes(made)


@pytest.mark.parametrize("name", ["bias", "switch_rows", "switch_means", "joint_means"])
def test_an_array_of_another_type_is_named(name: str) -> None:
    made = make_tables()
    with pytest.raises(BuildError, match=rf"^{name}(\[0\])? is int32 "):
        made.changed(**{name: getattr(made, name).astype(np.int32)})


@pytest.mark.parametrize("steps", [[3, 3, 9], [3, 9, 9], [5, 9, 7], [9, 5, 7]])
def test_equal_or_falling_thresholds_are_refused_wherever_they_stand(steps: list[int]) -> None:
    rows, none = np.zeros((4, 2), np.int16), np.zeros((0, 2), np.int16)
    with pytest.raises(BuildError, match="not strictly increasing"):
        IntegerTables.of(rows[0], none, (np.array(steps, np.uint16),), (rows,), none, rows[:1], 1.0)


@pytest.mark.parametrize(("classes", "switches", "joints"), [(2, 0, 0), (1024, 0, 0), (2, 4096, 0), (2, 0, 256)])
def test_as_many_as_documented_are_read(classes: int, switches: int, joints: int) -> None:
    def rows(n: int) -> np.ndarray:
        return np.zeros((n, classes), np.int16)

    none = np.zeros(0, np.uint16)
    made = IntegerTables.of(
        rows(1)[0], rows(switches), (none,) * joints, (rows(1),) * joints, rows(switches), rows(joints), 1.0
    )
    again = tables_from_bytes(tables_to_bytes(made))
    assert (again.n_classes, again.n_switches, again.n_joints) == (classes, switches, joints)

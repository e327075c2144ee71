from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.artifact.ensemble import KIND, LINES, PAIRS, TABLES, ensemble_from_bytes, ensemble_to_bytes
from thenar.compiler.boosting.stumps import Stumps
from thenar.compiler.recordings.arrays import pack, unpack
from thenar.compiler.tables.collapse import Line, ScoreTables
from thenar.drivers.errors import ThenarError
from thenar.runtime.sealed import seal, unseal
from thenar.runtime.tables import Pair

HEADER = b'{"n_inputs":5,"shrinkage":0.5}'


def _arrays() -> dict[str, np.ndarray]:
    random = np.random.default_rng(0)
    return {
        "columns": random.integers(0, 5, (3, 2)).astype("<i4"),
        "thresholds": random.normal(size=(3, 2)),
        "values": random.normal(size=(3, 2, 3)),
    }


def test_what_was_written_is_read_again_bit_for_bit() -> None:
    arrays = _arrays()
    stumps = Stumps(5, arrays["columns"], arrays["thresholds"], arrays["values"], shrinkage=0.5)
    data = ensemble_to_bytes(stumps)
    read = ensemble_from_bytes(data)
    assert isinstance(read, Stumps)
    assert (read.n_inputs, read.shrinkage) == (5, 0.5)
    for name, array in _arrays().items():
        assert np.array_equal(getattr(read, name), array)
    assert ensemble_to_bytes(read) == data


def _tables() -> ScoreTables:
    random = np.random.default_rng(1)
    thresholds = (np.array([3, 70, 65535], np.uint16), np.array([], np.uint16))
    rows = tuple(random.normal(size=(len(steps) + 1, 3)) for steps in thresholds)
    return ScoreTables(random.normal(size=3), random.normal(size=(2, 3)), thresholds, rows)


@pytest.mark.parametrize("joints", [2, 1, 0])
def test_tables_are_read_again_bit_for_bit(joints: int) -> None:
    tables = replace(_tables(), thresholds=_tables().thresholds[:joints], joint_rows=_tables().joint_rows[:joints])
    data = ensemble_to_bytes(tables)
    read = ensemble_from_bytes(data)
    assert isinstance(read, ScoreTables)
    for name in ("bias", "switch_rows"):
        assert np.array_equal(getattr(read, name), getattr(tables, name))
    for name in ("thresholds", "joint_rows"):
        assert all(map(np.array_equal, getattr(read, name), getattr(tables, name)))
    assert ensemble_to_bytes(read) == data


@pytest.mark.parametrize(
    "change",
    [
        {"bins": np.array([5, 0])},
        {"bins": np.array([2, 2])},
        {"bins": np.array([4, -(2**63)])},
        {"bins": np.array([2**62, 2**62, 2**62, 2**62, 5])},
        {"bins": np.ones(1000, np.int64)},
        {"bias": np.zeros(2)},
        {"bias": np.zeros((3, 1))},
        {"bias": np.full(3, np.nan)},
        {"bias": np.zeros(1), "switch_rows": np.zeros((2, 1)), "joint_rows": np.zeros((5, 1))},
        {"switch_rows": np.full((2, 3), 1e300)},
        {"thresholds": np.array([3, 3, 70], np.uint16)},
        {"thresholds": np.array([3, 70], np.uint16)},
        {"joint_rows": np.zeros((5, 3), "<f4")},
        {"more": np.zeros(1)},
    ],
)
def test_tables_that_contradict_themselves_are_refused(change: dict[str, np.ndarray]) -> None:
    _, payload = unseal(ensemble_to_bytes(_tables()), KIND, TABLES, "ensemble.bin")
    header, arrays = unpack(payload)
    with pytest.raises(ThenarError, match=r"ensemble\.bin is damaged"):
        ensemble_from_bytes(seal(KIND, TABLES, pack(header, arrays | change)))


def _with_lines() -> ScoreTables:
    lines = (Line(0, 3, 200, np.array([0.5, -1.0, 0.0])), Line(1, 0, 65535, np.array([1e-5, 0.0, 2.0])))
    return replace(_tables(), lines=lines)


def test_lines_are_read_again_bit_for_bit() -> None:
    data = ensemble_to_bytes(_with_lines())
    read = ensemble_from_bytes(data)
    assert isinstance(read, ScoreTables)
    for ours, theirs in zip(read.lines, _with_lines().lines, strict=True):
        assert (ours.joint, ours.low, ours.high) == (theirs.joint, theirs.low, theirs.high)
        assert np.array_equal(ours.row, theirs.row)
    assert ensemble_to_bytes(read) == data


@pytest.mark.parametrize(
    "change",
    [
        {"lines": np.array([[1, 0, 9], [0, 0, 9]])},
        {"lines": np.array([[0, 0, 9], [0, 0, 9]])},
        {"lines": np.array([[0, 0, 9], [2, 0, 9]])},
        {"lines": np.array([[-1, 0, 9], [1, 0, 9]])},
        {"lines": np.array([[0, 9, 9], [1, 0, 9]])},
        {"lines": np.array([[0, -1, 9], [1, 0, 9]])},
        {"lines": np.array([[0, 0, 65536], [1, 0, 9]])},
        {"lines": np.zeros((0, 3), np.int64), "line_rows": np.zeros((0, 3))},
        {"lines": np.zeros((2, 2), np.int64)},
        {"lines": np.zeros(6, np.int64)},
        {"line_rows": np.zeros((2, 2))},
        {"line_rows": np.zeros(3)},
        {"line_rows": np.full((2, 3), np.nan)},
    ],
)
def test_lines_that_contradict_themselves_are_refused(change: dict[str, np.ndarray]) -> None:
    _, payload = unseal(ensemble_to_bytes(_with_lines()), KIND, LINES, "ensemble.bin")
    header, arrays = unpack(payload)
    with pytest.raises(ThenarError, match=r"ensemble\.bin is damaged"):
        ensemble_from_bytes(seal(KIND, LINES, pack(header, arrays | change)))


def _with_pairs() -> ScoreTables:
    steps = np.array([4], np.uint16), np.array([7, 9], np.uint16)
    return replace(_tables(), pairs=(Pair((0, 1), steps, np.random.default_rng(2).normal(size=(2, 3, 3))),))


def test_pairs_are_read_again_bit_for_bit() -> None:
    data = ensemble_to_bytes(_with_pairs())
    read = ensemble_from_bytes(data)
    assert isinstance(read, ScoreTables)
    (ours,), (theirs,) = read.pairs, _with_pairs().pairs
    assert ours.joints == theirs.joints
    assert all(map(np.array_equal, (*ours.thresholds, ours.rows), (*theirs.thresholds, theirs.rows)))
    assert ensemble_to_bytes(read) == data


@pytest.mark.parametrize(
    "change",
    [
        {"pairs": np.array([[1, 0, 1, 2]])},
        {"pairs": np.array([[0, 2, 1, 2]])},
        {"pairs": np.array([[0, 1, 2, 2]])},
        {"pairs": np.array([[0, 1, -1, 2]])},
        {"pairs": np.array([[0, 1, 2**62, 2**62]])},
        {"pairs": np.array([[0, 1, 1]])},
        {"pairs": np.zeros((0, 4), np.int64)},
        {"pair_thresholds": np.array([4, 9, 7], np.uint16)},
        {"pair_thresholds": np.array([4, 9], np.uint16)},
        {"pair_rows": np.zeros((6, 2))},
        {"pair_rows": np.zeros((5, 3))},
        {"pair_rows": np.full((6, 3), np.nan)},
    ],
)
def test_pairs_that_contradict_themselves_are_refused(change: dict[str, np.ndarray]) -> None:
    _, payload = unseal(ensemble_to_bytes(_with_pairs()), KIND, PAIRS, "ensemble.bin")
    header, arrays = unpack(payload)
    with pytest.raises(ThenarError, match=r"ensemble\.bin is damaged"):
        ensemble_from_bytes(seal(KIND, PAIRS, pack(header, arrays | change)))


@pytest.mark.parametrize(
    "change",
    [
        {"columns": np.full((3, 2), 5, "<i4")},
        {"columns": np.full((3, 2), -1, "<i4")},
        {"columns": np.zeros(6, "<i4")},
        {"thresholds": np.zeros((2, 2))},
        {"thresholds": np.full((3, 2), np.nan)},
        {"values": np.full((3, 2, 3), np.inf)},
        {"values": np.full((3, 2, 3), -1e300)},
        {"thresholds": np.full((3, 2), 1e300)},
        {"columns": np.zeros((0, 2), "<i4"), "thresholds": np.zeros((0, 2)), "values": np.zeros((0, 2, 3))},
        {"columns": np.zeros((3, 1), "<i4"), "thresholds": np.zeros((3, 1)), "values": np.zeros((3, 1, 3))},
        {"values": np.zeros((3, 2, 3), "<f4")},
        {"more": np.zeros(1)},
    ],
)
def test_a_sealed_file_that_contradicts_itself_is_refused(change: dict[str, np.ndarray]) -> None:
    with pytest.raises(ThenarError, match=r"ensemble\.bin is damaged"):
        ensemble_from_bytes(seal(KIND, 1, pack(HEADER, _arrays() | change)))


@pytest.mark.parametrize(
    "header",
    [
        HEADER.replace(b"shrinkage", b"shrink\xffge"),
        HEADER.replace(b"5", b"9" * 10_000),
        HEADER.replace(b"5", b"[" * 200_000),
        HEADER.replace(b"5", b"0"),
        HEADER.replace(b"5", b"5000"),
        HEADER.replace(b"0.5", b"1e308"),
        HEADER.replace(b"0.5", b"-1"),
    ],
)
def test_a_sealed_header_of_anything_but_an_ensemble_is_refused(header: bytes) -> None:
    with pytest.raises(ThenarError, match=r"ensemble\.bin is damaged"):
        ensemble_from_bytes(seal(KIND, 1, pack(header, _arrays())))


@given(data=st.data())
def test_mutated_content_is_read_or_refused(data: st.DataObject) -> None:
    payload = bytearray(pack(HEADER, _arrays()))
    for _ in range(data.draw(st.integers(1, 3))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    try:
        stumps = ensemble_from_bytes(seal(KIND, 1, bytes(payload)))
    except ThenarError:
        return
    assert isinstance(stumps, Stumps)
    scores = stumps.scores(np.zeros((1, stumps.n_inputs)))
    assert scores.shape == (1, stumps.n_classes)

import sys

import numpy as np
import pytest

from thenar.compiler.arrays import pack, unpack
from thenar.compiler.artifact.ensemble import KIND, TABLES, ensemble_from_bytes, ensemble_to_bytes
from thenar.compiler.trainers.stumps import Stumps
from thenar.drivers.errors import ThenarError
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.model.terms.grid import Grid
from thenar.runtime.model.terms.line import Line
from thenar.runtime.sealed import seal, unseal

HEADER = b'{"n_inputs":5,"shrinkage":0.5}'


def _arrays() -> dict[str, np.ndarray]:
    random = np.random.default_rng(0)
    return {
        "columns": random.integers(0, 5, (3, 2)).astype("<i4"),
        "thresholds": random.normal(size=(3, 2)),
        "values": random.normal(size=(3, 2, 3)),
    }


def _tables() -> ScoreTables:
    random = np.random.default_rng(1)
    thresholds = (np.array([3, 70, 65535], np.uint16), np.array([], np.uint16))
    rows = tuple(random.normal(size=(len(steps) + 1, 3)) for steps in thresholds)
    return ScoreTables.of(random.normal(size=3), random.normal(size=(2, 3)), thresholds, rows)


def _stumps() -> Stumps:
    arrays = _arrays()
    return Stumps(5, arrays["columns"], arrays["thresholds"], arrays["values"], shrinkage=0.5)


def _few_joints(joints: int) -> ScoreTables:
    return _tables().changed(thresholds=_tables().thresholds[:joints], joint_rows=_tables().joint_rows[:joints])


def _with_lines() -> ScoreTables:
    lines = (Line(0, 3, 200, np.array([0.5, -1.0, 0.0])), Line(1, 0, 65535, np.array([1e-5, 0.0, 2.0])))
    return _tables().changed(further=lines)


def _with_pairs() -> ScoreTables:
    steps = np.array([4], np.uint16), np.array([7, 9], np.uint16)
    return _tables().changed(further=(Grid((0, 1), steps, np.random.default_rng(2).normal(size=(2, 3, 3))),))


@pytest.mark.parametrize(
    "model",
    [_stumps(), _tables(), _few_joints(1), _few_joints(0), _with_lines(), _with_pairs()],
    ids=["stumps", "tables", "one joint", "no joints", "lines", "pairs"],
)
def test_what_was_written_is_read_again_bit_for_bit(model: Stumps | ScoreTables) -> None:
    data = ensemble_to_bytes(model)
    read = ensemble_from_bytes(data)
    assert type(read) is type(model)
    assert ensemble_to_bytes(read) == data
    with np.printoptions(floatmode="unique", threshold=sys.maxsize):
        assert repr(read) == repr(model)


CONTRADICTIONS: list[tuple[ScoreTables, list[dict[str, np.ndarray]]]] = [
    (
        _tables(),
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
    ),
    (
        _with_lines(),
        [
            {"term_0_joint": np.array(1), "term_1_joint": np.array(0)},
            {"term_0_joint": np.array(0), "term_1_joint": np.array(0)},
            {"term_1_joint": np.array(2)},
            {"term_0_joint": np.array(-1)},
            {"term_0_joint": np.array([0, 1])},
            {"term_0_low": np.array(200)},
            {"term_0_low": np.array(-1)},
            {"term_0_high": np.array(65536)},
            {"term_0_row": np.zeros(2)},
            {"term_0_row": np.zeros((2, 3))},
            {"term_0_row": np.full(3, np.nan)},
            {"term_0_more": np.zeros(3)},
            {"term_2_row": np.zeros(3)},
        ],
    ),
    (
        _with_pairs(),
        [
            {"term_0_joints": np.array([1, 0])},
            {"term_0_joints": np.array([0, 2])},
            {"term_0_joints": np.array([0, 1, 2])},
            {"term_0_down": np.array([4, 5], np.uint16)},
            {"term_0_down": np.array([4])},
            {"term_0_across": np.array([9, 7], np.uint16)},
            {"term_0_across": np.array([7], np.uint16)},
            {"term_0_rows": np.zeros((2, 3, 2))},
            {"term_0_rows": np.zeros((6, 3))},
            {"term_0_rows": np.full((2, 3, 3), np.nan)},
        ],
    ),
]


@pytest.mark.parametrize(
    ("tables", "change"), [(tables, change) for tables, changes in CONTRADICTIONS for change in changes]
)
def test_tables_that_contradict_themselves_are_refused(tables: ScoreTables, change: dict[str, np.ndarray]) -> None:
    _, payload = unseal(ensemble_to_bytes(tables), KIND, TABLES, "ensemble.bin")
    header, arrays = unpack(payload)
    with pytest.raises(ThenarError, match=r"ensemble\.bin is damaged"):
        ensemble_from_bytes(seal(KIND, TABLES, pack(header, arrays | change)))


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

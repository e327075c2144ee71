from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.one_hand import BYTES, byte_range, for_one_hand, on_bytes
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.drivers.errors import SettingError
from thenar.runtime.build import Build
from thenar.runtime.calibration import CodeTables, codes_of_bytes
from thenar.runtime.manifest import Calibration, Manifest
from thenar.runtime.scores import Scorer
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]

NAMES = ("j0", "j1", "j2")


def hand(*names: str) -> GloveCalibration:
    lines = (SensorCalibration(name, 40 + place, 0.0, 200 - 9 * place, 90.0) for place, name in enumerate(names))
    return GloveCalibration(subject="anna", sensors=tuple(lines))


@pytest.mark.parametrize("highest", [254, 900])
def test_every_byte_is_answered_as_the_runtime_answers_it(
    make_tables: MakeTables, describe: Describe, highest: int
) -> None:
    tables = make_tables(highest=highest)
    build, calibration = Build(describe(tables), tables), hand(*NAMES)
    raw, codes = for_one_hand(build, calibration), CodeTables(build.manifest.joints, NAMES, calibration)
    bits = np.random.default_rng(2).random((255, 9)) < 0.5
    for byte, closed in zip(range(1, 256), bits, strict=True):
        record = bytes([byte, 256 - byte, (byte * 7) % 255 + 1])
        assert raw.scorer.lanes(closed, list(record)) == build.scorer.lanes(closed, codes.codes(record))
    assert [(joint.code_a, joint.code_b) for joint in raw.manifest.joints] == [(1, 255)] * 3


def test_a_hand_without_one_of_the_joints_is_refused(make_tables: MakeTables, describe: Describe) -> None:
    tables = make_tables()
    with pytest.raises(SettingError, match="the calibration has no sensor 'j2'"):
        for_one_hand(Build(describe(tables), tables), hand("j0", "j1"))


def tables_of(thresholds: list[list[int]], seed: int, classes: int = 3) -> IntegerTables:
    rng = np.random.default_rng(seed)

    def rows(n: int) -> np.ndarray:
        return rng.integers(-500, 500, (n, classes)).astype(np.int16)

    return IntegerTables(
        bias=rows(1)[0],
        switch_rows=rows(2),
        thresholds=tuple(np.array(joint, np.uint16) for joint in thresholds),
        joint_rows=tuple(rows(len(joint) + 1) for joint in thresholds),
        switch_means=np.zeros((2, classes), np.int16),
        joint_means=np.zeros((len(thresholds), classes), np.int16),
        scale=1.0,
    )


THRESHOLDS = st.lists(st.integers(0, 65535), unique=True, max_size=20).map(sorted)
# Rising, falling, constant and wild: what a calibration can make of bytes, and more.
CODES = st.one_of(
    st.tuples(st.integers(0, 3000), st.integers(-10, 10)).map(
        lambda t: [max(0, t[0] + t[1] * b) for b in range(BYTES)]
    ),
    st.lists(st.integers(0, 65535), min_size=BYTES, max_size=BYTES),
)


@given(THRESHOLDS, THRESHOLDS, CODES, CODES, st.integers(0, 2**32 - 1))
def test_every_byte_scores_as_its_code_did(
    first: list[int], second: list[int], codes_a: list[int], codes_b: list[int], seed: int
) -> None:
    tables = tables_of([first, second], seed)
    on_codes, of_bytes = Scorer(tables), Scorer(on_bytes(tables, [codes_a, codes_b]))
    for byte in range(BYTES):
        other = (7 * byte + 3) % BYTES
        coded = np.array([codes_a[byte], codes_b[other]], np.uint16)
        assert of_bytes.lanes([1, 0], [byte, other]) == on_codes.lanes([1, 0], coded)


def test_a_threshold_that_no_byte_parts_falls_away() -> None:
    tables = tables_of([[10, 300, 40_000]], 1)
    assert on_bytes(tables, [range(BYTES)]).thresholds[0].tolist() == [10]


def test_codes_of_the_runtime_fit() -> None:
    joint = Calibration(0, "thumb_rotation", "deg", 360, 0.0, 720, 180.0)
    line = SensorCalibration("thumb_rotation", 50, -20.0, 200, 100.0)
    codes = codes_of_bytes(joint, GloveCalibration(sensors=(line,)))
    tables = tables_of([[300, 333, 421, 500]], 2)
    assert len(on_bytes(tables, [codes]).thresholds[0]) == 4


@pytest.mark.parametrize("codes", [[], [range(BYTES)] * 2, [range(255)]])
def test_anything_but_256_codes_a_joint_is_refused(codes: list[range]) -> None:
    with pytest.raises(FirmwareError, match="each of the 1 joints needs the codes of 256 bytes"):
        on_bytes(tables_of([[10]], 1), codes)


@pytest.mark.parametrize(
    "codes", [[2 * byte for byte in range(256)], [800 - 3 * byte for byte in range(256)], [7] * 256]
)
@pytest.mark.parametrize("limits", [(0, 65535), (100, 301), (7, 7), (601, 40_000), (9000, 9001)])
def test_a_byte_is_within_its_limits_where_its_code_is(codes: list[int], limits: tuple[int, int]) -> None:
    low, high = byte_range(limits, codes)
    assert all((low <= byte <= high) == (limits[0] <= codes[byte] <= limits[1]) for byte in range(1, 256))

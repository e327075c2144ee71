import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.compiler.firmware.errors import FirmwareError
from thenar.compiler.firmware.on_bytes import BYTES, on_bytes
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.runtime.calibration import codes_of_bytes
from thenar.runtime.manifest import Calibration
from thenar.runtime.scores import Scorer
from thenar.runtime.tables import IntegerTables


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
    with pytest.raises(FirmwareError, match="256 bytes are needed for each of 1 joints"):
        on_bytes(tables_of([[10]], 1), codes)

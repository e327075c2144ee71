from collections.abc import Callable

import numpy as np
import pytest

from thenar.compiler.firmware.one_hand import for_one_hand
from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.drivers.errors import SettingError
from thenar.runtime.build import Build
from thenar.runtime.calibration import CodeTables
from thenar.runtime.manifest import Manifest
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
        assert raw.lanes(closed, list(record)) == build.lanes(closed, codes.codes(record))
    assert [(joint.code_a, joint.code_b) for joint in raw.manifest.joints] == [(1, 255)] * 3


def test_a_hand_without_one_of_the_joints_is_refused(make_tables: MakeTables, describe: Describe) -> None:
    tables = make_tables()
    with pytest.raises(SettingError, match="the calibration has no sensor 'j2'"):
        for_one_hand(Build(describe(tables), tables), hand("j0", "j1"))

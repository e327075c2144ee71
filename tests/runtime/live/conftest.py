"""Builds whose joints are coded in a CyberGlove's bytes."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from thenar.runtime import Build
from thenar.runtime.manifest import Calibration, Manifest
from thenar.runtime.tables import IntegerTables

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]
MakeBuild = Callable[..., Build]


@pytest.fixture(scope="session")
def make_build(make_tables: MakeTables, describe: Describe) -> MakeBuild:
    def make(seed: int = 0, classes: int = 4, switches: int = 6, joints: int = 3) -> Build:
        tables = make_tables(seed, classes, switches, joints)
        raw = tuple(Calibration(number, f"j{number}", "raw", 1, 1.0, 255, 255.0) for number in range(joints))
        return Build(replace(describe(tables), joints=raw), tables)

    return make

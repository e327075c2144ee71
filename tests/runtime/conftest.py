"""Integer tables of any size, and a build folder around them, without training anything."""

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from thenar.runtime.build import MANIFEST_NAME, TABLES_NAME, Build
from thenar.runtime.manifest import (
    SCHEMA,
    Calibration,
    Manifest,
    Options,
    Proof,
    Recognised,
    Source,
    Switch,
    manifest_to_bytes,
)
from thenar.runtime.tables import IntegerTables, tables_to_bytes

MakeTables = Callable[..., IntegerTables]
Describe = Callable[[IntegerTables], Manifest]


def _make_tables(seed: int = 0, classes: int = 5, switches: int = 9, joints: int = 3, bins: int = 6) -> IntegerTables:
    random = np.random.default_rng(seed)

    def rows(*shape: int) -> np.ndarray:
        return random.integers(-90, 91, shape).astype(np.int16)

    thresholds = [np.sort(random.choice(256, bins - 1, replace=False)).astype(np.uint16) for _ in range(joints)]
    return IntegerTables(
        bias=rows(classes),
        switch_rows=rows(switches, classes),
        thresholds=tuple(thresholds),
        joint_rows=tuple(rows(bins, classes) for _ in range(joints)),
        switch_means=rows(switches, classes),
        joint_means=rows(joints, classes),
        scale=100.0,
    )


def _describe(tables: IntegerTables) -> Manifest:
    data = tables_to_bytes(tables)
    return Manifest(
        schema=SCHEMA,
        checksum="",
        thenar="0.1.0",
        tables_sha256=hashlib.sha256(data).hexdigest(),
        ensemble_sha256="0" * 64,
        source=Source("1" * 64, 10, "own", 20),
        options=Options(0, 100, "both", 1.0, 4, 1),
        grasps=tuple(f"grasp {number}" for number in range(tables.n_classes)),
        switches=tuple(Switch(number, f"s{number}", 0.5) for number in range(tables.n_switches)),
        joints=tuple(Calibration(n, f"j{n}", "deg", 0, 0.0, 100, 50.0) for n in range(tables.n_joints)),
        proof=Proof(16, tables.scale, tables.bound, 6.5, 13.0, 10, 0),
        rates=(Recognised("training", 0, 1, 10, 10),),
    )


@pytest.fixture(scope="session")
def make_tables() -> MakeTables:
    return _make_tables


@pytest.fixture(scope="session")
def describe() -> Describe:
    return _describe


@pytest.fixture
def build() -> Build:
    tables = _make_tables()
    return Build(_describe(tables), tables)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    tables = _make_tables()
    (tmp_path / TABLES_NAME).write_bytes(tables_to_bytes(tables))
    (tmp_path / MANIFEST_NAME).write_bytes(manifest_to_bytes(_describe(tables)))
    return tmp_path

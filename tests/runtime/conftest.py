"""Integer tables of any size, and a build folder around them, without training anything; and results to publish."""

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from threading import Event
from time import monotonic
from types import ModuleType

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.runtime.build import MANIFEST_NAME, TABLES_NAME, Build
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.manifest import Calibration
from thenar.runtime.manifest_file import manifest_to_bytes
from thenar.runtime.model.integers import IntegerTables, tables_to_bytes
from thenar.runtime.model.terms.line import Line
from thenar.runtime.published import Count, DeviceHealth, HealthReport, JointAngles, LiveGrasp, Preshape, Quarantined
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.sources.base import sources_of
from thenar.runtime.sources.rows import RowSource

from ..conftest import lacking
from ..tables import describe

MakeBuild = Callable[..., Build]
MakeGrasp = Callable[..., LiveGrasp]


def make_tables(
    seed: int = 0, classes: int = 5, switches: int = 9, joints: int = 3, bins: int = 6, slopes: int = 0
) -> IntegerTables:
    """Return random tables of this size."""
    random = np.random.default_rng(seed)

    def rows(*shape: int) -> np.ndarray:
        return random.integers(-90, 91, shape).astype(np.int16)

    thresholds = [np.sort(random.choice(256, bins - 1, replace=False)).astype(np.uint16) for _ in range(joints)]
    return IntegerTables.of(
        bias=rows(classes),
        switch_rows=rows(switches, classes),
        thresholds=tuple(thresholds),
        joint_rows=tuple(rows(bins, classes) for _ in range(joints)),
        switch_means=rows(switches, classes),
        joint_means=rows(joints, classes),
        scale=100.0,
        further=tuple(_slope(random, joint, classes) for joint in range(min(slopes, joints))),
    )


def _slope(random: np.random.Generator, joint: int, classes: int) -> Line:
    low, gain = int(random.integers(0, 200)), int(random.integers(-2, 3))
    high = low + int(random.integers(8, 254 / 2**gain))
    return Line(joint, low, high, random.integers(-9, 10, classes).astype(np.int8), gain)


def eventually(condition: Callable[[], bool]) -> None:
    """Wait until a condition holds of which nobody is told."""
    end, never = monotonic() + 60, Event()
    while not condition():
        assert monotonic() < end
        never.wait(0.002)


def row_source(glove: str) -> RowSource:
    """Return the one source of a glove with one stream, for all switches and taxels."""
    harness = parse_harness(glove, "glove.toml")
    scan = whole_scan(harness, harness.switches, every_taxel=True)
    (source,) = sources_of(harness, harness.switches, scan)
    assert isinstance(source, RowSource)
    return source


@pytest.fixture
def build() -> Build:
    tables = make_tables()
    return Build(describe(tables), tables)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    tables = make_tables()
    (tmp_path / TABLES_NAME).write_bytes(tables_to_bytes(tables))
    (tmp_path / MANIFEST_NAME).write_bytes(manifest_to_bytes(describe(tables)))
    return tmp_path


@pytest.fixture(scope="session")
def make_build() -> MakeBuild:
    """Return what makes builds whose joints are coded in a CyberGlove's bytes."""

    def make(seed: int = 0, classes: int = 4, switches: int = 6, joints: int = 3) -> Build:
        tables = make_tables(seed, classes, switches, joints)
        raw = tuple(Calibration(number, f"j{number}", "raw", 1, 1.0, 255, 255.0) for number in range(joints))
        return Build(replace(describe(tables), joints=raw), tables)

    return make


@pytest.fixture(scope="session")
def make_grasp() -> MakeGrasp:
    def make(number: int = 0, grasp: str = "PoS", lost: tuple[str, ...] = ()) -> LiveGrasp:
        time_us = 10_000 * number
        return LiveGrasp(
            time_us=time_us,
            unix_us=1_700_000_000_123_456 + time_us,
            number=number,
            grasp=grasp,
            candidate=grasp,
            probability=0.9375,
            margin=120,
            health="ok",
            switch_age_us=900,
            glove_age_us=None,
            latency_us=310,
            lost=lost,
        )

    return make


@pytest.fixture(scope="session")
def ros() -> ModuleType:
    """Return the messages of ROS, if Cyclone DDS is installed."""
    if find_spec("cyclonedds") is None:
        lacking("cyclonedds")
    return import_module("thenar.runtime.ros_dds")


@pytest.fixture(scope="session")
def preshape() -> Preshape:
    return Preshape("cylindrical", ("finger_1/prox_joint", "finger_1/med_joint"), (0.0, 0.5), 1.25)


@pytest.fixture(scope="session")
def angles() -> JointAngles:
    return JointAngles(("index_mpj", "index_pij", "thumb_ab"), (0.1, -0.2, 1 / 3))


@pytest.fixture(scope="session")
def health() -> HealthReport:
    glove = DeviceHealth("cyberglove", True, "", (Count("resyncs", 2),))
    wrong = Quarantined("s001", "stuck open"), Quarantined("s002", "chattering", used=True)
    return HealthReport(7, 100.0, 99.5, 600, 25, 10, 1, 0, (glove,), wrong)

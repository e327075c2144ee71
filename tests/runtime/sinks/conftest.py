"""Results to publish: those of a run, one a frame."""

import os
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

import pytest

from thenar.runtime.live.health import Count, DeviceHealth, Drift, HealthReport
from thenar.runtime.live.published import LiveGrasp
from thenar.runtime.preshape import Preshape
from thenar.runtime.sinks import JointAngles

MakeGrasp = Callable[..., LiveGrasp]


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
        (pytest.fail if os.environ.get("THENAR_REQUIRE_ALL") == "1" else pytest.skip)("cyclonedds is missing")
    return import_module("thenar.runtime.sinks.ros_messages")


@pytest.fixture(scope="session")
def preshape() -> Preshape:
    return Preshape("cylindrical", ("finger_1/prox_joint", "finger_1/med_joint"), (0.0, 0.5), 1.25)


@pytest.fixture(scope="session")
def angles() -> JointAngles:
    return JointAngles(("index_mpj", "index_pij", "thumb_ab"), (0.1, -0.2, 1 / 3))


@pytest.fixture(scope="session")
def health() -> HealthReport:
    glove = DeviceHealth("cyberglove", True, "", (Count("resyncs", 2),))
    return HealthReport(
        7, ("s001",), (), ("s002",), (Drift("index_mpj", -3),), 100.0, 99.5, 600, 25, 10, 1, 0, (glove,)
    )

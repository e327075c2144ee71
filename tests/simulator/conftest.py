"""What tests of the pipeline as a whole take as fixtures."""

from collections.abc import Callable

import pytest

from thenar.simulator.body.condition import Condition
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.scenes.scene import Scene

from . import small


@pytest.fixture(scope="session")
def make_condition() -> Callable[..., Condition]:
    return small.make_condition


@pytest.fixture(scope="session")
def make_batch() -> Callable[..., Batch]:
    return small.make_batch


@pytest.fixture(scope="session")
def make_scene() -> Callable[..., Scene]:
    return small.make_scene

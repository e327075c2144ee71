"""What several tests need: where the real recordings and Weka's answers are, and what a missing one means."""

import os
import shutil
from pathlib import Path

import pytest

REQUIRE_ALL = os.environ.get("THENAR_REQUIRE_ALL") == "1"
SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def need(path: Path) -> Path:
    """Return `path`; if it is not there, fail under THENAR_REQUIRE_ALL=1 and skip by name elsewhere."""
    if not path.exists():
        (pytest.fail if REQUIRE_ALL else pytest.skip)(f"data set {path.name} is missing")
    return path


def need_tool(name: str) -> str:
    """Return the path of program `name`; if it is not installed, fail under THENAR_REQUIRE_ALL=1 and skip elsewhere."""
    found = shutil.which(name)
    if found is None:
        (pytest.fail if REQUIRE_ALL else pytest.skip)(f"program {name} is missing")
        raise AssertionError
    return found


@pytest.fixture(scope="session")
def weka_data() -> Path:
    return need(SHARED_DATA / "weka")


@pytest.fixture(scope="session")
def icub_table() -> Path:
    return need(SHARED_DATA / "icub_tactile_encoders" / "trials.csv.gz")


@pytest.fixture(scope="session")
def aml_table() -> Path:
    return need(SHARED_DATA / "aml_flex6_grasptypes" / "trials.csv.gz")

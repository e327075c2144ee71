"""The made-up frontier, for all that shows one."""

import importlib.util
import sys
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="session")
def examples() -> Any:
    """Return the module with example_frontier, which tests of other folders load too."""
    spec = importlib.util.spec_from_file_location("example_frontier", Path(__file__).with_name("example_frontier.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module

"""A pytest plugin for mutants, of which only the verdict matters: quick tests first, and failures are not simplified.

Examples are the same every time, and nothing is remembered from one mutant to the next.
"""

import json
from pathlib import Path

import pytest
from hypothesis import Phase, settings
from joblib.externals.loky import get_reusable_executor

STATISTICS = Path("mutmut-stats.json")  # written by mutmut once all tests have run without a mutant

settings.register_profile(
    "mutants", derandomize=True, deadline=None, database=None, phases=(Phase.explicit, Phase.generate)
)
settings.load_profile("mutants")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort tests by how long they took; those that are not known yet come last."""
    if STATISTICS.exists():
        seconds = json.loads(STATISTICS.read_text())["duration_by_test"]
        items.sort(key=lambda item: seconds.get(item.nodeid, float("inf")))


def pytest_sessionfinish() -> None:
    """End the worker processes that tests leave idle: mutmut, which waits for any child, takes one for a mutant."""
    get_reusable_executor(max_workers=1).shutdown(wait=True, kill_workers=True)

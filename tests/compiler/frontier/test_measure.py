"""What is measured of tables: simulated once, and kept in the store."""

from pathlib import Path

import pytest

from thenar.compiler.frontier.cache import Cache, Store
from thenar.compiler.frontier.price import ClassifyModel, measured, random_tables
from thenar.runtime.model.integers import tables_to_bytes

from ...conftest import tool

TABLES = random_tables(6, 0, 4)
CONTENT = tables_to_bytes(TABLES)


@pytest.mark.slow
def test_on_a_host_the_runtime_is_timed_once(tmp_path: Path) -> None:
    model = ClassifyModel("host", python=(5.0, 0.1, 0.5, 0.1, 0.01, 0.01, 10.0))
    with Store(tmp_path / "store", "here") as store:
        cache = Cache(store, lambda *_: None, jobs=1)
        timed = measured([CONTENT, CONTENT], model, cache)
        known = len(store)
        assert measured([CONTENT], model, cache) == timed
        assert len(store) == known == 1
    assert timed[CONTENT].how == "measured"
    assert 0 < timed[CONTENT].us < 100_000


@pytest.mark.slow
def test_on_an_avr_the_time_is_what_was_simulated(tmp_path: Path) -> None:
    tool("avr-gcc")
    model = ClassifyModel("avr328p")
    assert not model.unmeasured
    with Store(tmp_path / "store", "here") as store:
        found = measured([CONTENT], model, Cache(store, lambda *_: None, jobs=1))[CONTENT]
    predicted = model.cost(TABLES)
    assert predicted is not None
    assert found.how == "simulated"
    assert found.us == pytest.approx(predicted.us, rel=0.1)


def test_what_cannot_be_measured_here_has_no_time(tmp_path: Path) -> None:
    model = ClassifyModel("pi", python=(5.0, 0.1, 0.5, 0.1, 0.01, 0.01, 10.0))
    with Store(tmp_path / "store", "here") as store:
        assert measured([CONTENT], model, Cache(store, lambda *_: None, jobs=1)) == {}

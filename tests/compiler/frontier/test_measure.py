"""What is measured of designs: simulated once, and kept in the store."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.cluster import dask_cluster
from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.frontier.cache import Cache, Store
from thenar.compiler.frontier.designs import Design
from thenar.compiler.frontier.equipment import Equipment
from thenar.compiler.frontier.finalists import EvaluatedFinalist
from thenar.compiler.frontier.measure import measured, unmeasured
from thenar.compiler.frontier.points import PlacementChoice, PointTime
from thenar.compiler.frontier.price import PricedTables, Tabled, Wired
from thenar.compiler.frontier.screen import Screened
from thenar.compiler.frontier.search import Candidate, Shape
from thenar.compiler.frontier.survey import TrialAccuracy
from thenar.compiler.frontier.timing.classify_times import ClassifyModel
from thenar.compiler.frontier.timing.python_times import PythonCost, random_tables
from thenar.compiler.frontier.timing.scan_times import WIRE_ONLY, ScanTimes
from thenar.compiler.placement.elements import Element
from thenar.runtime.tables import tables_to_bytes

PYTHON = PythonCost(5.0, 0.1, 0.5, 0.1, 0.01, 0.01, 10.0)


def design_of(model: ClassifyModel) -> Design:
    tables = random_tables(6, 0, 4)
    scan = ScanTimes(500.0, 4, 2, "wire")
    wired = Wired("mcp23017", 400_000, scan)
    priced = PricedTables(Tabled(1, Shape(16)), tables_to_bytes(tables), model.cost(tables), (wired,), 1.0)
    judged = TrialAccuracy(Rate.counted((9,), 10, of="pooled"), np.arange(10), 1)
    screened = Screened(Candidate(PlacementChoice("id3", 6.0), "switches"), tuple(map(Element, range(6))), judged, 1.0)
    close = EvaluatedFinalist(screened, {}, {}, {}, {}, (priced,), 1.0)
    assert priced.classified is not None
    return Design(close, priced, priced.classified, wired, PointTime(0.0, "wire"))


@pytest.mark.slow
def test_on_a_host_the_runtime_is_timed_once(tmp_path: Path) -> None:
    model = ClassifyModel("host", python=PYTHON)
    design, equipment = design_of(model), Equipment(model, (), WIRE_ONLY)
    with Store(tmp_path / "store", "here") as store, dask_cluster("nowhere:1"):
        cache = Cache(store, lambda *_: None, jobs=1)
        (timed,), skipped = measured([design], equipment, cache)
        known = len(store)
        (again,), _ = measured([design], equipment, cache)
        assert len(store) == known == 1
    assert again.classify == timed.classify
    assert timed.classify.how == "measured"
    assert 0 < timed.classify.us < 100_000
    assert WIRE_ONLY.what in skipped


@pytest.mark.slow
def test_on_an_avr_the_time_is_what_was_simulated(tmp_path: Path, tool: Callable[[str], str]) -> None:
    tool("avr-gcc")
    model = ClassifyModel("avr328p")
    assert unmeasured(model) is None
    design = design_of(model)
    with Store(tmp_path / "store", "here") as store:
        cache = Cache(store, lambda *_: None, jobs=1)
        (found,), _ = measured([design], Equipment(model, (), WIRE_ONLY), cache)
    assert found.measured is not None
    assert found.measured.how == found.classify.how == "simulated"
    assert found.classify.us == found.measured.us
    assert found.measured.us == pytest.approx(design.classified.us, rel=0.1)

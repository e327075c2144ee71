"""What is measured of designs: simulated once, with the model held beside it, and kept in the store."""

from collections.abc import Callable
from pathlib import Path

import pytest

from thenar.compiler.frontier.candidates import Choice, Screened
from thenar.compiler.frontier.closeup import Close
from thenar.compiler.frontier.designs import Design
from thenar.compiler.frontier.equipment import Equipment
from thenar.compiler.frontier.measured import measure_designs
from thenar.compiler.frontier.points import Rate, Way
from thenar.compiler.frontier.pricing import Priced, PricedTables, Tabled, Wired
from thenar.compiler.frontier.settings import Shape
from thenar.compiler.frontier.storing.asking import Desk
from thenar.compiler.frontier.storing.resuming import Effort
from thenar.compiler.frontier.storing.store import Store
from thenar.compiler.frontier.timing.beside_wire import WIRE_ONLY
from thenar.compiler.frontier.timing.checks import unchecked
from thenar.compiler.frontier.timing.classify_times import ClassifyModel
from thenar.compiler.frontier.timing.python_times import PythonCost, random_tables
from thenar.compiler.frontier.timing.scan_times import ScanTimes
from thenar.runtime.tables import tables_to_bytes

PYTHON = PythonCost(5.0, 0.1, 0.5, 0.1, 0.01, 0.01, 10.0)


def design_of(model: ClassifyModel) -> Design:
    tables = random_tables(6, 0, 4)
    scan = ScanTimes(500.0, 200.0, 4, 2, "wire", 1.5)
    wired = Wired("mcp23017", 400_000, scan)
    priced = PricedTables(Tabled(1, Shape(16)), tables_to_bytes(tables), model.options(tables), (wired,), 1.0)
    screened = Screened(Choice(Way("id3", 6.0), "switches"), tuple(range(6)), Rate(0.9, 0.9, 0.9), 1.0)
    close = Close(screened, {}, {}, None, Priced((priced,)), 1.0)
    return Design(close, priced, priced.classified[0], wired, "early", 0)


@pytest.mark.slow
def test_on_a_host_the_runtime_is_timed_and_the_model_checked_once(tmp_path: Path) -> None:
    model = ClassifyModel("host", python=PYTHON)
    design, told = design_of(model), list[int]()
    with Store(tmp_path / "store", "here") as store:
        desk = Desk(store, Effort(lambda done, _: told.append(done)), jobs=1, cluster="nowhere:1")
        first = measure_designs(Equipment(model, (), WIRE_ONLY), [design], desk)
        known = len(store)
        second = measure_designs(Equipment(model, (), WIRE_ONLY), [design], desk)
        assert len(store) == known == 2
    assert first.checks[0] == second.checks[0]
    assert (first.checks[0].how, first.checks[0].n > 1) == ("measured", True)
    timed = first.classify(design)
    assert timed == second.classify(design)
    assert timed.how == "measured"
    assert 0 < timed.us < 100_000
    assert WIRE_ONLY.what in first.skipped


@pytest.mark.slow
def test_on_an_avr_every_look_takes_what_was_simulated(tmp_path: Path, tool: Callable[[str], str]) -> None:
    tool("avr-gcc")
    model = ClassifyModel("avr328p")
    assert unchecked(model) is None
    design = design_of(model)
    with Store(tmp_path / "store", "here") as store:
        measured = measure_designs(Equipment(model, (), WIRE_ONLY), [design], Desk(store, Effort(lambda *_: None), 1))
    (simulated,) = measured.times.values()
    assert simulated.how == measured.classify(design).how == "simulated"
    assert measured.classify(design).us == pytest.approx(1.5 * simulated.us)
    assert simulated.us == pytest.approx(design.classified.us, rel=0.1)
    assert len(measured.checks) >= 2

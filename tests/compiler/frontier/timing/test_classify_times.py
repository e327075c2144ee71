"""The model of classify times, and layouts that are compiled and simulated beside it."""

import pytest

from thenar.compiler.firmware.costs import fit_for
from thenar.compiler.firmware.targets import TARGETS, timed
from thenar.compiler.frontier.points import FrontierError
from thenar.compiler.frontier.price import ClassifyModel, classify_us, count_steps, fit_here, fitting, random_tables
from thenar.compiler.workers import in_workers
from thenar.runtime.model.integers import tables_to_bytes

from ....conftest import tool

PYTHON = (1.0, 0.1, 0.2, 0.3, 0.01, 0.02, 10.0)
TABLES = random_tables(33, 16, 14)


def test_tables_that_do_not_fit_have_no_cost() -> None:
    assert ClassifyModel("avr328p").cost(random_tables(160, 22, 60)) is None


@pytest.mark.parametrize(("target", "mhz"), [("cortex-m0plus", 48), ("cortex-m4", 64)])
def test_instructions_take_a_cycle_each_at_a_clock_that_is_said(target: str, mhz: int) -> None:
    model, cost = ClassifyModel(target), fit_for(TARGETS[target], TABLES).cost
    assert cost is not None
    assert _us(model) == pytest.approx(cost.cycles / mhz)
    assert f"at {mhz} MHz" in model.note
    assert "lower bound" in model.note


def test_host_times_are_a_line_fitted_to_the_runtime() -> None:
    found, size = ClassifyModel("host", python=PYTHON).cost(TABLES), len(tables_to_bytes(TABLES))
    assert found is not None
    assert (found.flash, found.ram) == (size, size)
    assert found.us == pytest.approx(1 + 3.3 + 3.2 + 4.2 + 0.01 * 33 * 14 + 0.02 * 16 * 14)


def test_a_raspberry_pis_time_is_a_scaled_and_declared_guess() -> None:
    here, there = ClassifyModel("host", python=PYTHON), ClassifyModel("pi", python=PYTHON)
    assert _us(there) == pytest.approx(4 * _us(here))
    assert "guess" in there.note
    assert "unusual frames" in here.note


def test_models_go_to_other_processes() -> None:
    models = [ClassifyModel(target, python=PYTHON) for target in timed()]
    found = dict(in_workers(_cost, enumerate(models), 2))
    assert [found[number] for number in range(len(models))] == [model.cost(TABLES) for model in models]


def _cost(task: tuple[int, ClassifyModel]) -> tuple[int, object]:
    return task[0], task[1].cost(TABLES)


def _us(model: ClassifyModel) -> float:
    found = model.cost(TABLES)
    assert found is not None
    return found.us


def test_there_is_no_other_target() -> None:
    with pytest.raises(FrontierError, match="no target 'arduino'"):
        ClassifyModel("arduino")


def test_what_is_fitted_here_foretells_other_shapes() -> None:
    """Within a factor of two: who else is on the machine is not known."""
    *weights, yardstick = fitted = fit_here()
    model = ClassifyModel("host", python=fitted)
    others = [random_tables(*shape) for shape in ((24, 16, 10), (50, 0, 20), (100, 22, 14))]
    for tables, taken in zip(others, classify_us(others, yardstick), strict=True):
        found = model.cost(tables)
        assert found is not None
        assert 0.5 < found.us / taken < 2.0
    assert min(weights) >= 0


@pytest.fixture
def simavr() -> None:
    for name in ("avr-gcc", "make"):
        tool(name)
    if TARGETS["avr328p"].missing() is not None:
        tool("libsimavr-dev")


@pytest.mark.usefixtures("simavr")
def test_cycles_of_an_avr_are_foretold_within_ten_percent() -> None:
    part = TARGETS["avr328p"]
    for tables in (random_tables(20, 0, 14), random_tables(8, 0, 5)):
        fit = fitting(tables, part)
        assert fit is not None
        assert fit.cost is not None
        assert fit.cost.cycles == pytest.approx(count_steps(tables_to_bytes(tables), ClassifyModel("avr328p")), rel=0.1)


def test_a_raspberry_pi_is_not_timed_elsewhere() -> None:
    assert "no Raspberry Pi" in ClassifyModel("pi", python=PYTHON).unmeasured
    assert not ClassifyModel("host", python=PYTHON).unmeasured

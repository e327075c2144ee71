"""Measure the points' times: simulate or time designs on a front, and validate the model against the results."""

from collections.abc import Sequence
from dataclasses import replace

from thenar.runtime.tables import tables_from_bytes

from .cache import Cache, stored
from .designs import Design
from .equipment import Equipment
from .points import Check, Time
from .timing.checks import LEAST, check, unchecked
from .timing.classify_times import ClassifyModel, fitting
from .timing.python_times import classify_us
from .timing.simulated import run_layout
from .timing.wire_check import check_wire

# Expected seconds: of a trial, of timing all designs in Python, of the model's validation.
TRIAL_S, _TIMES_S, _CHECK_S = 2.0, 1.0, 5.0


@stored(1, where="machine")
def count_steps(content: bytes, model: ClassifyModel) -> float:
    """Compile the classifier of tables and run it; return the cycles of the slowest frame.

    Raises FirmwareError.
    """
    assert model.part is not None
    fit = fitting(tables_from_bytes(content), model.part)
    assert fit is not None
    return run_layout(fit).counted


@stored(1, where="process")
def time_here(contents: tuple[bytes, ...], yardstick: float) -> tuple[float, ...]:
    """Time the runtime on each of the tables, scaled by its yardstick; return microseconds."""
    return tuple(classify_us([tables_from_bytes(content) for content in contents], yardstick))


@stored(1, where="process", without=("jobs",))
def run_checks(contents: tuple[bytes, ...], model: ClassifyModel, jobs: int) -> tuple[Check, ...]:
    """Validate a model against measurements of these tables, in `jobs` processes. Raises FirmwareError."""
    return check(model, [tables_from_bytes(content) for content in contents], jobs=jobs)


def measured(
    designs: Sequence[Design], equipment: Equipment, cache: Cache
) -> tuple[list[Design], tuple[Check, ...], tuple[str, ...]]:
    """Return the designs with their times, the model's errors on these and more, and sentences on missing measurements.

    Simulators run on this machine even with a cluster, whose workers may have none.
    """
    model, lack = equipment.model, unchecked(equipment.model)
    found, checks = list(designs), tuple[Check, ...]()
    if not lack:
        found = _simulated(designs, model, cache) if model.part else _timed(designs, model, cache)
        cost = LEAST * TRIAL_S if model.part else _CHECK_S
        (checks,) = cache.ask("checks", [run_checks.call(cost, _contents(designs), model, cache.jobs)])
    wire, without = check_wire()
    said = (lack, model.note, equipment.overhead.what, equipment.records.what, without)
    return found, (*checks, *wire), tuple(sentence for sentence in said if sentence)


def _contents(designs: Sequence[Design]) -> tuple[bytes, ...]:
    return tuple(dict.fromkeys(design.tables.content for design in designs))


def _timed(designs: Sequence[Design], model: ClassifyModel, cache: Cache) -> list[Design]:
    contents = _contents(designs)
    assert model.python is not None
    (us,) = cache.ask("simulations", [time_here.call(_TIMES_S, contents, model.python.yardstick)])
    times = dict(zip(contents, us, strict=True))
    return [replace(design, measured=Time(times[design.tables.content], "measured")) for design in designs]


def _simulated(designs: Sequence[Design], model: ClassifyModel, cache: Cache) -> list[Design]:
    calls = [count_steps.call(TRIAL_S, design.tables.content, model) for design in designs]
    steps = cache.ask("simulations", calls)
    return [
        replace(design, measured=Time(model.us(round(each)), "simulated"))
        for design, each in zip(designs, steps, strict=True)
    ]

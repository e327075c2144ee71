"""Measure the points' times: simulate or time designs on a front."""

from collections.abc import Sequence
from dataclasses import replace

from thenar.runtime.tables import tables_from_bytes

from ..firmware.choose import Fit
from ..firmware.classifier import LIBRARY_NAME, Library
from ..firmware.measuring import run_counted, slow_frames
from ..firmware.words import numbered
from .cache import Cache, stored
from .designs import Design
from .equipment import Equipment
from .points import PointTime
from .timing.classify_times import ClassifyModel, fitting
from .timing.python_times import classify_us


@stored(2, where="machine")
def count_steps(content: bytes, model: ClassifyModel) -> float:
    """Compile the classifier of tables and run it; return the cycles of the slowest frame.

    Raises FirmwareError.
    """
    assert model.part is not None
    fit = fitting(tables_from_bytes(content), model.part)
    assert fit is not None
    return steps_of(fit)


def steps_of(fit: Fit) -> float:
    """Compile a classifier for its part and run it; return the cycles of the slowest of the frames that should take
    longest and of extreme ones. Raises FirmwareError.
    """
    library = Library(LIBRARY_NAME, numbered(fit.layout.tables), fit.layout)
    return float(run_counted(library, fit.target, slow_frames(library)).most)


@stored(1, where="process")
def time_here(contents: tuple[bytes, ...], yardstick: float) -> tuple[float, ...]:
    """Time the runtime on each of the tables, scaled by its yardstick; return microseconds."""
    return tuple(classify_us([tables_from_bytes(content) for content in contents], yardstick))


def measured(designs: Sequence[Design], equipment: Equipment, cache: Cache) -> tuple[list[Design], tuple[str, ...]]:
    """Return the designs with their times, and sentences on missing measurements.

    Simulators run on this machine even with a cluster, whose workers may have none.
    """
    model, lack = equipment.model, unmeasured(equipment.model)
    if lack:
        found = list(designs)
    else:
        found = _simulated(designs, model, cache) if model.part else _timed(designs, model, cache)
    said = (lack, model.note, equipment.overhead.what, equipment.records.what)
    return found, tuple(sentence for sentence in said if sentence)


def unmeasured(model: ClassifyModel) -> str | None:
    """Return, in a sentence, why the classify times are the model's here; None if they are measured."""
    if model.part is None:
        other = "classify times on pi were not measured: this machine is no Raspberry Pi"
        return other if model.guessed else None
    if lack := model.part.missing():
        return f"classify times on {model.target} were not counted in a simulator: {lack}"
    return None


def _contents(designs: Sequence[Design]) -> tuple[bytes, ...]:
    return tuple(dict.fromkeys(design.tables.content for design in designs))


def _timed(designs: Sequence[Design], model: ClassifyModel, cache: Cache) -> list[Design]:
    contents = _contents(designs)
    assert model.python is not None
    (us,) = cache.ask(time_here, [(contents, model.python.yardstick)])
    times = dict(zip(contents, us, strict=True))
    return [replace(design, measured=PointTime(times[design.tables.content], "measured")) for design in designs]


def _simulated(designs: Sequence[Design], model: ClassifyModel, cache: Cache) -> list[Design]:
    calls = [(design.tables.content, model) for design in designs]
    steps = cache.ask(count_steps, calls)
    return [
        replace(design, measured=PointTime(model.us(round(each)), "simulated"))
        for design, each in zip(designs, steps, strict=True)
    ]

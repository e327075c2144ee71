"""Predict the time of classifying a frame on a target, without compiling."""

from dataclasses import dataclass

from thenar.runtime.model.integers import IntegerTables, tables_to_bytes

from ...firmware import FirmwareError
from ...firmware.choose import Fit, fit_for
from ...firmware.targets import TARGETS, Target, timed
from ..points import FrontierError, How
from .machine import machine_name, on_a_pi
from .python_times import PythonCost, fit_here

# Python's time on a Raspberry Pi 4 relative to here: a guess, and "here" is any machine.
PI_FACTOR = 4.0


@dataclass(frozen=True, slots=True)
class Classified:
    """The costs of tables: microseconds a frame, bytes of flash and RAM; of the tables alone on host and pi."""

    us: float
    how: How
    flash: int
    ram: int


class ClassifyModel:
    """Predicts the time of classifying on `target`, one of `timed()`.

    AVR       cycles of classify() for the slowest frame, by the target's formula, at `clock_hz`
    Cortex-M  instructions of classify(), likewise, at `clock_hz` and one cycle each: hardly any such core is faster,
              and loads, taken branches and slow flash take more cycles, so times are lower bounds
    host      wall time of the runtime's Scorer here, by a linear fit to tables that are timed on construction
    pi        that times `factor`; the same time if this machine is a Raspberry Pi

    python is the result of `fit_here`, for reuse; clock_hz replaces the part's default clock; factor is ignored except
    on pi. Raises FrontierError for another target.
    """

    def __init__(
        self, target: str, *, clock_hz: int | None = None, python: PythonCost | None = None, factor: float = PI_FACTOR
    ) -> None:
        if target not in timed():
            raise FrontierError(f"there is no target {target!r}: choose one of {', '.join(timed())}")
        part = TARGETS.get(target)
        self.target = target
        self.part: Target | None = None if part is None or part.clock_hz is None else part
        self.clock_hz = None if self.part is None else clock_hz or self.part.clock_hz
        self.python = (python or fit_here()) if self.part is None else None
        self.factor = factor if target == "pi" and not on_a_pi() else 1.0

    @property
    def identity(self) -> tuple[object, ...]:
        """Everything that its predictions depend on, in addition to the tables."""
        return self.target, self.clock_hz, self.python, self.factor

    def cost(self, tables: IntegerTables) -> Classified | None:
        """Return the cost of tables; None where they do not fit."""
        if self.part is None:
            assert self.python is not None
            size = len(tables_to_bytes(tables))
            how: How = "guess" if self.guessed else "model"
            return Classified(self.python.us(tables) * self.factor, how, size, size)
        fit = fitting(tables, self.part)
        if fit is None or fit.cost is None:
            return None
        return Classified(self.us(fit.cost.cycles), "model", fit.cost.flash, fit.cost.ram)

    def us(self, steps: int) -> float:
        """Return the microseconds of `steps` cycles or instructions of the part."""
        assert self.clock_hz is not None
        return steps * 1e6 / self.clock_hz

    @property
    def guessed(self) -> bool:
        """Whether its times are guesses: of a Raspberry Pi, on another machine."""
        return self.factor != 1.0

    @property
    def machine(self) -> str:
        """The machine that its times are of."""
        if self.part is not None and self.clock_hz is not None:
            return f"{self.part.named} at {self.clock_hz / 1e6:g} MHz"
        guess = f"Raspberry Pi, a guess: {self.factor:g} times "
        return f"{guess if self.guessed else ''}{machine_name()}"

    @property
    def note(self) -> str:
        """The caveat on its times, in a sentence; "" if there is none."""
        if self.part is not None and not self.part.avr and self.clock_hz is not None:
            return (
                f"on {self.target} times are instructions, estimated, at {self.clock_hz / 1e6:g} MHz and one "
                "cycle each: a lower bound, for many instructions take more cycles"
            )
        if self.python is not None and not self.guessed:
            return "times of classifying in Python leave out the check for unusual frames, which most builds make"
        if self.guessed:
            return (
                f"Python on a Raspberry Pi is taken to be {self.factor:g} times as slow as on this machine, which is a "
                "guess: run thenar frontier --target pi on the Pi itself"
            )
        return ""


def fitting(tables: IntegerTables, part: Target) -> Fit | None:
    """Return the fit of `tables` on a part, with its cost; None where they do not fit."""
    try:
        return fit_for(part, tables)
    except FirmwareError:
        return None

"""Placements with the inputs they are read with: what is screened, and which of them are looked at closely."""

from collections.abc import Sequence
from dataclasses import dataclass

from ...runtime.manifest import Inputs
from ..evaluation.rates import Rate as Counted
from ..selection.learning import Columns
from .pareto import front, shortfalls
from .points import Rate, Way

# The placement of inputs without switches.
NO_SWITCHES = Way("none", 0.0)
# Placements that recognise so much less than the best that takes no more time are out.
_FAR = 0.02


@dataclass(frozen=True, slots=True)
class Choice:
    """A way to choose switches, and whether the joints are read besides; inputs "joints" have NO_SWITCHES."""

    way: Way
    inputs: Inputs

    @property
    def joints(self) -> bool:
        """Whether the joints are read."""
        return self.inputs != "switches"


@dataclass(frozen=True, slots=True)
class Screened:
    """A choice after screening: its switches when chosen from all rows, its rate, its frame time (us)."""

    choice: Choice
    columns: Columns
    rate: Rate
    frame_us: float


def rate_of(correct: tuple[int, ...], total: int) -> Rate:
    """Return the rate of so many rows of `total` recognised in each repeat, with its 95 % interval."""
    counted = Counted.of(correct, total)
    return Rate(counted.mean, counted.low, counted.high)


def finalists(screened: Sequence[Screened], wanted: Sequence[Choice], most: int) -> tuple[Screened, ...]:
    """Return at most `most` of `screened`, in their order: those on a front of rate against frame time or number of
    switches, then those nearest to it; `wanted` ones come on top. Choices of the same inputs and switches count once.
    """
    different = _different(screened)
    by_time = shortfalls(different, lambda one: one.frame_us, lambda one: one.rate.mean)
    by_switches = _by_switches(different)
    best = {id(one) for one in _fronts(different)}
    order = sorted(
        range(len(different)),
        key=lambda i: (id(different[i]) not in best, min(by_time[i], by_switches[i]), different[i].frame_us),
    )
    chosen = {id(different[i]) for i in order[:most] if min(by_time[i], by_switches[i]) <= _FAR}
    chosen |= {id(one) for one in screened if one.choice in wanted}
    return tuple(one for one in screened if id(one) in chosen)


def _fronts(screened: Sequence[Screened]) -> list[Screened]:
    step = 0.003
    by_time = front(screened, lambda one: one.frame_us, lambda one: one.rate.mean, step)
    return by_time + front(screened, lambda one: len(one.columns), lambda one: one.rate.mean, step)


def _by_switches(screened: Sequence[Screened]) -> list[float]:
    """Return shortfalls against the number of switches, among choices of the same inputs."""
    found = [0.0] * len(screened)
    for inputs in {one.choice.inputs for one in screened}:
        mine = [number for number, one in enumerate(screened) if one.choice.inputs == inputs]
        part = shortfalls([screened[i] for i in mine], lambda one: len(one.columns), lambda one: one.rate.mean)
        for number, shortfall in zip(mine, part, strict=True):
            found[number] = shortfall
    return found


def _different(screened: Sequence[Screened]) -> list[Screened]:
    return list({(one.choice.inputs, frozenset(one.columns)): one for one in reversed(screened)}.values())[::-1]

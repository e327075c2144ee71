"""Placements with the inputs they are read with: what is screened, and which of them are looked at closely."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from math import log

from thenar.runtime.manifest import Inputs

from ..evaluation.rates import Rate as Counted
from ..samples import Columns
from .pareto import front
from .points import Rate, Way

# The placement of inputs without switches.
NO_SWITCHES = Way("none", 0.0)
# Of what the best recognises; the least gain that counts on a front of rates that were screened; what is level.
_USEFUL, _STEP, _LEVEL = 0.75, 0.003, 0.005
# The share of errors below which fewer no longer count: a screening of some hundred rows cannot tell.
_FEWEST = 0.002


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
    """Return at most `most` of `screened`, in their order; `wanted` ones come on top.

    They are on a front of rate against frame time or, among the same inputs, against the number of switches, and are
    shared out evenly among the kinds of inputs. Of a kind first the best, then the smallest that is level with it, then
    always the one whose share of errors and frame time are least like those of any chosen. Choices of the same inputs
    and switches count once; those that recognise less than three quarters of what the best does are of no use.
    """
    enough = _USEFUL * max((one.rate.mean for one in screened), default=0.0)
    useful = [one for one in _different(screened) if one.rate.mean >= enough]
    pool = _fronts(useful)
    queues = [_spread([one for one in pool if one.choice.inputs == kind]) for kind in _kinds(pool)]
    turns = [one for turn in zip_longest(*queues) for one in turn if one is not None]
    chosen = {id(one) for one in turns[:most]} | {id(one) for one in screened if one.choice in wanted}
    return tuple(one for one in screened if id(one) in chosen)


def _kinds(screened: Sequence[Screened]) -> list[Inputs]:
    return list(dict.fromkeys(one.choice.inputs for one in screened))


def _fronts(screened: Sequence[Screened]) -> list[Screened]:
    """Return what is on a front, in its order."""
    found = front(screened, lambda one: one.frame_us, lambda one: one.rate.mean, _STEP)
    for kind in _kinds(screened):
        mine = [one for one in screened if one.choice.inputs == kind]
        found += front(mine, lambda one: len(one.columns), lambda one: one.rate.mean, _STEP)
    known = {id(one) for one in found}
    return [one for one in screened if id(one) in known]


def _spread(mine: list[Screened]) -> list[Screened]:
    """Return all of `mine` in the order in which they are worth a closer look."""
    if not mine:
        return []
    best = max(mine, key=lambda one: one.rate.mean)
    level = [one for one in mine if one.rate.mean >= best.rate.mean - _LEVEL]
    order = list(dict.fromkeys([best, min(level, key=lambda one: len(one.columns))]))
    left = [one for one in mine if one not in order]
    while left:
        order.append(max(left, key=lambda one: min(_unlike(one, known) for known in order)))
        left.remove(order[-1])
    return order


def _unlike(one: Screened, other: Screened) -> float:
    return abs(_errors(one) - _errors(other)) + abs(log(one.frame_us / other.frame_us))


def _errors(one: Screened) -> float:
    """Return how many errors are made, on a scale on which halving them counts the same everywhere."""
    return log(1.0 - one.rate.mean + _FEWEST)


def _different(screened: Sequence[Screened]) -> list[Screened]:
    return list({(one.choice.inputs, frozenset(one.columns)): one for one in reversed(screened)}.values())[::-1]

"""A standard placement: one for many subjects, those it serves worst included, and how many subjects it takes.

Placements are learnt from some subjects and recognise others, who are never learnt from. Two aims are tried: rows of
all subjects alike, and rows of the worst-served tenth counted several times. Who these are is found among the subjects
that are learnt from: half of them recognise the other half. Which aim is better is decided among them as well, on a
fifth that is kept aside, by the mean and the worst tenth in equal parts.
"""

from collections.abc import Callable
from dataclasses import dataclass

import msgspec
import numpy as np

from ..placement.errors import PlacementError
from ..workers import in_workers
from .learning import Columns
from .serving import WORST_SHARE, Aim, Crowd, Numbers, Served, rates, served

AIMS: tuple[Aim, ...] = ("mean", "worst tenth")

_LEAST_SUBJECTS = 8
_HELD_OUT = 0.2
_SIZES = (2, 5, 10, 20, 40, 80, 160)


@dataclass(frozen=True, slots=True)
class Asked:
    """What a study of a crowd takes.

    keep     switches to keep; method: one of `ways` whose parameter is a number of switches
    rows     at most so many are learnt from, equally many of every subject
    rounds   of LogitBoost that judges a placement
    repeats  other draws of subjects for every point of the learning curve
    """

    keep: int
    method: str = "elimination"
    rows: int = 3000
    rounds: int = 40
    repeats: int = 2
    seed: int = 1


class CurvePoint(msgspec.Struct, frozen=True):
    """Held-out subjects, recognised with the placement and the classifier that so many other subjects gave: means over
    the draws of these, one aim.
    """

    subjects: int
    aim: Aim
    served: Served


class Standard(msgspec.Struct, frozen=True):
    """A standard placement, and what was found on the way.

    columns   learnt from all subjects with `aim`, in the order of the method
    aim       what did better among the subjects learnt from: `tried` says by how much
    held_out  subjects that the curve is measured on; subjects: all there are
    rows      that were learnt from for the placement
    """

    columns: Columns
    method: str
    aim: Aim
    subjects: int
    held_out: int
    rows: int
    tried: tuple[CurvePoint, ...]
    curve: tuple[CurvePoint, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    """Learn from some subjects of a crowd, recognise others, with one aim."""

    crowd: Crowd
    learnt: Numbers
    asked: Numbers
    aim: Aim
    take: Asked
    seed: int
    place: int


def standard_placement(
    crowd: Crowd, take: Asked, jobs: int = 1, on_done: Callable[[int, int], None] | None = None
) -> Standard:
    """Return one placement for all subjects of `crowd`, and the rate against the number of subjects learnt from.

    `on_done(done, all)` is called after every piece of work. The same arguments give the same answer, whatever `jobs`.
    Raises PlacementError for fewer than eight subjects.
    """
    people = np.unique(crowd.subjects)
    if len(people) < _LEAST_SUBJECTS:
        raise PlacementError(
            f"the set has {len(people)} subject(s): a standard placement is learnt from at least {_LEAST_SUBJECTS}"
        )
    people = np.random.default_rng(take.seed).permutation(people)
    asked, learnt = _apart(people)
    tasks = [*_trials(crowd, learnt, take), *_curve(crowd, learnt, asked, take)]
    found: dict[int, Served] = {}
    for done, (place, answer) in enumerate(in_workers(_work, tasks, jobs), 1):
        found[place] = answer
        if on_done is not None:
            on_done(done, len(tasks) + 1)
    points = _points(tasks, found)
    tried, curve = points[: len(AIMS)], points[len(AIMS) :]
    aim = max(tried, key=lambda point: point.served.worth).aim
    rows = _learnt_from(crowd, aim, take, take.seed)
    columns = rows.place(take.method, take.keep)
    if on_done is not None:
        on_done(len(tasks) + 1, len(tasks) + 1)
    return Standard(columns, take.method, aim, len(people), len(asked), len(rows.subjects), tried, curve)


def _apart(people: Numbers) -> tuple[Numbers, Numbers]:
    """Return a fifth of the people, to be recognised, and the others, to learn from."""
    held_out = max(round(_HELD_OUT * len(people)), 1)
    return people[:held_out], people[held_out:]


def _trials(crowd: Crowd, learnt: Numbers, take: Asked) -> list[_Task]:
    """Return a task for each aim, within the people learnt from."""
    asked, rest = _apart(learnt)
    return [_Task(crowd.of(learnt), rest, asked, aim, take, take.seed, place) for place, aim in enumerate(AIMS)]


def _curve(crowd: Crowd, learnt: Numbers, asked: Numbers, take: Asked) -> list[_Task]:
    """Return the tasks of the learning curve: numbers of subjects, draws of them, aims."""
    sizes = [*(size for size in _SIZES if size < len(learnt)), len(learnt)]
    tasks: list[_Task] = []
    for size in sizes:
        draws = take.repeats if size < len(learnt) else 1
        for seed in range(take.seed, take.seed + draws):
            some = np.random.default_rng([seed, size]).permutation(learnt)[:size]
            for aim in AIMS:
                place = len(AIMS) + len(tasks)
                tasks.append(_Task(crowd.of(np.append(some, asked)), some, asked, aim, take, seed, place))
    return tasks


def _work(task: _Task) -> tuple[int, Served]:
    take = task.take
    rows = _learnt_from(task.crowd.of(task.learnt), task.aim, take, task.seed)
    columns = rows.place(take.method, take.keep)
    judge = task.crowd.of(task.learnt).drawn(take.rows, task.seed)
    return task.place, served(rates(judge, task.crowd.of(task.asked), columns, take.rounds))


def _learnt_from(crowd: Crowd, aim: Aim, take: Asked, seed: int) -> Crowd:
    """Return the rows that a placement is learnt from: drawn evenly, those of the worst served more often if wanted."""
    drawn = crowd.drawn(take.rows, seed)
    people = np.unique(crowd.subjects)
    if aim == "mean" or len(people) < _LEAST_SUBJECTS:
        return drawn
    mixed = np.random.default_rng([seed, len(people)]).permutation(people)
    halves = mixed[::2], mixed[1::2]
    found = [
        (rate, subject)
        for one, other in (halves, halves[::-1])
        for rate, subject in zip(_rates_of(drawn.of(one), drawn.of(other), take), np.sort(other), strict=True)
    ]
    worst = sorted(found)[: max(round(WORST_SHARE * len(people)), 1)]
    return drawn.favouring(np.array([subject for _, subject in worst], dtype=np.intp))


def _rates_of(learnt: Crowd, asked: Crowd, take: Asked) -> list[float]:
    found: list[float] = rates(learnt, asked, learnt.place(take.method, take.keep), take.rounds).tolist()
    return found


def _points(tasks: list[_Task], found: dict[int, Served]) -> tuple[CurvePoint, ...]:
    """Return the means over the draws, the trials of the aims first."""
    draws: dict[tuple[bool, int, Aim], list[Served]] = {}
    for task in tasks:
        key = (task.place < len(AIMS), len(task.learnt), task.aim)
        draws.setdefault(key, []).append(found[task.place])
    return tuple(CurvePoint(size, aim, _mean(several)) for (_, size, aim), several in draws.items())


def _mean(several: list[Served]) -> Served:
    """Return the mean of every rate."""
    fields = np.array([(one.mean, one.worst_tenth, one.lowest) for one in several]).mean(axis=0)
    return Served(*fields.tolist())

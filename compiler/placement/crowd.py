"""A standard placement: one for many subjects, those it serves worst included, and how many subjects it takes.

Placements are learnt from some subjects and recognise others, who are never learnt from. Three are held beside each
other: as a method chooses them, and bettered for the mean over subjects or for the worst-served tenth (`refining`).
Which of the three is taken is decided among the subjects that are learnt from, on a fifth of them that is kept aside,
by the mean and the worst tenth in equal parts.
"""

from collections.abc import Callable
from dataclasses import dataclass

import msgspec
import numpy as np

from ..samples import Columns
from ..workers import in_workers
from .errors import PlacementError
from .refining import REACH, Refining
from .serving import Aim, Crowd, Numbers, Served, rates, served
from .ways import chooser

AIMS: tuple[Aim, ...] = ("plain", "mean", "worst tenth")

LEAST_SUBJECTS = 8
_HELD_OUT = 0.2
_SIZES = (2, 5, 10, 20, 40, 80, 160)


@dataclass(frozen=True, slots=True)
class Asked:
    """What a study of a crowd takes.

    keep     switches to keep; method: one of `ways` whose parameter is a number of switches
    rows     at most so many are learnt from to place, equally many of every subject; a classifier learns from all
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
    aim       what did best among the subjects learnt from, the first of equal ones: `tried` says by how much
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
    """Learn from some subjects of a crowd, recognise others."""

    crowd: Crowd
    learnt: Numbers
    asked: Numbers
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
    if len(people) < LEAST_SUBJECTS:
        raise PlacementError(
            f"the set has {len(people)} subject(s): a standard placement is learnt from at least {LEAST_SUBJECTS}"
        )
    people = np.random.default_rng(take.seed).permutation(people)
    asked, learnt = _apart(people)
    tasks = [_trial(crowd, learnt, take), *_curve(crowd, learnt, asked, take)]
    found: dict[int, tuple[Served, ...]] = {}
    for done, (place, answer) in enumerate(in_workers(_work, tasks, jobs), 1):
        found[place] = answer
        if on_done is not None:
            on_done(done, len(tasks) + 1)
    points = _points(tasks, found)
    tried, curve = points[: len(AIMS)], points[len(AIMS) :]
    aim = max(tried, key=lambda point: point.served.worth).aim
    columns = _refining(crowd, take, take.seed).best(aim)
    if on_done is not None:
        on_done(len(tasks) + 1, len(tasks) + 1)
    rows = len(crowd.drawn(take.rows, take.seed).subjects)
    return Standard(columns, take.method, aim, len(people), len(asked), rows, tried, curve)


def _apart(people: Numbers) -> tuple[Numbers, Numbers]:
    """Return a fifth of the people, to be recognised, and the others, to learn from."""
    held_out = max(round(_HELD_OUT * len(people)), 1)
    return people[:held_out], people[held_out:]


def _trial(crowd: Crowd, learnt: Numbers, take: Asked) -> _Task:
    """Return the task that the aims are compared by, within the people learnt from."""
    asked, rest = _apart(learnt)
    return _Task(crowd.of(learnt), rest, asked, take, take.seed, 0)


def _curve(crowd: Crowd, learnt: Numbers, asked: Numbers, take: Asked) -> list[_Task]:
    """Return the tasks of the learning curve: numbers of subjects, draws of them."""
    sizes = [*(size for size in _SIZES if size < len(learnt)), len(learnt)]
    tasks: list[_Task] = []
    for size in sizes:
        draws = take.repeats if size < len(learnt) else 1
        for seed in range(take.seed, take.seed + draws):
            some = np.random.default_rng([seed, size]).permutation(learnt)[:size]
            tasks.append(_Task(crowd.of(np.append(some, asked)), some, asked, take, seed, len(tasks) + 1))
    return tasks


def _work(task: _Task) -> tuple[int, tuple[Served, ...]]:
    """Return the task's place, and how the people asked are served for each aim."""
    learnt, asked = task.crowd.of(task.learnt), task.crowd.of(task.asked)
    refining = _refining(learnt, task.take, task.seed)
    placements = [refining.best(aim) for aim in AIMS]
    found = {columns: served(rates(learnt, asked, columns, task.take.rounds)) for columns in placements}
    return task.place, tuple(found[columns] for columns in placements)


def _refining(crowd: Crowd, take: Asked, seed: int) -> Refining:
    """Return the method's placement, from rows drawn evenly over the subjects, ready to be bettered."""
    choose = chooser(take.method, crowd.drawn(take.rows, seed).learning)
    kept = choose(take.keep)
    spare = tuple(column for column in choose(take.keep + REACH) if column not in kept)
    return Refining(crowd, kept, spare, take.rows, take.rounds, seed)


def _points(tasks: list[_Task], found: dict[int, tuple[Served, ...]]) -> tuple[CurvePoint, ...]:
    """Return the means over the draws for every aim, those of the trial first."""
    draws: dict[tuple[bool, int], list[tuple[Served, ...]]] = {}
    for task in tasks:
        draws.setdefault((task.place == 0, len(task.learnt)), []).append(found[task.place])
    return tuple(
        CurvePoint(size, aim, _mean([one[number] for one in several]))
        for (_, size), several in draws.items()
        for number, aim in enumerate(AIMS)
    )


def _mean(several: list[Served]) -> Served:
    """Return the mean of every rate."""
    fields = np.array([(one.mean, one.worst_tenth, one.lowest) for one in several]).mean(axis=0)
    return Served(*fields.tolist())

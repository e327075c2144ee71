"""Which grasp comes next in a guided collection, and what a recording says of the trials that are done."""

import random
from dataclasses import dataclass
from pathlib import Path

from thenar.drivers.errors import SettingError

from .layout import Tail
from .reader import Reader
from .session import MOST_TRIALS, Collection, Label, Session


@dataclass(frozen=True, slots=True)
class Trial:
    """One grasp to record: its number in the collection, from 1, its type and its object."""

    number: int
    grasp: str
    object: str


@dataclass(frozen=True, slots=True)
class Journal:
    """A collection that was begun: its first session, the trials that were accepted, and where to go on."""

    path: Path
    session: Session
    accepted: frozenset[int]
    tail: Tail


def planned(collection: Collection) -> tuple[Trial, ...]:
    """Return the trials of a collection: every task so many times, its objects by turns, all in one random order.

    So the paper collected: each type 100 times with two objects, in random order. Equal collections give equal plans.
    Raises SettingError if there are more than a million trials.
    """
    if len(collection.tasks) * collection.repetitions > MOST_TRIALS:
        raise SettingError(
            f"{len(collection.tasks)} grasp types of {collection.repetitions} repetitions each are more than "
            f"{MOST_TRIALS} trials: take fewer repetitions"
        )
    grasps = [
        (task.grasp, task.objects[repetition % len(task.objects)])
        for task in collection.tasks
        for repetition in range(collection.repetitions)
    ]
    # Of all its methods only random() gives the same numbers in every Python to come.
    draw = random.Random(collection.seed).random
    ordered = sorted((draw(), place) for place in range(len(grasps)))
    return tuple(Trial(number, *grasps[place]) for number, (_, place) in enumerate(ordered, start=1))


def read_journal(path: Path) -> Journal:
    """Return the collection that a recording holds. Raises McapError, SettingError where it is none, or OSError."""
    reader = Reader(path)
    first = reader.session
    if first.collection is None:
        raise SettingError(f"{path} is a recording without trials: name another output")
    accepted = [entry.trial for entry in reader if isinstance(entry, Label) and entry.event == "accepted"]
    if reader.foreign or reader.altered:
        raise SettingError(
            f"{path} was changed by another program, or is damaged: import it, and collect the rest into another file"
        )
    return Journal(path, first, frozenset(accepted), reader.tail)

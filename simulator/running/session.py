"""Sessions: every repetition of every grasp type of one subject, in one random order."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..body.condition import Condition
from ..pipeline.batch import Batch, Integers
from ..planning.postures import Postures
from ..scenes.scene import Scene, Subject
from ..streams import Draw, Draws, Site

Floats = NDArray[np.float64]

ORDER = "session.order"  # the draw site of the order of trials


@dataclass(frozen=True, slots=True, eq=False)
class Session:
    """The trials of one subject: p conditions in the order of the scene's objects, t trials.

    trials      an array a condition: the trial of each of its repetitions
    planned_deg (p, 20)  the conditions' planned postures
    before      (t,)     the condition of the trial before each trial; of the first: its own
    """

    conditions: tuple[Condition, ...]
    trials: tuple[Integers, ...]
    planned_deg: Floats
    before: Integers

    def batch(self, place: int, repetitions: Integers) -> Batch:
        """Return some repetitions (n,) of a condition of the session, ready for the pipeline."""
        trials = self.trials[place][repetitions]
        return Batch(self.conditions[place], repetitions, trials, self.planned_deg[self.before[trials]])


def sessions(scene: Scene, postures: Postures) -> tuple[Session, ...]:
    """Return every subject's session. Raises SceneError where an object has no planned posture."""
    return tuple(session_of(scene, conditions_of(scene, subject, postures)) for subject in scene.subjects)


def conditions_of(scene: Scene, subject: Subject, postures: Postures) -> tuple[Condition, ...]:
    """Return what a subject does with every object. Raises SceneError where one has no planned posture."""
    hand = subject.hand()
    things = [(item.grasp, item.thing()) for item, repetitions in scene.shares() if repetitions]
    return tuple(
        Condition(subject.name, hand, grasp, thing, postures.held(hand, grasp, thing)) for grasp, thing in things
    )


def session_of(scene: Scene, conditions: tuple[Condition, ...]) -> Session:
    """Return the session of the subject whose conditions these are."""
    repetitions = [share for _, share in scene.shares() if share]
    words = [_words(scene.seed, each, count) for each, count in zip(conditions, repetitions, strict=True)]
    return _in_order(conditions, words)


def _words(seed: int, condition: Condition, repetitions: int) -> NDArray[np.uint64]:
    site = Site(condition.subject, condition.grasp, condition.thing.name, np.arange(repetitions))
    return Draw(seed, ORDER, site, Draws()).per_repetition().words


def _in_order(found: tuple[Condition, ...], words: list[NDArray[np.uint64]]) -> Session:
    """Put all repetitions in the order of one random word each: no other repetition, type or object changes a word."""
    counts = [len(each) for each in words]
    owner = np.repeat(np.arange(len(found)), counts)
    order = np.argsort(np.concatenate(words), kind="stable")
    trials = np.empty(len(order), dtype=np.int64)
    trials[order] = np.arange(len(order))
    return Session(
        conditions=found,
        trials=tuple(np.split(trials, np.cumsum(counts)[:-1])),
        planned_deg=np.stack([condition.held.posture_deg for condition in found]),
        before=owner[np.concatenate([order[:1], order[:-1]])],
    )

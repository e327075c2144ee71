from collections import Counter

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import SubjectSession, sessions
from thenar.simulator.planning.postures import Postures
from thenar.simulator.scenes.scene import Scene
from thenar.simulator.streams import Draw, Site

from ..small import make_scene

QUICK = load_scene("quick")
POSTURES = Postures.shipped(QUICK.taxonomy)


def quick(**changes: object) -> Scene:
    return msgspec.structs.replace(QUICK, **changes)


def course(session: SubjectSession) -> list[tuple[str, str, int]]:
    """Return grasp type, object and repetition of each trial of a session, in order."""
    found = {
        int(trial): (condition.grasp, condition.thing.name, repetition)
        for condition, trials in zip(session.conditions, session.trials, strict=True)
        for repetition, trial in enumerate(trials)
    }
    assert sorted(found) == list(range(len(found)))
    return [found[trial] for trial in range(len(found))]


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 9), st.integers(0, 2**63 - 1))
def test_every_repetition_has_one_trial_of_its_own(repetitions: int, seed: int) -> None:
    scene = quick(repetitions=repetitions, seed=seed)
    wanted = {(item.grasp, item.name, number) for item, numbers in scene.shares() for number in numbers}
    for session in sessions(scene, POSTURES):
        order = course(session)
        assert len(order) == 14 * repetitions
        assert set(order) == wanted


def test_trials_follow_the_random_words_that_every_repetition_draws_alone() -> None:
    for session in sessions(QUICK, POSTURES):
        words = [
            Draw(QUICK.seed, "session.order", site, Counter()).per_repetition().words[0]
            for condition in session.conditions
            for site in (
                Site(condition.subject, condition.grasp, condition.thing.name, np.array([number]))
                for number in range(6)
            )
        ]
        assert np.argsort(np.concatenate(session.trials)).tolist() == np.argsort(words).tolist()


def test_an_object_that_gets_no_repetition_is_no_condition() -> None:
    for session in sessions(quick(repetitions=1), POSTURES):
        assert len(session.conditions) == 14


@settings(max_examples=20, deadline=None)
@given(st.sets(st.integers(0, 27), min_size=1))
def test_leaving_objects_out_leaves_the_others_in_their_order(kept: set[int]) -> None:
    # Each grasp type has two objects: one that is left alone gets more repetitions, and those of before are compared.
    part = quick(objects=tuple(QUICK.objects[number] for number in sorted(kept)))
    for whole, some in zip(sessions(QUICK, POSTURES), sessions(part, POSTURES), strict=True):
        common = set(course(whole)) & set(course(some))
        assert common
        assert [each for each in course(whole) if each in common] == [each for each in course(some) if each in common]


def test_the_hand_comes_from_the_posture_planned_for_the_trial_before() -> None:
    session = sessions(QUICK, POSTURES)[0]
    order = course(session)
    planned = {(one.grasp, one.thing.name): one.held.posture_deg for one in session.conditions}
    for place, condition in enumerate(session.conditions):
        batch = session.batch(place, np.arange(len(session.trials[place])))
        for trial, previous in zip(batch.trials, batch.previous_deg, strict=True):
            before = order[max(int(trial) - 1, 0)]
            np.testing.assert_array_equal(previous, planned[before[:2]])
        assert batch.condition is condition


def test_an_object_without_a_planned_posture_is_named_with_its_grasp_type() -> None:
    with pytest.raises(SceneError, match=r"no planned posture of grasp type 'PoS' with object 'bar' for a hand of"):
        sessions(make_scene(), Postures("kamakura14", ()))


def test_fresh_repetitions_have_trials_beyond_the_session() -> None:
    fresh = quick(repetitions=3, done=12)
    for old, new in zip(sessions(QUICK, POSTURES), sessions(fresh, POSTURES), strict=True):
        assert len(course(new)) == 14 * 3
        batches = [new.batch(place, np.arange(len(trials))) for place, trials in enumerate(new.trials)]
        assert np.sort(np.concatenate([batch.trials for batch in batches])).tolist() == list(range(14 * 12, 14 * 15))
        for batch, trials in zip(batches, old.trials, strict=True):
            assert batch.repetitions.tolist() == list(range(len(trials), len(trials) + len(batch)))

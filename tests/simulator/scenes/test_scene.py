from collections import Counter
from math import sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.simulator.body.shapes import Sphere
from thenar.simulator.pipeline.effect import EFFECTS, SceneSetting
from thenar.simulator.scenes.scene import (
    CORRELATION,
    HAND_BREADTHS_MM,
    HAND_LENGTHS_MM,
    SURVEYS,
    Recording,
    Scene,
    SceneObject,
    SizeSpread,
    Subject,
    SurveyPopulation,
    draw_subjects,
)

from ..small import make_scene


def objects(grasps: list[str]) -> tuple[SceneObject, ...]:
    ball = Sphere(diameter_mm=50.0)
    return tuple(SceneObject(name=f"ball {n}", grasp=g, shape=ball, mass_g=80.0) for n, g in enumerate(grasps))


def scene_of(grasps: list[str], repetitions: int) -> Scene:
    made = objects(grasps)
    return Scene(name="x", seed=1, taxonomy="own", objects=made, subjects=(), repetitions=repetitions, effects=())


@given(grasps=st.lists(st.sampled_from("abc"), min_size=1, max_size=12), repetitions=st.integers(1, 50))
def test_every_grasp_type_gets_all_repetitions_and_its_objects_even_shares(grasps: list[str], repetitions: int) -> None:
    scene = scene_of(grasps, repetitions)
    shares = list(scene.shares())
    assert [item for item, _ in shares] == list(scene.objects)
    total: Counter[str] = Counter()
    for item, numbers in shares:
        total[item.grasp] += len(numbers)
    assert total == dict.fromkeys(grasps, repetitions)
    for grasp in total:
        counts = [len(numbers) for item, numbers in shares if item.grasp == grasp]
        assert counts == sorted(counts, reverse=True)
        assert max(counts) - min(counts) <= 1


@given(st.lists(st.sampled_from("abc"), min_size=1, max_size=12), st.integers(1, 20), st.integers(1, 20))
def test_more_repetitions_go_on_where_those_of_the_scene_end(grasps: list[str], repetitions: int, more: int) -> None:
    scene = scene_of(grasps, repetitions)
    fresh, both = scene.varied(more=more), scene.varied(repetitions + more)
    assert fresh == scene.varied(repetitions, more=more)
    for (_, old), (_, new), (_, whole) in zip(scene.shares(), fresh.shares(), both.shares(), strict=True):
        assert [*old, *new] == [*whole]
    assert SceneSetting.of(fresh, []).session_trials == SceneSetting.of(scene, []).session_trials
    assert fresh.origin == f"scene x, seed 1, {more} more after {repetitions} repetitions"


def test_a_setting_has_times_in_microseconds_from_the_first_contact() -> None:
    scene = make_scene(recording=Recording(rate_hz=80.0, lead_ms=30.5, hold_ms=250.0, release_ms=40.0))
    setting = SceneSetting.of(scene, [])
    assert (setting.period_us, setting.first_us, setting.hold_us, setting.release_us) == (
        12_500,
        -30_500,
        250_000,
        40_000,
    )
    assert (setting.seed, setting.threshold_n) == (scene.seed, scene.glove.threshold_n)


def test_a_session_has_the_trials_of_one_subject() -> None:
    scene = make_scene(objects=objects(["PoS", "PoS", "Tip"]), repetitions=10)
    assert SceneSetting.of(scene, []).session_trials == 20


@pytest.mark.parametrize(
    ("rows", "effects", "timed", "on_wire"),
    [
        ("last", [], False, False),
        ("last", ["joint.noise"], False, False),
        ("last", ["joint.noise", "frame.jitter"], True, False),
        ("last", ["wire.lost_bytes"], False, True),
        ("all", [], True, False),
    ],
)
def test_frames_and_bytes_exist_if_rows_or_effects_need_them(
    rows: str, effects: list[str], timed: bool, on_wire: bool
) -> None:
    scene = make_scene(recording=Recording(rows=rows))  # type: ignore[arg-type]
    setting = SceneSetting.of(scene, [EFFECTS[name] for name in effects])
    assert (setting.timed, setting.on_wire) == (timed, on_wire)


def test_hands_have_subjects_sizes_and_objects_masses_in_kilograms() -> None:
    size = Subject(name="A", hand_length_mm=188.0, hand_breadth_mm=84.0).hand().size
    assert (size.length_mm, size.breadth_mm) == (188.0, 84.0)
    thing = objects(["Tip"])[0].thing()
    assert (thing.name, thing.shape, thing.mass_kg) == ("ball 0", Sphere(diameter_mm=50.0), 0.08)


@pytest.mark.parametrize("survey", ["ansur2", "aist2012"])
@pytest.mark.parametrize("women", [0.0, 1.0])
def test_drawn_hands_have_the_statistics_of_the_survey(survey: str, women: float) -> None:
    count = 2000
    people = draw_subjects(SurveyPopulation(survey=survey, count=count, women=women), seed=5)  # type: ignore[arg-type]
    length = np.array([subject.hand_length_mm for subject in people])
    breadth = np.array([subject.hand_breadth_mm for subject in people])
    for drawn, wanted in zip((length, breadth), SURVEYS[survey][int(women)], strict=True):
        assert abs(drawn.mean() - wanted.mean) < 4 * wanted.sd / sqrt(count)
        assert abs(drawn.std() - wanted.sd) < 4 * wanted.sd / sqrt(2 * count)
    assert abs(np.corrcoef(length, breadth)[0, 1] - CORRELATION) < 0.04


def test_raising_the_count_leaves_the_first_ones_as_they_were() -> None:
    few, many = (
        draw_subjects(SurveyPopulation(survey="ansur2", count=count, women=0.3), seed=1) for count in (7, 1100)
    )
    assert many[:7] == few
    assert [subject.name for subject in few[:2]] == ["P001", "P002"]
    assert len({subject.name for subject in many}) == 1100


@pytest.mark.parametrize(("women", "expected"), [(0.0, 0), (0.25, 50), (0.5, 100), (1.0, 200)])
def test_the_share_of_women_is_kept_and_mixed_in_evenly(women: float, expected: int) -> None:
    people = draw_subjects(SurveyPopulation(survey="aist2012", count=200, women=women), seed=3)
    men = draw_subjects(SurveyPopulation(survey="aist2012", count=200, women=0.0), seed=3)
    differ = [person != man for person, man in zip(people, men, strict=True)]
    assert sum(differ) == expected
    assert sum(differ[:100]) == expected // 2


def test_draws_are_the_same_everywhere() -> None:
    first = draw_subjects(SurveyPopulation(survey="ansur2", count=2), seed=1)
    assert [(s.hand_length_mm, s.hand_breadth_mm) for s in first] == [(196.7, 89.0), (180.7, 82.1)]


def test_a_hand_beyond_what_hands_are_is_clipped() -> None:
    spread = SizeSpread(180.0, 10.0)
    assert [spread.at(normal, (130.0, 240.0)) for normal in (-9.0, 0.123, 9.0)] == [130.0, 181.2, 240.0]
    people = draw_subjects(SurveyPopulation(survey="ansur2", count=500), seed=9)
    assert all(HAND_LENGTHS_MM[0] <= subject.hand_length_mm <= HAND_LENGTHS_MM[1] for subject in people)
    assert all(HAND_BREADTHS_MM[0] <= subject.hand_breadth_mm <= HAND_BREADTHS_MM[1] for subject in people)

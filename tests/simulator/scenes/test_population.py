from math import sqrt

import numpy as np
import pytest

from thenar.simulator.scenes.scene import (
    CORRELATION,
    HAND_BREADTHS_MM,
    HAND_LENGTHS_MM,
    SURVEYS,
    SizeSpread,
    SurveyPopulation,
    draw_subjects,
)


@pytest.mark.parametrize("survey", ["ansur2", "aist2012"])
@pytest.mark.parametrize("women", [0.0, 1.0])
def test_drawn_hands_have_the_statistics_of_the_survey(survey: str, women: float) -> None:
    count = 2000
    people = draw_subjects(SurveyPopulation(survey=survey, count=count, women=women), seed=5)  # type: ignore[arg-type]
    length = np.array([subject.hand_length_mm for subject in people])
    breadth = np.array([subject.hand_breadth_mm for subject in people])
    hands = SURVEYS[survey][int(women)]
    for drawn, wanted in ((length, hands.length), (breadth, hands.breadth)):
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

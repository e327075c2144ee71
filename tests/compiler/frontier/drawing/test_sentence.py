"""The sentence that reads the picture, and the words that numbers are told in."""

from typing import Any

import msgspec
import pytest

from thenar.compiler.frontier.drawing.sentence import sentence
from thenar.compiler.frontier.drawing.words import featured, wiring_of


def test_it_says_how_many_switches_how_much_time_how_much_recognition_and_against_what(examples: Any) -> None:
    marks = examples.example_frontier().marks
    assert sentence(examples.example_frontier(marks=(marks[0], marks[2]))) == (
        "Point 5: 33 of 160 switches, read and classified in 440 us on avr328p, recognise 92.9 [92.1, 93.7] % of the "
        "grasps, against 93.6 % in 2.05 ms with all 160 switches and 91.5 % in 905 us with 35 switches (paper, S = 62)."
    )


def test_joints_are_told_too(examples: Any) -> None:
    assert sentence(examples.example_frontier(picked=8)).startswith("Point 8: 8 of 160 switches and 16 joints, read")
    assert sentence(examples.example_frontier(picked=7)).startswith("Point 7: 16 joints, read")


def test_without_marks_and_without_points_it_is_still_a_sentence(examples: Any) -> None:
    assert sentence(examples.example_frontier(marks=())).endswith("% of the grasps.")
    none = examples.example_frontier(points=(), picked=None)
    assert sentence(none) == "Of 184,320 combinations none is a point of the frontier."


def test_where_nothing_is_picked_the_fastest_point_level_with_all_switches_is_spoken_of(examples: Any) -> None:
    frontier = examples.example_frontier(picked=None)
    point = featured(frontier)
    assert point is not None
    assert point.number == 6
    assert all(other.rate.mean < 0.931 for other in frontier.points if other.frame.us < point.frame.us)


def test_where_no_point_is_level_the_best_is_spoken_of(examples: Any) -> None:
    best = featured(examples.example_frontier(picked=None, marks=()))
    assert best is not None
    assert best.number == 10


@pytest.mark.parametrize(
    ("wiring", "clock", "said"),
    [
        ("mcp23017", 400_000, "mcp23017 400 kHz"),
        ("board", 1_000_000, "board 1 Mbaud"),
        ("board", 115_200, "board 115.2 kbaud"),
        ("as wired", 0, ""),
    ],
)
def test_a_wiring_is_told_with_its_clock(examples: Any, wiring: str, clock: int, said: str) -> None:
    setting = examples.example_frontier().points[0].setting
    assert wiring_of(msgspec.structs.replace(setting, wiring=wiring, clock_hz=clock)) == said

"""The pictures of the page: measured on any number of cores alike, drawn alike, and nothing hidden by the drawing."""

import math
import xml.etree.ElementTree as ET

import pytest

from thenar.compiler.pictures import painting
from thenar.stability.shown.figures import (
    BLUE,
    FONT,
    Measured,
    curve,
    draw_ranges,
    draw_widths,
    exponents,
    figures,
    measure,
    sheet,
)
from thenar.stability.weka import NotRun


@pytest.fixture(scope="module")
def measured() -> Measured:
    return measure(full=False, jobs=1, rounds=40)


def test_what_is_measured_does_not_depend_on_the_number_of_workers(measured: Measured) -> None:
    assert measure(full=False, jobs=2, rounds=40) == measured


def test_one_training_is_of_a_separable_set_and_both_have_every_round(measured: Measured) -> None:
    assert [len(ranges.losses) for ranges in measured.trainings] == [40, 40]
    learned, noisy = (ranges.losses[-1] for ranges in measured.trainings)
    assert learned < 1e-15 < 0.01 < noisy


def test_the_widths_are_4_to_16_bits_and_the_worst_error_falls_within_its_bound(measured: Measured) -> None:
    assert [width.bits for width in measured.widths] == list(range(4, 17))
    assert all(0 < width.worst <= width.bound for width in measured.widths)


def test_the_page_has_its_pictures_in_order_and_says_where_one_was_not_run(measured: Measured) -> None:
    shown = figures(measured, NotRun("java or Weka is not installed"))
    assert [(each.name, each.svg is not None) for each in shown] == [
        ("ranges", True),
        ("weka", False),
        ("widths", True),
    ]
    assert shown[1].caption == "not run: java or Weka is not installed"
    assert [each.name for each in figures(measured, None)] == ["ranges", "widths"]


def test_pictures_are_drawings_and_the_same_every_time(measured: Measured) -> None:
    def drawn() -> list[bytes]:
        return [draw_ranges(measured.trainings), draw_widths(measured.widths)]

    assert [ET.fromstring(each).tag.endswith("svg") for each in drawn()] == [True, True]
    assert drawn() == drawn()


def test_rounds_drawn_as_one_point_keep_their_extreme_and_zeros_have_no_point() -> None:
    heights = [1.0] * 10_000
    heights[7_777] = 5.0
    heights[3_333] = 0.25
    with painting(FONT):
        _, ((axes,),) = sheet(1, 1, 2)
        rounds, most = curve(axes, heights, BLUE)
        _, least = curve(axes, heights, BLUE, pick=min)
        _, none = curve(axes, [1.0, 0.0, 0.0], BLUE)
    assert (max(most), min(most), min(least)) == (5.0, 1.0, 0.25)
    assert (rounds[0], len(rounds) < 500) == (1, True)
    assert 7_000 < rounds[most.index(5.0)] <= 7_778
    assert none[0] == 1.0
    assert all(map(math.isnan, none[1:]))


@pytest.mark.parametrize(
    ("heights", "expected"),
    [
        ([1e-90, 1.0], range(-90, 1, 15)),
        ([0.02, 3.0], range(-2, 2)),
        ([1.0, 1.0], range(-1, 1)),
        ([3e-17, 2e-12], range(-17, -10)),
    ],
)
def test_the_powers_of_ten_hold_what_is_drawn_between_them(heights: list[float], expected: range) -> None:
    with painting(FONT):
        _, ((axes,),) = sheet(1, 1, 2)
        curve(axes, heights, BLUE)
        assert exponents(axes) == expected

"""The picture: the same every time, every point named, names as they are."""

import dataclasses
import re
import xml.etree.ElementTree as ElementTree
from itertools import combinations, pairwise
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure
from matplotlib.text import Text
from msgspec.structs import replace

from thenar.compiler.frontier.plots import _round_times, draw, picture
from thenar.compiler.frontier.points import Frontier, PointTime, ReferencePoint
from thenar.compiler.pictures import painting

NASTY = r"$\left{<&> -- ü = ]]> 'x'"


def _drawn(frontier: Frontier) -> Figure:
    with painting(9):
        return draw(frontier)


def _texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.axes[0].texts]


def _key(figure: Figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def _many(examples: Any) -> Frontier:
    """Return a frontier of three trainers, of which many points and marks take nearly the same time, with wide
    intervals.
    """
    made: Frontier = examples.example_frontier()
    points = tuple(
        replace(
            point,
            setting=replace(point.setting, trainer=("logitboost", "linear", "pairs")[number % 3]),
            frame=replace(point.frame, us=5000.0 + 20 * number),
            rate=dataclasses.replace(point.rate, low=0.1 + 0.01 * number, high=0.98),
            fronts=("frame",),
        )
        for number, point in enumerate(made.points)
    )
    marks = tuple(replace(mark, frame_us=5100.0 + 10 * number) for number, mark in enumerate(made.marks))
    tried = tuple(
        replace(each, trainer=("logitboost", "linear", "pairs")[at % 3]) for at, each in enumerate(made.tried)
    )
    return replace(made, points=points, marks=marks, tried=tried)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["svg", "png"])
def test_equal_frontiers_give_equal_bytes(examples: Any, kind: Any) -> None:
    first, second = (picture(examples.example_frontier(), kind) for _ in range(2))
    assert first == second


def test_every_point_and_mark_is_named_beside_it(examples: Any) -> None:
    frontier = examples.example_frontier()
    figure = _drawn(frontier)
    named = {mark.name for mark in frontier.marks} | {str(point.number) for point in frontier.points}
    assert sorted(_texts(figure)) == sorted(named)
    assert any(f"Ringed: point {frontier.picked}, " in text.get_text() for text in figure.texts)


@pytest.mark.parametrize("kind", ["example", "many"])
def test_the_key_has_at_most_five_entries_and_labels_cover_nothing(examples: Any, kind: str) -> None:
    frontier = examples.example_frontier() if kind == "example" else _many(examples)
    figure = _drawn(frontier)
    assert 1 < len(_key(figure)) <= 5
    renderer, axes = FigureCanvasAgg(figure).get_renderer(), figure.axes[0]  # type: ignore[no-untyped-call]
    figure.draw_without_rendering()
    # Of a text with a line to its marker, without the line.
    boxes = [Text.get_window_extent(text, renderer) for text in axes.texts]
    assert len(boxes) > 4
    whole = axes.get_window_extent(renderer)
    assert all(whole.x0 <= box.x0 and box.x1 <= whole.x1 and whole.y0 <= box.y0 and box.y1 <= whole.y1 for box in boxes)
    for one, other in combinations(boxes, 2):
        assert not (one.x0 < other.x1 and other.x0 < one.x1 and one.y0 < other.y1 and other.y0 < one.y1)
    markers = [
        axes.transData.transform(place)
        for drawn in axes.collections
        for place in (
            np.asarray(drawn.get_offsets()) if isinstance(drawn, PathCollection) and drawn.zorder >= 4 else ()
        )
    ]
    assert len(markers) >= len(frontier.points) + len(frontier.marks)
    for box in boxes:
        assert not [place for place in markers if box.x0 < place[0] < box.x1 and box.y0 < place[1] < box.y1]


def test_intervals_can_be_told_apart(examples: Any) -> None:
    frontier = _many(examples)
    figure = _drawn(frontier)
    axes = figure.axes[0]
    lines = [
        segment for drawn in axes.collections if isinstance(drawn, LineCollection) for segment in drawn.get_segments()
    ]
    assert len(lines) == len(frontier.points)
    points = sorted(axes.transData.transform(segment[0])[0] * 72 / figure.dpi for segment in lines)
    assert min(later - before for before, later in pairwise(points)) > 8


def test_letters_can_be_read_on_a_phone_which_sees_the_whole_picture(examples: Any) -> None:
    text = picture(_many(examples), "svg").decode()
    root = ElementTree.fromstring(text)
    assert {"width", "height"}.isdisjoint(root.attrib)
    width = float(root.attrib["viewBox"].split()[2])
    sizes = [100 * float(scale) for scale in re.findall(r"scale\((\d*\.\d+) -\d*\.\d+\)", text)]
    assert len(sizes) > 10
    assert min(sizes) * 400 / width >= 11
    assert " us" not in text
    assert "µs" in text


def test_names_are_no_formulas_and_no_markup(examples: Any) -> None:
    mark = ReferencePoint(NASTY, 160, examples.rate(0.93), 2000.0)
    frontier = examples.example_frontier(source=NASTY, target="host", machine=NASTY, marks=(mark,))
    ElementTree.fromstring(picture(frontier, "svg"))
    assert NASTY in _texts(_drawn(frontier))


def test_zero_costs_and_strange_names_are_drawn(examples: Any) -> None:
    found, replace = examples.example_frontier(), msgspec.structs.replace
    first = replace(found.points[0], frame=replace(found.points[0].frame, us=0.0))
    mark = replace(found.marks[0], name="bell \x07 and no character \ufffe", frame_us=0.0)
    frontier = replace(found, points=(first, *found.points[1:]), marks=(mark,), source="\x1b[31m")
    ElementTree.fromstring(picture(frontier, "svg"))
    assert str(first.number) in _texts(_drawn(frontier))


@pytest.mark.parametrize(
    "changes",
    [
        {"points": (), "tried": (), "marks": (), "picked": None},
        {"tried": (), "marks": ()},
        {"points": (), "picked": None},
        {"picked": None},
    ],
    ids=["nothing", "points alone", "no points", "nothing picked"],
)
def test_what_is_missing_is_left_out(examples: Any, changes: dict[str, object]) -> None:
    frontier = examples.example_frontier(**changes)
    against_time = picture(frontier, "svg")
    ElementTree.fromstring(against_time)
    assert (b"<!-- tried -->" in against_time) == bool(frontier.tried)
    assert (b"<!-- switches -->" in against_time) == bool(frontier.points)
    assert (b"<!-- paper, S = 62 -->" in against_time) == bool(frontier.marks)
    assert (b"<!-- Ringed: point " in against_time) == bool(frontier.points)


def test_the_axis_mentions_an_unknown_time_of_joints(examples: Any) -> None:
    found, replace = examples.example_frontier(), msgspec.structs.replace
    assert "left out" not in _drawn(found).axes[0].get_xlabel()
    points = tuple(replace(point, transfer=PointTime(0.0, "unknown")) for point in found.points)
    unknown = replace(found, points=points)
    assert "reading the joints is left out" in _drawn(unknown).axes[0].get_xlabel().replace("\n", " ")


@given(st.floats(0.01, 1e8), st.floats(1.3, 1e6))
def test_a_range_of_times_has_one_to_five_round_ones(low: float, times: float) -> None:
    ticks = _round_times(low, low * times)
    assert 1 <= len(ticks) <= 5
    assert all(low <= tick <= low * times for tick in ticks)
    assert times < 2.6 or all(f"{tick:.3e}"[:5] in ("1.000", "2.000", "5.000") for tick in ticks)

"""The picture: the same every time, every point named, names as they are."""

import xml.etree.ElementTree as ElementTree
from typing import Any

import msgspec
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from thenar.compiler.frontier.plots import draw, picture
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


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["svg", "png"])
def test_equal_frontiers_give_equal_bytes(examples: Any, kind: Any) -> None:
    first, second = (picture(examples.example_frontier(), kind) for _ in range(2))
    assert first == second


def test_every_point_and_mark_is_named(examples: Any) -> None:
    frontier = examples.example_frontier()
    figure = _drawn(frontier)
    numbers, shown = list(map(int, _texts(figure))), frontier.points
    # Of points next to each other, one has its number.
    assert len(shown) - 2 <= len(set(numbers)) == len(numbers)
    assert {frontier.picked} <= set(numbers) <= {point.number for point in shown}
    for mark in frontier.marks:
        assert sum(mark.name in text for text in _key(figure)) == 1
    assert any(text.startswith(f"point {frontier.picked}: ") for text in _key(figure))


@pytest.mark.parametrize("factor", [1.01, 1.03, 1.05, 1.08, 1.12])
def test_no_number_lies_on_a_mark(examples: Any, factor: float) -> None:
    frontier = examples.example_frontier()
    marks = [
        msgspec.structs.replace(frontier.marks[0], name=f"mark {point.number}", frame_us=factor * point.frame.us)
        for point in frontier.points
    ]
    figure = _drawn(msgspec.structs.replace(frontier, marks=tuple(marks)))
    renderer, axes = FigureCanvasAgg(figure).get_renderer(), figure.axes[0]  # type: ignore[no-untyped-call]
    for box in (text.get_window_extent(renderer) for text in axes.texts):
        for mark in marks:
            ends = ((mark.frame_us, mark.rate.low), (mark.frame_us, mark.rate.high))
            (x, low), (_, high) = axes.transData.transform(ends)
            assert not (box.x0 < x < box.x1 and box.y0 < high and low < box.y1)


def test_names_are_no_formulas_and_no_markup(examples: Any) -> None:
    mark = ReferencePoint(NASTY, 160, examples.rate(0.93), 2000.0)
    frontier = examples.example_frontier(source=NASTY, target="host", machine=NASTY, marks=(mark,))
    ElementTree.fromstring(picture(frontier, "svg"))
    assert any(NASTY in text for text in _key(_drawn(frontier)))


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
    assert (b"<!-- switches alone -->" in against_time) == bool(frontier.points)
    assert (b"(paper, S = 62), " in against_time) == bool(frontier.marks)
    assert (b"<!-- point " in against_time) == bool(frontier.points)


def test_the_axis_mentions_an_unknown_time_of_joints(examples: Any) -> None:
    found, replace = examples.example_frontier(), msgspec.structs.replace
    assert "left out" not in _drawn(found).axes[0].get_xlabel()
    points = tuple(replace(point, transfer=PointTime(0.0, "unknown")) for point in found.points)
    unknown = replace(found, points=points)
    assert "reading the joints is left out" in _drawn(unknown).axes[0].get_xlabel()

"""The pictures: the same every time, every point named, no words on other words, names as they are."""

import itertools
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from msgspec.structs import replace

from thenar.compiler.frontier.plots import PICTURES, POINT_ID, pictures
from thenar.compiler.frontier.points import Frontier, Latency, Mark, Point, Time
from thenar.compiler.pictures import PictureError, painting

NASTY = r"$\left{<&> -- ü = ]]> 'x'"


def _drawn(frontier: Frontier, name: str) -> Figure:
    with painting(9):
        return PICTURES[name](frontier)


def _texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.axes[0].texts]


def _boxes(figure: Figure) -> Iterator[tuple[str, Any]]:
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        if text.get_text() and text.get_visible():
            yield text.get_text(), Text.get_window_extent(text, renderer)  # without the line that leads to it


def _overlaps(figure: Figure) -> list[tuple[str, str]]:
    figure.canvas.draw()
    pairs = itertools.combinations(_boxes(figure), 2)
    return [(a, b) for (a, box), (b, other) in pairs if box.overlaps(other) and box.width and other.width]


def _is_shown(point: Point, name: str) -> bool:
    """Return whether a picture has anything to say of a point."""
    return {
        "frontier": point.fronts != ("latency",),
        "switches": bool(point.switches),
        "latency": "latency" in point.fronts,
    }[name]


def _crowded(frontier: Frontier, several: int) -> Frontier:
    """Return a frontier with every point several times, each a little slower than the one before."""
    points = [
        msgspec.structs.replace(
            point,
            number=several * place + turn + 1,
            frame=msgspec.structs.replace(point.frame, us=point.frame.us * (1 + 0.03 * turn)),
        )
        for place, point in enumerate(frontier.points)
        for turn in range(several)
    ]
    return msgspec.structs.replace(frontier, points=tuple(points))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["svg", "png"])
def test_equal_frontiers_give_equal_bytes(examples: Any, kind: Any) -> None:
    first, second = (pictures(examples.example_frontier(), kind) for _ in range(2))
    assert list(first) == ["frontier", "switches", "latency"]
    assert first == second


@pytest.mark.parametrize("name", list(PICTURES))
def test_every_point_and_mark_is_named(examples: Any, name: str) -> None:
    frontier = examples.example_frontier()
    written = _texts(_drawn(frontier, name))
    for point in frontier.points:
        if _is_shown(point, name):
            own = [text for text in written if text.removeprefix("point ").split(":")[0] == str(point.number)]
            assert len(own) == 1, (point.number, written)
    for mark in frontier.marks:
        assert sum(text.startswith(mark.name) for text in written) == 1


def test_every_way_to_choose_switches_is_named_once(examples: Any) -> None:
    frontier = examples.example_frontier()
    written = _texts(_drawn(frontier, "switches"))
    assert all(written.count(curve.method) == 1 for curve in frontier.curves)


@pytest.mark.parametrize("name", list(PICTURES))
def test_no_words_stand_on_others(examples: Any, name: str) -> None:
    assert _overlaps(_drawn(examples.example_frontier(), name)) == []


@pytest.mark.parametrize("name", list(PICTURES))
def test_levels_of_taxels_are_named_and_no_words_stand_on_others(examples: Any, name: str) -> None:
    frontier = _pressed(examples.example_frontier())
    figure = _drawn(frontier, name)
    assert _overlaps(figure) == []
    axes = figure.axes[0]
    assert axes.get_xlabel().startswith("levels kept" if name == "switches" else "time")
    if name == "frontier":
        assert any("levels of" in text for text in _texts(figure))


def _pressed(frontier: Frontier) -> Frontier:
    """Return the frontier as one of 54 taxels, three levels of each, in place of switches."""

    def of_taxels(point: Point) -> Point:
        levels = tuple(f"pad{number // 3}>{40 * (number % 3 + 1)}" for number in range(len(point.switches)))
        setting = point.setting if point.setting.inputs == "joints" else replace(point.setting, levels=3)
        return replace(point, switches=levels, setting=setting)

    points = tuple(map(of_taxels, frontier.points))
    return replace(frontier, points=points, n_switches=0, n_taxels=54, n_levels=162)


@pytest.mark.parametrize("name", ["frontier", "latency"])
def test_many_points_close_together_are_named_and_readable(examples: Any, name: str) -> None:
    frontier = _crowded(examples.example_frontier(), 4)
    figure = _drawn(frontier, name)
    assert _overlaps(figure) == []
    shown = [point for point in frontier.points if _is_shown(point, name)]
    assert len(_texts(figure)) == len(shown) + len(frontier.marks)


@pytest.mark.parametrize("name", list(PICTURES))
def test_all_words_are_on_the_sheet(examples: Any, name: str) -> None:
    machine = "Raspberry Pi, a guess: 4 times Intel Core i7-8550U, Python 3.11"
    figure = _drawn(examples.example_frontier(machine=machine), name)
    figure.canvas.draw()
    assert any("a guess" in text.get_text() for text in figure.texts) == (name != "switches")
    for text, box in _boxes(figure):
        assert box.x0 >= 0, text
        assert box.y0 >= 0, text
        assert box.x1 <= figure.bbox.width, text
        assert box.y1 <= figure.bbox.height, text


def test_the_picked_point_says_what_it_is(examples: Any) -> None:
    assert "point 5: 33 switches\n440 us, 92.9 %" in _texts(_drawn(examples.example_frontier(), "frontier"))


def test_times_on_the_axis_are_times(examples: Any) -> None:
    axes = _drawn(examples.example_frontier(), "frontier").axes[0]
    assert axes.get_xscale() == "log"
    words = [label.get_text() for label in axes.get_xticklabels()]
    assert words == ["100 us", "200 us", "500 us", "1 ms", "2 ms", "5 ms"]


def test_the_line_of_the_best_is_a_step_at_each_of_them(examples: Any) -> None:
    frontier = examples.example_frontier()
    (line,) = [
        line for line in _drawn(frontier, "frontier").axes[0].lines if line.get_label() == "the best for its time"
    ]
    best = sorted((point.frame.us, point.rate.mean) for point in frontier.points if "frame" in point.fronts)
    assert line.get_drawstyle() == "steps-post"
    places = np.asarray(line.get_data(), np.float64).T.tolist()
    assert [tuple(place) for place in places][:-1] == best


def test_the_line_of_the_best_never_falls_where_points_are_best_of_their_kind_alone(examples: Any) -> None:
    found = examples.example_frontier()
    frontier = msgspec.structs.replace(
        found, points=tuple(msgspec.structs.replace(point, fronts=("latency",)) for point in found.points)
    )
    (line,) = [
        line for line in _drawn(frontier, "latency").axes[0].lines if line.get_label() == "the best for its latency"
    ]
    rates = np.asarray(line.get_ydata(), np.float64).tolist()
    assert rates == sorted(rates)
    assert len(rates) - 1 < len(found.points)


def test_names_are_no_formulas_and_no_markup(examples: Any) -> None:
    mark = Mark(NASTY, 160, examples.rate(0.93), 2000.0, 8000.0)
    curves = examples.example_frontier().curves
    frontier = examples.example_frontier(
        source=NASTY,
        target="host",
        machine=NASTY,
        marks=(mark,),
        curves=(msgspec.structs.replace(curves[0], method=NASTY), *curves[1:]),
    )
    for name, svg in pictures(frontier, "svg").items():
        ElementTree.fromstring(svg)
        assert any(text.startswith(NASTY) for text in _texts(_drawn(frontier, name)))


def test_a_cost_of_nothing_has_a_place_and_no_name_breaks_the_file(examples: Any) -> None:
    found, replace = examples.example_frontier(), msgspec.structs.replace
    first = replace(found.points[0], frame=replace(found.points[0].frame, us=0.0))
    mark = replace(found.marks[0], name="bell \x07 and no character \ufffe", frame_us=0.0)
    frontier = replace(found, points=(first, *found.points[1:]), marks=(mark,), source="\x1b[31m")
    read = {name: ElementTree.fromstring(svg) for name, svg in pictures(frontier, "svg", letters=True).items()}
    marker = read["frontier"].find(f".//{{*}}g[@id='{POINT_ID}{first.number}']")
    assert marker is not None
    assert marker.find(".//{*}use") is not None


@pytest.mark.parametrize(
    "changes",
    [
        {"points": (), "tried": (), "curves": (), "marks": (), "picked": None},
        {"tried": (), "curves": (), "marks": ()},
        {"points": (), "picked": None},
        {"picked": None},
    ],
    ids=["nothing", "points alone", "no points", "nothing picked"],
)
def test_what_is_missing_is_left_out(examples: Any, changes: dict[str, object]) -> None:
    frontier = examples.example_frontier(**changes)
    drawn = pictures(frontier, "svg")
    for svg in drawn.values():
        ElementTree.fromstring(svg)
    against_time = drawn["frontier"]
    assert (b"<!-- tried -->" in against_time) == bool(frontier.tried)
    assert (b"<!-- switches alone -->" in against_time) == bool(frontier.points)
    assert (b"<!-- paper, S = 62 " in against_time) == bool(frontier.marks)
    assert (b"<!-- point " in against_time) == bool(frontier.points)


def test_every_point_that_is_shown_has_a_marker_with_its_number(examples: Any) -> None:
    frontier = examples.example_frontier()
    for name, svg in pictures(frontier, "svg", letters=True).items():
        ids = {element.get("id", "") for element in ElementTree.fromstring(svg).iter()}
        shown = {f"{POINT_ID}{point.number}" for point in frontier.points if _is_shown(point, name)}
        assert {one for one in ids if one.startswith(POINT_ID)} == shown


def test_other_kinds_of_files_are_refused(examples: Any) -> None:
    kind: Any = "gif"
    with pytest.raises(PictureError, match="gif"):
        pictures(examples.example_frontier(), kind)


def test_the_axis_of_latencies_ends_where_they_do(examples: Any) -> None:
    found, replace = examples.example_frontier(), msgspec.structs.replace
    never = Latency(1e9, 1e9, 1.0)
    points = [point for point in found.points if "latency" in point.fronts]
    late = {points[1].number: never}
    changed = [replace(point, latency=late.get(point.number, point.latency)) for point in found.points]
    figure = _drawn(replace(found, points=tuple(changed), picked=points[-1].number), "latency")
    low, high = figure.axes[0].get_xlim()
    shown = [point for point in changed if "latency" in point.fronts and point.latency.missed < 1]
    least = min(point.latency.mean_us for point in shown)
    assert least / 2 < low <= least
    assert high < 2 * max(*(point.latency.p99_us for point in shown), *(mark.latency_us or 0 for mark in found.marks))


def test_a_frontier_whose_joints_take_an_unknown_time_says_so_on_the_axis(examples: Any) -> None:
    found, replace = examples.example_frontier(), msgspec.structs.replace
    assert "left out" not in _drawn(found, "frontier").axes[0].get_xlabel()
    points = tuple(replace(point, transfer=Time(0.0, "unknown")) for point in found.points)
    unknown = replace(found, points=points)
    assert "reading the joints is left out" in _drawn(unknown, "frontier").axes[0].get_xlabel()
    assert "left out" not in _drawn(unknown, "switches").axes[0].get_xlabel()

"""What the sections are made of."""

import msgspec
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thenar.compiler.frontier.points import Frontier
from thenar.compiler.hand import HandShape
from thenar.compiler.placement.id3 import grow_id3
from thenar.compiler.report.charts import words
from thenar.compiler.report.confusion_view import WIDEST, confusion_view
from thenar.compiler.report.content import ReportContent
from thenar.compiler.report.frontier_charts import frontier_charts
from thenar.compiler.report.frontier_view import COLUMNS, frontier_view
from thenar.compiler.report.hand_picture import hand_picture
from thenar.compiler.report.placement_view import placement_view
from thenar.compiler.report.scan_view import scan_view
from thenar.compiler.report.tree_view import MOST_NODES, tree_view
from thenar.compiler.text import DASH


@given(arrays(np.intp, (4, 4), elements=st.integers(0, 50)))
def test_a_confusion_matrix_shows_every_count_and_shades_it_by_its_share_of_the_row(counts: np.ndarray) -> None:
    view = confusion_view("title", ("a", "b", "c", "d"), counts)
    for number, (row, line) in enumerate(zip(view.rows, counts.tolist(), strict=True)):
        assert [0 if cell.count == "·" else int(cell.count) for cell in row.cells] == line
        assert row.total == str(sum(line))
        for column, (cell, count) in enumerate(zip(row.cells, line, strict=True)):
            kind = "hit" if column == number else "miss"
            assert cell.shade == (f"{kind}{1 + 8 * count // sum(line)}" if count else "")


@given(arrays(np.intp, (4, 4), elements=st.integers(0, 50)))
def test_the_commonest_mistakes_are_named_first_and_hits_never(counts: np.ndarray) -> None:
    said = confusion_view("title", ("a", "b", "c", "d"), counts).mistaken
    wrong = sorted((count for place, count in np.ndenumerate(counts) if place[0] != place[1] and count), reverse=True)
    assert [int(sentence.split(": ")[1].split()[0]) for sentence in said] == wrong[:5]


def test_a_matrix_that_nobody_could_read_is_left_out_but_not_its_mistakes() -> None:
    size = WIDEST + 1
    view = confusion_view("title", tuple(map(str, range(size))), np.ones((size, size), np.intp))
    assert view.rows == ()
    assert len(view.mistaken) == 5


@given(st.integers(0, 2**32 - 1), st.integers(2, 7), st.integers(1, 400))
def test_the_list_of_a_tree_closes_what_it_opens(seed: int, inputs: int, rows: int) -> None:
    random = np.random.default_rng(seed)
    tree = grow_id3(random.random((rows, inputs)) < 0.5, random.integers(0, 3, rows))
    names, grasps = tuple(f"x{number}" for number in range(inputs)), ("a", "b", "c")
    view = tree_view(tree, names, grasps)
    depth = 0
    for node in view.nodes:
        assert depth == tree.depths[node.number]
        depth += 1 if node.opens else -node.closes
    assert depth == 0
    assert len(view.nodes) + sum(node.below for node in view.nodes) == len(tree.nodes)


def test_a_large_tree_is_shown_as_far_as_one_can_see_and_says_so() -> None:
    random = np.random.default_rng(3)
    tree = grow_id3(random.random((3000, 30)) < 0.5, random.integers(0, 5, 3000))
    view = tree_view(tree, tuple(f"x{number}" for number in range(30)), tuple("abcde"))
    assert MOST_NODES / 3 < len(view.nodes) <= MOST_NODES < len(tree.nodes)
    assert "thenar place --draw draws all of it" in view.sentence
    assert len(view.nodes) + sum(node.below for node in view.nodes) == len(tree.nodes)


def test_switches_stand_on_the_picture_where_they_lie_on_the_hand(hand: HandShape) -> None:
    kept = hand.names[5:2:-1]
    picture = hand_picture(hand, kept, "ident", "title", "summary")
    assert [dot.name for dot in picture.dots] == list(hand.names)
    places = np.array([[float(dot.x), -float(dot.y)] for dot in picture.dots])
    assert np.abs(places - hand.places).max() <= 0.05 + 1e-9
    assert {dot.name: dot.order for dot in picture.dots if dot.order} == {kept[0]: "1", kept[1]: "2", kept[2]: "3"}


def test_all_that_is_drawn_lies_in_the_view(hand: HandShape) -> None:
    left, top, width, height = map(float, hand_picture(hand, (), "i", "t", "s").view_box.split())
    points = np.concatenate([hand.outline, *hand.strips, hand.places, hand.labels]) * (1, -1)
    assert (points > (left, top)).all()
    assert (points < (left + width, top + height)).all()


def test_the_share_of_all_switches_together_is_what_the_tree_tells(bare: ReportContent) -> None:
    view = placement_view(bare.manifest, bare.tree, bare.hand)
    assert view.together
    assert view.sentences[0].startswith("The paper's ID3")
    rows = view.switches
    assert [row.name for row in rows] == list(bare.switch_names)
    assert [row.order for row in rows] == list(range(1, len(rows) + 1))
    shares = [float(row.share.split()[0]) for row in rows]
    assert shares == sorted(shares)
    assert 0 < shares[0] <= shares[-1] <= 100
    assert all(row.part in row.name for row in rows if row.part != "palm")


def test_a_placement_without_a_tree_names_its_method_and_shows_no_shares(bare: ReportContent) -> None:
    replace = msgspec.structs.replace
    options = replace(bare.manifest.options, placement="elimination", prune=0, keep=len(bare.manifest.switches))
    view = placement_view(replace(bare.manifest, options=options), None, bare.hand)
    assert not view.together
    assert all(not row.share for row in view.switches)
    assert view.no_tree == "No tree: the switches were chosen by elimination."
    assert view.sentences[0].endswith("(--placement elimination).")
    assert "together" not in view.sentences[1]


def test_a_point_that_misses_every_grasp_has_no_latency_to_show(frontier: Frontier) -> None:
    first, *others = frontier.points
    missing = msgspec.structs.replace(first.latency, mean_us=0.0, p99_us=0.0, missed=1.0)
    points = (msgspec.structs.replace(first, latency=missing), *others)
    changed = msgspec.structs.replace(frontier, points=points, skipped=("no tools were there",))
    view = frontier_view(changed, frontier.fingerprint, None)
    at = COLUMNS.index("Latency, µs")
    assert view.rows[0].cells[at : at + 3] == (DASH, DASH, "100.0")
    assert dict(view.details[0].facts)["Latency"] == DASH
    assert DASH not in view.rows[1].cells[at : at + 3]
    assert "No tools were there." in view.notes
    by_latency = msgspec.json.decode(frontier_charts(changed)[2].figure)
    assert set(by_latency["layout"]["meta"]["places"]) == {str(point.number) for point in others}


def test_the_point_that_the_build_is_comes_first(frontier: Frontier, hand: HandShape) -> None:
    for built in (frontier.points[0].number, frontier.points[-1].number):
        view = frontier_view(frontier, frontier.fingerprint, hand, built)
        assert [row.number for row in view.rows if row.picked] == [built]
        assert view.picked is not None
        assert view.picked.number == built
        assert f"This build is point {built}." in view.notes


def test_every_kept_switch_is_read_in_one_transaction(bare: ReportContent) -> None:
    assert bare.scan is not None
    assert bare.harness is not None
    view = scan_view(bare.scan, bare.harness, bare.switch_names, 2)
    assert sorted(name for each in view.transactions for name in each.switches.split(", ")) == sorted(bare.switch_names)
    assert any("CyberGlove" in sentence for sentence in view.sentences)


def test_plotly_gets_no_tags_out_of_names() -> None:
    assert words('<a href="x">b</a> & <br>') == '&lt;a href="x"&gt;b&lt;/a&gt; &amp; &lt;br&gt;'

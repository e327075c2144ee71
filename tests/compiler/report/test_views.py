"""What the sections are made of."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from msgspec.structs import replace as replaced

from thenar.compiler.frontier.points import Frontier
from thenar.compiler.placement.tree import grow_id3
from thenar.compiler.report.content import ReportContent
from thenar.compiler.report.frontier import marks_table, notes, points_table
from thenar.compiler.report.sections import (
    MOST_LINES,
    confusion_view,
    kept_table,
    placement_sentences,
    scan_table,
    term_bars,
    tree_text,
)


@given(arrays(np.intp, (4, 4), elements=st.integers(0, 50)))
def test_a_confusion_matrix_shows_counts_shaded_by_share_of_row(counts: np.ndarray) -> None:
    view = confusion_view("title", ("a", "b", "c", "d"), counts)
    for number, ((_, cells, total, _), line) in enumerate(zip(view.rows, counts.tolist(), strict=True)):
        assert [0 if shown == "·" else int(shown) for shown, _ in cells] == line
        assert total == str(sum(line))
        for column, ((_, shade), count) in enumerate(zip(cells, line, strict=True)):
            kind = "hit" if column == number else "miss"
            assert shade == (f"{kind}{1 + 8 * count // sum(line)}" if count else "")


@given(arrays(np.intp, (4, 4), elements=st.integers(0, 50)))
def test_the_commonest_mistakes_are_named_first_and_hits_never(counts: np.ndarray) -> None:
    said = confusion_view("title", ("a", "b", "c", "d"), counts).mistaken
    wrong = sorted((count for place, count in np.ndenumerate(counts) if place[0] != place[1] and count), reverse=True)
    assert [int(sentence.split(": ")[1].split()[0]) for sentence in said] == wrong[:5]


def test_the_tree_has_a_line_a_node_and_is_cut_if_large(bare: ReportContent) -> None:
    assert bare.tree is not None
    lines, said = tree_text(bare.tree, bare.manifest)
    assert len(lines.split("\n")) == len(bare.tree.nodes)
    assert all(name in lines for name in bare.switch_names)
    assert "shown" not in said
    random = np.random.default_rng(3)
    tree = grow_id3(random.random((6000, 30)) < 0.5, random.integers(0, 4, 6000))
    names = tuple(replaced(bare.manifest.switches[0], name=f"x{number}") for number in range(len(tree.inputs)))
    lines, said = tree_text(tree, replaced(bare.manifest, switches=names))
    assert len(lines.split("\n")) == MOST_LINES < len(tree.nodes)
    assert "thenar place --tree prints all of them" in said


def test_the_terms_are_drawn_the_weightiest_first(bare: ReportContent) -> None:
    bars = term_bars(bare)
    spans = [float(text.rpartition(" ")[2]) for text, _ in bars]
    assert spans == sorted(spans, reverse=True)
    assert [share for _, share in bars] == pytest.approx([span / spans[0] for span in spans], abs=0.01)
    names = {text.partition(",")[0] for text, _ in bars}
    assert names <= {*bare.switch_names, *(joint.name for joint in bare.manifest.joints)}


def test_the_share_of_all_switches_together_is_what_the_tree_tells(bare: ReportContent) -> None:
    table = kept_table(bare)
    assert table.columns[-1] == "Together"
    assert placement_sentences(bare)[0].startswith("The paper's ID3")
    orders, names, parts, *_, together = zip(*table.rows, strict=True)
    assert list(names) == list(bare.switch_names)
    assert list(map(int, orders)) == list(range(1, len(names) + 1))
    shares = [float(share.split()[0]) for share in together]
    assert shares == sorted(shares)
    assert 0 < shares[0] <= shares[-1] <= 100
    assert all(part in name for part, name in zip(parts, names, strict=True) if part != "palm")


def test_a_placement_without_a_tree_names_its_method_and_shows_no_shares(bare: ReportContent) -> None:
    options = {"placement": "elimination", "prune": 0, "keep": len(bare.manifest.switches)}
    chosen = msgspec.structs.replace(bare.manifest.options, **options)
    content = replace(bare, manifest=msgspec.structs.replace(bare.manifest, options=chosen), tree=None)
    assert "Together" not in kept_table(content).columns
    assert tree_text(content.tree, content.manifest) == ("", "No tree: the switches were chosen by elimination.")
    how, bits = placement_sentences(content)
    assert how.endswith("(--method elimination).")
    assert "together" not in bits


def test_the_section_names_its_machine_and_labels_guesses(frontier: Frontier) -> None:
    assert any(f"times on {frontier.machine}." in note for note in notes(frontier, None))
    marks = marks_table(frontier)
    assert marks is not None
    assert "guess" not in repr((points_table(frontier), marks, *notes(frontier, None)))
    guess = frontier.points[0].frame
    points = [replaced(point, frame=replaced(guess, us=point.frame.us, how="guess")) for point in frontier.points]
    guessed = replaced(frontier, points=tuple(points))
    marks = marks_table(guessed)
    assert marks is not None
    for table in (points_table(guessed), marks):
        assert [column for column in table.columns if column.startswith("Frame")] == ["Frame, µs (guess)"]


def test_the_section_has_a_row_a_point_and_names_that_of_the_build(frontier: Frontier) -> None:
    table = points_table(frontier)
    assert [row[0] for row in table.rows] == [str(point.number) for point in frontier.points]
    wirings = {row[table.columns.index("Wiring")] for row in table.rows}
    assert "board 1 Mbaud" in wirings
    assert "This build is point 2." in notes(frontier, 2)
    assert not any("This build" in note for note in notes(frontier, None))


def test_every_kept_switch_is_read_in_one_transaction(bare: ReportContent) -> None:
    assert bare.scan is not None
    assert bare.harness is not None
    table = scan_table(bare)
    assert table is not None
    read = [name for row in table.rows for name in row[table.columns.index("Switches")].split(", ")]
    assert sorted(read) == sorted(bare.switch_names)
    assert any(fact.label == "CyberGlove" for fact in bare.facts)

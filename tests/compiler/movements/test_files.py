"""Segments in a file: a table, read back by a program of its own kind."""

import csv
import io

import numpy as np
import pytest

from thenar.compiler.artifact.timeline import FoundSegment, Timeline, as_csv, probabilities

TYPES = ("pinch", "=hook")


def timeline(subject: str = "A", session: str = "1", start_us: int = 2_000_000) -> Timeline:
    states = np.array([2, 2, 0, 0, 0, 2, 1, 1, 2, 0])
    truth = np.array([2, 0, 0, 0, 2, 2, 1, 1, 1, 2])
    return Timeline(subject, session, start_us, 10_000, TYPES, states, np.linspace(0.1, 1.0, 10), truth)


def test_a_table_has_a_row_a_segment() -> None:
    rows = list(csv.reader(io.StringIO(as_csv([timeline(), timeline("B", "2")]).decode(), newline="")))
    assert tuple(rows[0]) == FoundSegment.__struct_fields__
    assert rows[1] == ["2.020000", "2.050000", "pinch", "0.4000", "A", "1"]
    # A type that a spreadsheet would compute is text.
    assert rows[2] == ["2.060000", "2.080000", "'=hook", "0.7500", "A", "1"]
    assert rows[3] == ["2.090000", "2.100000", "pinch", "1.0000", "A", "1"]
    assert [row[4:] for row in rows[4:]] == [["B", "2"]] * 3


def test_a_table_of_nothing_has_its_head() -> None:
    assert as_csv([]).decode() == ",".join(FoundSegment.__struct_fields__) + "\n"


def test_a_probability_is_the_softmax_of_the_state() -> None:
    scores = np.array([[0, 100, 50], [200, 0, 0]])
    found = probabilities(scores, np.array([1, 3]), 50.0)
    assert found[0] == pytest.approx(np.exp(2) / (np.exp(0) + np.exp(2) + np.exp(1)))
    # Nothing held, which has no score.
    assert found[1] == 0

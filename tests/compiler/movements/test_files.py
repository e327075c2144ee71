"""Segments in files: a table and MCAP, each read back by a program of its own kind."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from thenar.compiler.artifact.timeline import TOPIC, WRITERS, FoundSegment, Timeline, probabilities, write

TYPES = ("pinch", "=hook")


def timeline(subject: str = "A", session: str = "1", start_us: int = 2_000_000) -> Timeline:
    states = np.array([2, 2, 0, 0, 0, 2, 1, 1, 2, 0])
    truth = np.array([2, 0, 0, 0, 2, 2, 1, 1, 1, 2])
    return Timeline(subject, session, start_us, 10_000, TYPES, states, np.linspace(0.1, 1.0, 10), truth)


def test_a_table_has_a_row_a_segment(tmp_path: Path) -> None:
    write(tmp_path / "s.csv", [timeline(), timeline("B", "2")])
    with (tmp_path / "s.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert tuple(rows[0]) == FoundSegment.__struct_fields__
    assert rows[1] == ["2.020000", "2.050000", "pinch", "0.4000", "A", "1"]
    # A type that a spreadsheet would compute is text.
    assert rows[2] == ["2.060000", "2.080000", "'=hook", "0.7500", "A", "1"]
    assert rows[3] == ["2.090000", "2.100000", "pinch", "1.0000", "A", "1"]
    assert [row[4:] for row in rows[4:]] == [["B", "2"]] * 3


def test_mcap_annotations_are_read_by_the_library(tmp_path: Path) -> None:
    write(tmp_path / "s.mcap", [timeline(), timeline("B", "2", 2_015_000)])
    with (tmp_path / "s.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        read = list(reader.iter_messages())
    assert {channel.topic for _, channel, _ in read} == {TOPIC}
    assert [json.loads(message.data)["subject"] for *_, message in read] == ["A", "B"] * 3
    schema, _, message = read[0]
    assert schema is not None
    known = json.loads(schema.data)
    one = json.loads(message.data)
    assert set(known["properties"]) == set(one) == set(FoundSegment.__struct_fields__)
    assert (one["type"], message.log_time) == ("pinch", 2_020_000_000)


@pytest.mark.parametrize("ending", WRITERS)
def test_files_of_nothing_and_equal_files_are_equal(ending: str, tmp_path: Path) -> None:
    paths = [tmp_path / f"{number}{ending}" for number in range(2)]
    for path in paths:
        write(path, [timeline()])
    assert paths[0].read_bytes() == paths[1].read_bytes()
    write(tmp_path / f"none{ending}", [])
    assert (tmp_path / f"none{ending}").stat().st_size > 0


def test_a_probability_is_the_softmax_of_the_state() -> None:
    scores = np.array([[0, 100, 50], [200, 0, 0]])
    found = probabilities(scores, np.array([1, 3]), 50.0)
    assert found[0] == pytest.approx(np.exp(2) / (np.exp(0) + np.exp(2) + np.exp(1)))
    # Nothing held, which has no score.
    assert found[1] == 0

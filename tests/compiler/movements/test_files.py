"""Segments in files: a table, a document of ELAN, and MCAP, each read back by a program of its own kind."""

import csv
import json
from pathlib import Path
from xml.etree import ElementTree

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


def test_an_elan_document_has_what_elan_needs(tmp_path: Path) -> None:
    write(tmp_path / "s.eaf", [timeline(), timeline("B", "2", 2_100_000), timeline("A", "1", 5_000_000)])
    root = ElementTree.parse(tmp_path / "s.eaf").getroot()
    # The order of elements, and the attributes that EAFv3.0.xsd requires.
    assert root.tag == "ANNOTATION_DOCUMENT"
    assert {"AUTHOR", "DATE", "VERSION"} <= set(root.attrib)
    tags = [each.tag for each in root]
    tiers = root.findall("TIER")
    assert tags == ["HEADER", "TIME_ORDER", *["TIER"] * len(tiers), "LINGUISTIC_TYPE"]
    assert root.find("HEADER").attrib["TIME_UNITS"] == "milliseconds"  # type: ignore[union-attr]
    slots = {each.attrib["TIME_SLOT_ID"]: int(each.attrib["TIME_VALUE"]) for each in root.iter("TIME_SLOT")}
    assert list(slots.values()) == sorted(slots.values())
    assert len(slots) == len(set(slots)) > 0
    kinds = {each.attrib["LINGUISTIC_TYPE_ID"] for each in root.findall("LINGUISTIC_TYPE")}
    names = [tier.attrib["TIER_ID"] for tier in tiers]
    assert names == ["A", "A, true", "B 2", "B 2, true", "A, part 2", "A, part 2, true"]
    assert {tier.attrib["LINGUISTIC_TYPE_REF"] for tier in tiers} <= kinds
    identifiers = [each.attrib["ANNOTATION_ID"] for each in root.iter("ALIGNABLE_ANNOTATION")]
    assert len(identifiers) == len(set(identifiers)) == 3 * (3 + 2)
    for tier in tiers:
        last = 0
        for each in tier.iter("ALIGNABLE_ANNOTATION"):
            begin, end = (slots[each.attrib[f"TIME_SLOT_REF{number}"]] for number in (1, 2))
            assert last <= begin < end
            last = end
    first = root.find("TIER/ANNOTATION/ALIGNABLE_ANNOTATION")
    assert first is not None
    assert first.findtext("ANNOTATION_VALUE") == "pinch"
    assert slots[first.attrib["TIME_SLOT_REF1"]] == 20


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

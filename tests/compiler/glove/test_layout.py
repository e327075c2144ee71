"""The bundles of wire: one signal a switch, colours that tell wires apart, lengths that reach."""

from collections import Counter
from math import dist

import pytest

from thenar.compiler.glove.propose import propose_board, propose_harness
from thenar.compiler.glove.spec import SpecSummary, glove_spec
from thenar.compiler.hand import HandShape

from .conftest import manifest_of


@pytest.fixture(scope="module", params=[1, 33, 160])
def summary(request: pytest.FixtureRequest, hand: HandShape) -> SpecSummary:
    return glove_spec(manifest_of(hand.names[: request.param]), hand=hand).summary


def test_every_switch_has_one_signal_and_one_return(summary: SpecSummary) -> None:
    signals = Counter(n for wire in summary.wires if wire.unit for n in wire.switches)
    returns = Counter(n for wire in summary.wires if not wire.unit for n in wire.switches)
    assert signals == returns == Counter(range(1, len(summary.sensors) + 1))
    assert all(len(wire.switches) == 1 for wire in summary.wires if wire.unit)


def test_the_signals_of_a_bundle_come_in_the_switches_order(hand: HandShape) -> None:
    """Pins are taken in the opposite order, so that the order of the chips' pins cannot stand in for it."""
    names = hand.names[:20]
    summary = glove_spec(manifest_of(names), None, propose_harness(names[::-1]), hand).summary
    for bundle in {wire.bundle for wire in summary.wires}:
        numbers = [wire.switches for wire in summary.wires if wire.bundle == bundle and wire.unit]
        assert numbers == sorted(numbers)


def test_a_return_is_shared_within_one_digit_and_one_chip(summary: SpecSummary) -> None:
    read_by = {n: reader.ref for reader in summary.readers for n in reader.switches}
    for wire in summary.wires:
        assert {summary.sensors[n - 1].part for n in wire.switches} == {wire.bundle}
        assert len({read_by[n] for n in wire.switches}) == 1


def test_no_two_wires_of_a_bundle_look_alike(summary: SpecSummary) -> None:
    looks = [(wire.bundle, wire.colour) for wire in summary.wires]
    assert len(set(looks)) == len(looks)
    assert all(wire.colour.startswith("black") != bool(wire.unit) for wire in summary.wires)


def test_connectors_have_pins_from_one_on_and_no_more_than_headers_have(summary: SpecSummary) -> None:
    for connector in {wire.connector for wire in summary.wires}:
        pins = [wire.pin for wire in summary.wires if wire.connector == connector]
        assert pins == list(range(1, len(pins) + 1))
        assert len(pins) <= 40


def test_a_wire_is_longer_than_the_way_to_its_farthest_switch(summary: SpecSummary, hand: HandShape) -> None:
    home = hand.wrist
    for wire in summary.wires:
        places = [(summary.sensors[n - 1].x_mm, summary.sensors[n - 1].y_mm) for n in wire.switches]
        straight = max(dist(home, (x, y)) for x, y in places if x is not None and y is not None)
        assert wire.length_mm is not None
        assert 1.25 * straight + 40 <= wire.length_mm
        assert len(places) > 1 or wire.length_mm < 1.25 * straight + 46


def test_without_a_hand_there_are_bundles_by_chip_and_no_lengths() -> None:
    names = [f"s{number}" for number in range(20)]
    summary = glove_spec(manifest_of(names), None, propose_harness(names)).summary
    assert [wire.bundle for wire in summary.wires] == ["U1"] * 15 + ["U2"] * 7
    assert {wire.length_mm for wire in summary.wires} == {None}
    assert not [line for line in summary.materials if line.unit == "m"]


def test_a_large_bundle_has_several_connectors() -> None:
    names = [f"s{number}" for number in range(60)]
    wires = glove_spec(manifest_of(names), None, propose_board(names)).summary.wires
    assert [(wire.connector, wire.pin) for wire in wires] == [
        *(("J1", pin) for pin in range(1, 41)),
        *(("J2", pin) for pin in range(1, 22)),
    ]

from itertools import combinations_with_replacement

import pytest

from thenar.compiler.glove.propose import propose_harness
from thenar.drivers.i2c.chips import CHIPS, expanders
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.checks import faults
from thenar.runtime.harness.wiring import GloveWiring, MuxChannel
from thenar.runtime.scanning.ports import whole_scan

from ..conftest import names_of

KINDS = sorted(expanders())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", [0, 1, 7, 8, 13, 16, 17, 21, 24, 40])
def test_proposed_chips_need_the_fewest_transactions_and_least_time(kind: str, count: int) -> None:
    harness = propose_harness(names_of(count), kind)
    assert not list(faults(harness))
    assert sorted(harness.switches) == sorted(names_of(count))
    ports = whole_scan(harness, names_of(count)).ports
    periods = [_periods(kind, port.reading) for port in ports]
    # Each transaction is of a chip of its own: any multiset of readings whose inputs suffice is a way.
    chip = CHIPS[kind]
    inputs = {
        reading.name: sum(chip.pins[pin] not in chip.not_inputs for pin in reading.pins) for reading in chip.readings
    }
    assert all(
        sum(inputs[name] for name in ways) < count
        for ways in combinations_with_replacement(inputs, max(len(ports) - 1, 0))
        if ports
    )
    enough = [
        sum(_periods(kind, name) for name in ways)
        for ways in combinations_with_replacement(inputs, len(ports))
        if sum(inputs[name] for name in ways) >= count
    ]
    assert sum(periods) == min(enough)


def _periods(kind: str, reading: str) -> int:
    return next(each.scl_periods for each in CHIPS[kind].readings if each.name == reading)


@pytest.mark.parametrize("kind", KINDS)
def test_any_number_of_switches_is_sound_until_there_is_no_room(kind: str) -> None:
    chip = CHIPS[kind]
    room = 64 // 8 * len(chip.addresses) * max(len(ports) for ports in _inputs(kind))
    for count in (room // 7, room // 3, room - 1, room):
        harness = propose_harness(names_of(count), kind)
        assert not list(faults(harness))
        assert harness.switches == tuple(names_of(count))
    with pytest.raises(HarnessError, match="choose a chip with more pins"):
        propose_harness(names_of(room + 1), kind)


def _inputs(kind: str) -> list[list[str]]:
    chip = CHIPS[kind]
    return [[chip.pins[pin] for pin in r.pins if chip.pins[pin] not in chip.not_inputs] for r in chip.readings]


def test_the_first_names_are_on_the_first_chips_and_before_the_mux() -> None:
    (bus,) = propose_harness(names_of(160)).buses
    assert [chip.mux for chip in bus.chips] == [
        *[None] * 4,
        *[MuxChannel(address=0x70, channel=0)] * 4,
        *[MuxChannel(address=0x70, channel=1)] * 4,
    ]
    assert list(bus.chips[0].pins.values()) == names_of(14)
    assert list(bus.chips[11].pins) == ["GPA0", "GPA1", "GPA2", "GPA3", "GPA4", "GPA5"]
    assert bus.clock_hz == 400_000


def test_the_clock_is_one_that_the_chip_can_follow() -> None:
    assert propose_harness(names_of(3), "pcf8574").buses[0].clock_hz == 100_000


def test_the_cyberglove_goes_with_it_and_without_switches_there_is_no_bus() -> None:
    glove = GloveWiring(port="/dev/ttyUSB0")
    harness = propose_harness([], name="joints only", cyberglove=glove)
    assert (harness.name, harness.buses, harness.cyberglove) == ("joints only", (), glove)


def test_a_kind_that_there_is_not_is_told_the_nearest() -> None:
    with pytest.raises(HarnessError, match=r"no chip 'mcp23016' \(did you mean 'mcp23017'"):
        propose_harness(names_of(3), "mcp23016")

"""The fewest transactions, and of as few the shortest: against all sets of readings that there are."""

from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.runtime.harness.checks import faults
from thenar.runtime.scanning.ports import ports_of
from thenar.runtime.scanning.timing import port_us, reading_of

from .conftest import harnesses


@given(data=st.data())
def test_no_set_of_readings_is_smaller_or_as_small_and_shorter(data: st.DataObject) -> None:
    harness = data.draw(harnesses())
    assert not list(faults(harness))
    wanted = data.draw(st.sets(st.sampled_from(harness.switches))) if harness.switches else set()
    wired = [(bus, chip) for bus in harness.buses for chip in bus.chips]
    on_chips = wanted & {name for _, chip in wired for name in chip.pins.values()}
    # Every reading of every chip: what it takes, and the switches that it shows.
    readings = [
        (
            port_us(reading, bus.clock_hz),
            {chip.numbered_pins[pin] for pin in reading.pins if pin in chip.numbered_pins},
        )
        for bus, chip in wired
        for reading in chip.chip.readings
    ]
    best = min(
        (count, sum(us for us, _ in some))
        for count in range(len(readings) + 1)
        for some in combinations(readings, count)
        if on_chips <= set[str]().union(*(shown for _, shown in some))
    )
    names = sorted(wanted)
    ports = ports_of(harness, {name: number for number, name in enumerate(names)}, {})
    us = sum(port_us(reading_of(port, harness), harness.buses[port.bus].clock_hz) for port in ports)
    assert (len(ports), us) == pytest.approx(best)
    # Each wanted switch is read once, from the pin that it hangs on; no transaction is without one.
    read = [(port, bit, names[number]) for port in ports for bit, number in port.switches]
    assert sorted(name for _, _, name in read) == sorted(on_chips)
    assert all(port.switches for port in ports)
    for port, bit, name in read:
        chip = harness.buses[port.bus].chips[port.chip]
        assert chip.numbered_pins[reading_of(port, harness).pins[bit]] == name
        assert port.closed_high == (chip.closed == "high")

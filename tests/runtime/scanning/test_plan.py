"""The scan map of a build and a harness, against brute force where there are few enough ways."""

from collections.abc import Sequence
from itertools import permutations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.compiler.scan_file import scanmap_from_bytes, scanmap_to_bytes
from thenar.runtime.errors import HarnessError
from thenar.runtime.harness.wiring import Harness, MuxChannel
from thenar.runtime.scanning.plan import plan_scan
from thenar.runtime.scanning.scanmap import Port
from thenar.runtime.scanning.timing import reading_of, scan_us

from .conftest import eight_chips, harnesses


def names_of(count: int) -> list[str]:
    return [f"s{number}" for number in range(count)]


def mux_writes(ports: Sequence[Port], harness: Harness) -> int:
    """What a driver writes to muxes in the second of two scans: it remembers what it selected, bus by bus."""
    writes = 0
    selected: dict[int, MuxChannel] = {}
    for scan in range(2):
        writes = 0
        for port in ports:
            mux = harness.buses[port.bus].chips[port.chip].mux
            if mux is None or selected.get(port.bus) == mux:
                continue
            before = selected.get(port.bus)
            writes += 1 + (before is not None and before.address != mux.address) if scan else 0
            selected[port.bus] = mux
    return writes


@settings(deadline=None)
@given(data=st.data())
def test_every_kept_switch_is_read_once_with_the_fewest_writes_to_muxes(data: st.DataObject) -> None:
    harness = data.draw(harnesses())
    kept = data.draw(st.lists(st.sampled_from(harness.switches), unique=True)) if harness.switches else []
    scan = plan_scan(kept, harness)
    assert sorted(scan.switches) == [*range(len(kept))]
    for port in scan.ports:
        chip = harness.buses[port.bus].chips[port.chip]
        for bit, number in port.switches:
            assert chip.numbered_pins[reading_of(port, harness).pins[bit]] == kept[number]
    for stream, read in zip(harness.streams, scan.streams, strict=True):
        assert all(stream.switches[place] == kept[number] for place, number in read.switches)
    if len(scan.ports) <= 6:
        least = min(mux_writes(some, harness) for some in permutations(scan.ports))
        assert scan_us(scan, harness).selects == mux_writes(scan.ports, harness) == least
    assert scanmap_from_bytes(scanmap_to_bytes(scan)) == scan


def test_switches_that_are_wired_to_nothing_are_named() -> None:
    names = [*names_of(14), *(f"t{number}" for number in range(7))]
    with pytest.raises(
        HarnessError, match=r"'full' has no pin or column for t0, t1, t2, t3, t4 and 2 more, which the build"
    ):
        plan_scan(names, eight_chips(1))


def test_ports_behind_one_channel_and_one_mux_stay_together() -> None:
    (bus,) = eight_chips(24).buses
    chips = tuple(
        replace(chip, address=0x20 + number % 8, mux=MuxChannel(address=0x70 + number // 16, channel=number // 8))
        for number, chip in enumerate(bus.chips)
    )
    harness = Harness(name="x", buses=(replace(bus, chips=chips),))
    names = [f"s{14 * number}" for number in range(24)]
    scan = plan_scan(names, harness)
    assert len(scan.ports) == 24
    assert scan_us(scan, harness).selects == 5  # three channels, and two muxes to take turns

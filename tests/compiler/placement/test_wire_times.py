"""What ports cost one after the other, in nanoseconds, and what belongs together."""

from itertools import chain

import pytest

from thenar.compiler.placement.ports import WireTimes
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.scanning.plan import units_of
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.timing import scan_us

from ...gloves import behind

READ, WRITE = 98_800, 51_300  # one port of a PCA9555, one write to a mux, at 400 kHz


def times_of(*places: tuple[int, int] | None) -> tuple[WireTimes, tuple[tuple[int, ...], ...], Harness]:
    harness = behind(*places)
    ports = whole_scan(harness, harness.switches).ports
    return WireTimes(ports, harness), units_of(ports, harness), harness


def test_a_muxs_first_port_pays_for_leaving_the_other_mux() -> None:
    times, units, _ = times_of((0x70, 1), (0x71, 1), (0x70, 2))
    assert units == ((0, 2), (1,))
    assert times.after(0, 0) == READ + 2 * WRITE
    assert times.after(0b001, 2) == READ + WRITE
    assert times.after(0b001, 1) == READ + 2 * WRITE


@pytest.mark.parametrize("places", [((0x70, 1), None, (0x70, 2)), ((0x70, 1), (0x71, 1), (0x70, 2), (0x71, 0))])
def test_all_ports_together_cost_what_a_scan_takes(places: tuple[tuple[int, int] | None, ...]) -> None:
    times, units, harness = times_of(*places)
    scan = scan_us(whole_scan(harness, harness.switches), harness)
    read = total = 0
    ports = [*chain(*units)]
    for port in ports:
        total += times.after(read, port)
        read |= 1 << port
    assert total == times.of(ports) == round(1000 * scan.us)

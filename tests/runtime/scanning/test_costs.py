"""What ports cost one after the other, in nanoseconds, and what belongs together."""

import pytest

from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Harness, MuxChannel
from thenar.runtime.scanning.plan import Costs, ports_in
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.timing import scan_us

READ, WRITE = 98_800, 51_300  # one port of a PCA9555, one write to a mux, at 400 kHz


def costs_of(*places: tuple[int, int] | None) -> tuple[Costs, Harness]:
    """A PCA9555 with one switch in each place: straight on the bus, or behind a channel of a mux."""
    chips = tuple(
        ChipWiring(
            kind="pca9555",
            address=0x20 + number,
            mux=None if place is None else MuxChannel(address=place[0], channel=place[1]),
            pins={"P00": f"s{number}"},
        )
        for number, place in enumerate(places)
    )
    harness = Harness(name="x", buses=(BusWiring(device="d", clock_hz=400_000, chips=chips),))
    return Costs(whole_scan(harness, harness.switches).ports, harness), harness


def test_a_muxs_first_port_pays_for_leaving_the_other_mux() -> None:
    costs, _ = costs_of((0x70, 1), (0x71, 1), (0x70, 2))
    assert costs.units == (((0,), (2,)), ((1,),))
    assert costs.after(0, 0) == READ + 2 * WRITE
    assert costs.after(0b001, 2) == READ + WRITE
    assert costs.after(0b001, 1) == READ + 2 * WRITE


@pytest.mark.parametrize("places", [((0x70, 1), None, (0x70, 2)), ((0x70, 1), (0x71, 1), (0x70, 2), (0x71, 0))])
def test_all_ports_together_cost_what_a_scan_takes(places: tuple[tuple[int, int] | None, ...]) -> None:
    costs, harness = costs_of(*places)
    scan = scan_us(whole_scan(harness, harness.switches), harness)
    read = total = 0
    for port in ports_in(costs.units):
        total += costs.after(read, port)
        read |= 1 << port
    assert total == costs.of(costs.units) == round(1000 * scan.us)

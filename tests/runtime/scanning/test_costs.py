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


def test_ports_straight_on_the_bus_are_units_of_their_own_and_cost_their_reading() -> None:
    costs, _ = costs_of(None, None)
    assert costs.units == (((0,),), ((1,),))
    assert [costs.after(read, port) for read, port in ((0, 0), (1, 1), (0, 1))] == [READ] * 3


def test_one_channel_alone_needs_no_selection_and_binds_nothing() -> None:
    costs, _ = costs_of((0x70, 3), None, (0x70, 3))
    assert costs.units == (((0,),), ((1,),), ((2,),))
    assert costs.after(0, 0) == READ


def test_the_first_port_behind_a_channel_pays_for_its_selection_and_the_next_do_not() -> None:
    costs, _ = costs_of((0x70, 1), (0x70, 2), (0x70, 1))
    assert costs.units == (((0, 2),), ((1,),))
    assert costs.after(0, 0) == READ + WRITE
    assert costs.after(0b010, 0) == READ + WRITE
    assert costs.after(0b001, 2) == READ
    assert costs.after(0b001, 1) == READ + WRITE


def test_of_two_muxes_each_stays_together_and_its_first_port_pays_for_leaving_the_other() -> None:
    costs, _ = costs_of((0x70, 1), (0x71, 1), (0x70, 2))
    assert costs.units == (((0,), (2,)), ((1,),))
    assert costs.after(0, 0) == READ + 2 * WRITE
    assert costs.after(0b001, 2) == READ + WRITE
    assert costs.after(0b001, 1) == READ + 2 * WRITE


def test_a_unit_costs_its_ports_and_the_writes_that_it_alone_needs() -> None:
    costs, _ = costs_of((0x70, 1), (0x71, 1), (0x70, 2), (0x70, 2))
    (first, second) = costs.units
    assert costs.of(first) == 3 * READ + 3 * WRITE  # mux 0x70 and two channels
    assert costs.of((2, 3)) == 2 * READ + WRITE
    assert costs.of(3) == READ
    assert costs.of(second) == READ + 2 * WRITE


@pytest.mark.parametrize("places", [((0x70, 1), None, (0x70, 2)), ((0x70, 1), (0x71, 1), (0x70, 2), (0x71, 0))])
def test_all_ports_together_cost_what_a_scan_takes(places: tuple[tuple[int, int] | None, ...]) -> None:
    costs, harness = costs_of(*places)
    scan = scan_us(whole_scan(harness, harness.switches), harness)
    read = total = 0
    for port in ports_in(costs.units):
        total += costs.after(read, port)
        read |= 1 << port
    assert total == costs.of(costs.units) == round(1000 * scan.us)

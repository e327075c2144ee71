from collections.abc import Callable

import pytest
from msgspec.structs import replace

from thenar.compiler.frontier.timing.wire_check import _seen_us, check_wire
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Harness, MuxChannel
from thenar.runtime.scanning.propose import propose_board


def two_muxes() -> Harness:
    places = [None, (0x70, 0), (0x70, 3), (0x71, 5)]
    chips = tuple(
        ChipWiring(
            kind="pca9555",
            address=0x20 + number,
            mux=None if place is None else MuxChannel(address=place[0], channel=place[1]),
            pins={"P00": f"a{number}", "P13": f"b{number}"},
        )
        for number, place in enumerate(places)
    )
    return Harness(name="two muxes", buses=(BusWiring(device="/dev/i2c-1", clock_hz=400_000, chips=chips),))


@pytest.fixture
def umockdev(tool: Callable[[str], str]) -> None:
    tool("umockdev-wrapper")


@pytest.mark.usefixtures("umockdev")
def test_the_arithmetic_is_that_of_an_emulated_bus_to_the_last_period_of_scl() -> None:
    (found,), lack = check_wire(replace(two_muxes(), scanners=propose_board(["key"]).scanners))
    assert lack is None
    # Five sizes of nine sorts of new gloves; the one at 1 MHz has no room for the largest.
    assert (found.n, found.how) == (1 + 5 * 9 - 1, "wire")
    assert found.worst_error < 1e-12


def test_without_umockdev_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    checks, lack = check_wire()
    assert checks == ()
    assert lack is not None
    assert "umockdev" in lack


@pytest.mark.usefixtures("umockdev", "hostile_folder")
def test_no_module_of_the_current_folder_runs_in_the_client_of_the_buses() -> None:
    assert _seen_us([replace(bus, device="/dev/i2c-0") for bus in two_muxes().buses])

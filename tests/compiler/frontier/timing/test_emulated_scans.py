"""Compare the arithmetic of scan times with real transactions: the driver on emulated buses, which count SCL periods.

The driver runs in a separate process, this very module, since umockdev shows its device nodes to no other. The first
line on stdin is a harness as JSON; the reply follows when its buses are open and were scanned once. Every further line
scans each bus _SCANS times.
"""

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack

import msgspec
import pytest
from msgspec.structs import replace

from thenar.compiler.frontier.wirings import BOARD, wirings
from thenar.compiler.glove.propose import propose_board
from thenar.drivers.emulated.i2c import EmulatedBus, EmulatedChip, EmulatedI2c, WireCounters
from thenar.drivers.errors import DeviceError
from thenar.drivers.i2c.bus import I2cBus, PlacedPort, Scan
from thenar.drivers.i2c.supervisor import PlacedChip, Route
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Harness, MuxChannel
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.timing import free_us, reading_of, scan_us

# Numbers of switches on new gloves; the most need muxes.
_SIZES = (8, 20, 33, 66, 115)
_SCANS = 2
# Checks of the chips' registers are traffic that belongs to no scan.
_NEVER_S = 3600.0


def scan_errors(given: Harness) -> list[float]:
    """Return the relative errors of the arithmetic on the buses of the given harness, and on those of new gloves of
    several sizes, with every kind of chip and at every clock that a frontier tries.

    Each bus is scanned by the driver as on a Raspberry Pi 4: one read a transfer. Takes a few seconds.
    """
    buses = _renamed([*given.buses, *_new_buses()])
    return [abs(_predicted_us(bus) - seen) / seen for bus, seen in zip(buses, _seen_us(buses), strict=True)]


def _new_buses() -> Iterator[BusWiring]:
    for wiring in wirings(None):
        for size in _SIZES:
            names = [f"s{number}" for number in range(size)]
            if wiring.name != BOARD and wiring.fits(names):
                yield from wiring.harness_of(names).buses


def _renamed(buses: Sequence[BusWiring]) -> tuple[BusWiring, ...]:
    """Return the buses with chips, each with a unique device and unique switches."""
    return tuple(
        replace(
            bus,
            device=f"/dev/i2c-{number}",
            chips=tuple(
                replace(chip, pins={pin: f"{number} {name}" for pin, name in chip.pins.items()}) for chip in bus.chips
            ),
        )
        for number, bus in enumerate(bus for bus in buses if bus.chips)
    )


def _predicted_us(bus: BusWiring) -> float:
    harness = Harness(name="predicted", buses=(bus,))
    return scan_us(whole_scan(harness, harness.switches), harness).us


def _seen_us(buses: Sequence[BusWiring]) -> list[float]:
    """Return the scan time of each bus by the SCL periods and the transfers that the bus itself counts."""
    harness = Harness(name="emulated", buses=tuple(buses))
    with EmulatedI2c([_emulated(bus) for bus in buses]) as emulated, _client(emulated) as client:
        _tell(client, msgspec.json.encode(harness))
        before = [emulated.counters(number) for number in range(len(buses))]
        _tell(client, b"")
        after = [emulated.counters(number) for number in range(len(buses))]
    each = zip(before, after, buses, strict=True)
    return [_between_us(then, now, bus.clock_hz) / _SCANS for then, now, bus in each]


def _between_us(before: WireCounters, after: WireCounters, clock_hz: int) -> float:
    periods, transfers = after.scl_periods - before.scl_periods, after.transfers - before.transfers
    return periods * 1e6 / clock_hz + transfers * free_us(clock_hz)


def _emulated(bus: BusWiring) -> EmulatedBus:
    chips = (EmulatedChip(chip.kind, chip.address, *_behind(chip)) for chip in bus.chips)
    return EmulatedBus(bus.device, bus.clock_hz, "bcm2835", tuple(chips), paced=False)


def _client(emulated: EmulatedI2c) -> "subprocess.Popen[bytes]":
    # -P: modules of the current folder must not be imported.
    command = [sys.executable, "-P", __file__]
    seen = os.environ | emulated.environment
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=seen)


def _tell(client: "subprocess.Popen[bytes]", line: bytes) -> None:
    """Send a line and wait until it is done. Raises DeviceError if the client ends over it."""
    assert client.stdin is not None
    assert client.stdout is not None
    client.stdin.write(line + b"\n")
    client.stdin.flush()
    if not client.stdout.readline():
        raise DeviceError("the emulated I2C buses could not be scanned: is another umockdev in the way?")


def main() -> None:
    """Serve the lines on stdin, and reply to each with an empty line."""
    harness = msgspec.json.decode(sys.stdin.readline(), type=Harness)
    with ExitStack() as stack:
        scans = [_scan_of(harness, number, stack) for number in range(len(harness.buses))]
        _read(scans, 1)
        for _ in sys.stdin:
            _read(scans, _SCANS)


def _scan_of(harness: Harness, number: int, stack: ExitStack) -> Scan:
    wiring = harness.buses[number]
    chips = [
        PlacedChip(
            chip.chip,
            chip.address,
            frozenset(chip.numbered_pins),
            Route(chip.mux.address, chip.mux.channel) if chip.mux else None,
        )
        for chip in wiring.chips
    ]
    bus = stack.enter_context(I2cBus(wiring.device, chips, check_every_s=_NEVER_S))
    bus.open()
    ports = whole_scan(harness, harness.switches).ports
    return bus.prepare(
        [PlacedPort(chips[port.chip], reading_of(port, harness)) for port in ports if port.bus == number]
    )


def _behind(chip: ChipWiring) -> tuple[int, int] | tuple[None, None]:
    """Return the address of the mux and the channel that a chip is behind."""
    return (None, None) if chip.mux is None else (chip.mux.address, chip.mux.channel)


def _read(scans: list[Scan], times: int) -> None:
    for scan in scans:
        for _ in range(times):
            if None in scan.read():
                sys.exit("a chip of the emulated bus did not reply")
    print(flush=True)


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
def umockdev() -> None:
    from ....conftest import tool  # here, as the module is a program too

    tool("umockdev-wrapper")


@pytest.mark.usefixtures("umockdev")
def test_scan_times_are_those_of_an_emulated_bus_to_one_period() -> None:
    errors = scan_errors(replace(two_muxes(), streams=propose_board(["key"]).streams))
    # Five sizes of nine sorts of new gloves; the one at 1 MHz has no room for the largest.
    assert len(errors) == 1 + 5 * 9 - 1
    assert max(errors) < 1e-12


if __name__ == "__main__":
    main()

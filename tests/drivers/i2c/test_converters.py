"""Conversions, on an emulated wire in this process and in its time."""

from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thenar.drivers.emulated.i2c_wire import Adapter, Message, Station, Wire
from thenar.drivers.i2c import bus as module
from thenar.drivers.i2c import supervisor
from thenar.drivers.i2c.bus import I2cBus, PlacedPort
from thenar.drivers.i2c.chips import CHIPS
from thenar.drivers.i2c.node import DeviceNode, Query, Run
from thenar.drivers.i2c.supervisor import PlacedChip, Route
from thenar.runtime.harness.wiring import BusWiring, ChipWiring, Harness, MuxChannel
from thenar.runtime.scanning.plan import plan_scan
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.scanmap import Port
from thenar.runtime.scanning.timing import reading_of, scan_us

CLOCK_HZ = 400_000
Place = tuple[str, int, int | None, int | None]  # kind, address, mux, channel


class World:
    """A wire whose time passes by what goes over it, and by what its driver sleeps."""

    def __init__(self, *places: Place) -> None:
        self.now = 1000.0
        self.stations = [Station(CHIPS[kind].model, address, mux, channel) for kind, address, mux, channel in places]
        for station in self.stations:
            station.device.clock = self.clock  # type: ignore[attr-defined]
        self.adapter = Adapter(Wire(self.stations, CLOCK_HZ), "bcm2835")

    def clock(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds

    def transfer(self, messages: list[Message]) -> list[bytes]:
        wire = self.adapter.wire
        before = wire.scl_periods, wire.transfers
        try:
            return self.adapter.rdwr(messages)
        finally:
            self.now += wire.duration_s(wire.scl_periods - before[0], wire.transfers - before[1])


class WorldNode(DeviceNode):
    world: World

    @property
    def is_open(self) -> bool:
        return True

    def open(self) -> None:
        pass

    def claim(self, address: int) -> None:
        pass

    def write(self, address: int, data: bytes) -> None:
        self.world.transfer([Message(address, data)])

    def prepare(self, queries: Sequence[Query]) -> Run:
        def run() -> list[bytes]:
            messages = []
            for query in queries:
                messages += [Message(query.address, query.command)] if query.command else []
                messages.append(Message(query.address, None, query.length))
            answers = self.world.transfer(messages)
            return [answer for answer, message in zip(answers, messages, strict=True) if message.data is None]

        return run


def opened(monkeypatch: pytest.MonkeyPatch, world: World, places: Sequence[Place]) -> I2cBus:
    WorldNode.world = world
    monkeypatch.setattr(module, "DeviceNode", WorldNode)
    for each in (module, supervisor):
        monkeypatch.setattr(each, "monotonic", world.clock)
    monkeypatch.setattr(module, "sleep", world.sleep)
    chips = [
        PlacedChip(
            CHIPS[kind],
            address,
            frozenset(range(4)),
            None if mux is None or channel is None else Route(mux, channel),
        )
        for kind, address, mux, channel in places
    ]
    bus = I2cBus("/dev/i2c-7", chips, check_every_s=1e9)
    bus.open()
    return bus


def harness_of(places: Sequence[Place]) -> Harness:
    chips = []
    for number, (kind, address, mux, channel) in enumerate(places):
        pins = {pin: f"n{number}_{pin}" for pin in CHIPS[kind].pins[:4]}
        behind = None if mux is None or channel is None else MuxChannel(address=mux, channel=channel)
        chips.append(ChipWiring(kind=kind, address=address, mux=behind, pins=pins))
    bus = BusWiring(device="/dev/i2c-7", clock_hz=CLOCK_HZ, chips=tuple(chips))
    return Harness(name="x", buses=(bus,))


def placed(bus: I2cBus, ports: Sequence[Port], harness: Harness) -> list[PlacedPort]:
    return [PlacedPort(bus.chips[port.chip], reading_of(port, harness)) for port in ports]


EXPANDERS = {
    **{"mcp23017": 0x20, "mcp23008": 0x21, "tca6424a": 0x22, "pcf8574": 0x23},
    **{"pcf8575": 0x24, "pca9555": 0x25, "tca9555": 0x26, "pcf8574a": 0x38},
}
PLACES: dict[str, list[Place]] = {
    "two converters and expanders": [
        ("ads1115", 0x48, None, None),
        ("mcp23017", 0x20, None, None),
        ("ads1115", 0x49, None, None),
        ("ads7828", 0x4A, None, None),
        ("pca9555", 0x21, None, None),
    ],
    "behind channels": [
        ("ads1115", 0x48, 0x70, 0),
        ("ads1115", 0x48, 0x70, 1),
        ("mcp23017", 0x20, 0x70, 1),
        ("pca9555", 0x21, None, None),
        ("ads1115", 0x49, 0x71, 2),
    ],
    "one": [("ads1115", 0x4B, None, None)],
    "every expander": [(kind, address, None, None) for kind, address in EXPANDERS.items()],
    "every expander behind channels": [
        (kind, address, 0x70 + n % 2, n) for n, (kind, address) in enumerate(EXPANDERS.items())
    ],
}


@pytest.mark.parametrize("places", PLACES.values(), ids=PLACES)
def test_a_scan_takes_the_planned_time_and_gives_every_code(
    monkeypatch: pytest.MonkeyPatch, places: list[Place]
) -> None:
    @settings(deadline=None, max_examples=25)
    @given(data=st.data())
    def scans(data: st.DataObject) -> None:
        world, harness = World(*places), harness_of(places)
        names = [*harness.switches, *(f"{name}>1" for name in harness.taxel_names)]
        scan = plan_scan(data.draw(st.permutations(names))[: data.draw(st.integers(1, len(names)))], harness)
        ports = scan.ports
        codes = [data.draw(st.lists(st.integers(1, 4095), min_size=4, max_size=4)) for _ in places]
        with monkeypatch.context() as patch:
            bus = opened(patch, world, places)
            for station, four, (kind, *_) in zip(world.stations, codes, places, strict=True):
                if kind.startswith("ads"):
                    station.device.levels = sum(code << 16 * channel for channel, code in enumerate(four))
            reads = bus.prepare(placed(bus, ports, harness))
            reads.read()
            before, found = world.now, reads.read()
        assert (world.now - before) * 1e6 == pytest.approx(scan_us(scan, harness).us, rel=0, abs=1e-4)
        for port, code in zip(ports, found, strict=True):
            if port.levels:
                assert code == codes[port.chip][reading_of(port, harness).pins[0]]

    scans()


def test_a_converter_that_is_gone_is_no_answer_and_holds_nobody_up(monkeypatch: pytest.MonkeyPatch) -> None:
    places = PLACES["two converters and expanders"]
    world, harness = World(*places), harness_of(places)
    bus = opened(monkeypatch, world, places)
    scan = whole_scan(harness, [*harness.switches, *(f"{name}>1" for name in harness.taxel_names)])
    for station, (kind, *_) in zip(world.stations, places, strict=True):
        station.device.levels = 0x0004_0003_0002_0001 if kind.startswith("ads") else 0xFFFF
    reads = bus.prepare(placed(bus, scan.ports, harness))
    whole = reads.read()
    assert [answer for port, answer in zip(scan.ports, whole, strict=True) if port.chip == 2] == [1, 2, 3, 4]
    world.stations[2].absent = True
    reads.read()
    before, found = world.now, reads.read()
    assert [port.chip for port, answer in zip(scan.ports, found, strict=True) if answer is None] == [2] * 4
    assert [a for p, a in zip(scan.ports, found, strict=True) if p.chip != 2] == [
        a for p, a in zip(scan.ports, whole, strict=True) if p.chip != 2
    ]
    assert world.now - before < 0.01
    assert not bus.chips[2].present


def test_channels_at_rest_are_looked_into_once_a_check(monkeypatch: pytest.MonkeyPatch) -> None:
    """Zeros are also what a line that is held low reads as; eight channels at 0 V are one question, not eight."""
    places: list[Place] = [("ads7828", 0x48, None, None)]
    world, harness = World(*places), harness_of(places)
    bus = opened(monkeypatch, world, places)
    scan = whole_scan(harness, [f"{name}>1" for name in harness.taxel_names])
    reads = bus.prepare(placed(bus, scan.ports, harness))
    wire = world.adapter.wire
    bus.chips[0].checked += 1
    before = wire.transfers
    assert reads.read() == [0] * 4
    looked = wire.transfers - before
    assert looked > 4
    before = wire.transfers
    assert reads.read() == [0] * 4
    assert wire.transfers - before == 4
    wire.sda_low = True
    bus.chips[0].checked += 1
    assert reads.read() == [None] * 4
    assert "stuck" in bus.fault_message

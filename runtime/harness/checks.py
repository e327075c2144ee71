"""What a harness must satisfy beyond the types of its fields. Faults come in an order in which the first one counts."""

from collections.abc import Iterable, Iterator

from thenar.drivers.errors import SettingError
from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.chips import CHIPS
from thenar.drivers.ports import device_fault, port_fault

from ..names import fault, nearest, shortened
from ..toml_source import Place, spelled
from .wiring import BusWiring, ChipWiring, GloveWiring, Harness

Fault = tuple[Place, str]
_SENSORS = (18, 22)


def faults(harness: Harness) -> Iterator[Fault]:
    """Yield what is wrong with `harness` and where; what comes after a fault may be wrong because of it."""
    if reason := fault(harness.name):
        yield ("name",), f"{shortened(repr(harness.name))} is no name of a glove: it {reason}"
    if harness.cyberglove is not None:
        yield from _of_glove(harness.cyberglove)
    yield from _of_devices(harness)
    for number, bus in enumerate(harness.buses):
        yield from _of_bus(("bus", number), bus)
    yield from _of_switches(harness)


def _of_glove(glove: GloveWiring) -> Iterator[Fault]:
    counts = _SENSORS if glove.sensors is None else (glove.sensors,)
    if glove.joints and len(glove.joints) not in counts:
        wanted = " or ".join(map(str, counts))
        yield ("cyberglove", "joints"), f"{len(glove.joints)} names for {wanted} sensors: name every one, in wire order"
    named = ((("cyberglove", "joints", n), name) for n, name in enumerate(glove.joints) if name)
    yield from _of_names(named, "sensor")


def _of_devices(harness: Harness) -> Iterator[Fault]:
    places: list[tuple[Place, str]] = [(("scanner", n, "port"), line.port) for n, line in enumerate(harness.scanners)]
    places += [(("bus", n, "device"), bus.device) for n, bus in enumerate(harness.buses)]
    if harness.cyberglove is not None:
        places.insert(0, (("cyberglove", "port"), harness.cyberglove.port))
    seen: dict[str, Place] = {}
    for place, device in places:
        if reason := (device_fault if place[-1] == "device" else port_fault)(device):
            yield place, f"{shortened(repr(device))} {reason}"
        if device in seen:
            yield place, f"{device} is {spelled(seen[device])} already: one device, one entry"
        seen[device] = place


def _of_bus(place: Place, bus: BusWiring) -> Iterator[Fault]:
    for number, chip in enumerate(bus.chips):
        yield from _of_chip((*place, "chip", number), chip, bus)
    yield from _of_addresses(place, bus)


def _of_chip(place: Place, chip: ChipWiring, bus: BusWiring) -> Iterator[Fault]:
    if chip.kind not in CHIPS:
        yield (*place, "kind"), f"there is no chip {chip.kind!r}{nearest(chip.kind, list(CHIPS))}"
    kind = CHIPS[chip.kind]
    try:
        kind.check_address(chip.address)
    except SettingError as reason:
        yield (*place, "address"), str(reason)
    usable = [pin for pin in kind.pins if pin not in kind.not_inputs]
    for pin in chip.pins:
        if pin not in kind.pins:
            yield (*place, "pins", pin), f"a {kind.name} has no pin {pin!r}{nearest(pin, usable)}"
        if pin in kind.not_inputs:
            yield (*place, "pins", pin), f"must not be an input: {kind.not_inputs[pin]}; use another pin"
    if chip.closed == "high" and not kind.registers:  # what is not pulled down reads as high, whatever the switch does
        yield (*place, "closed"), f"a {kind.name} pulls its inputs up by itself: let switches pull them down"
    slowest = min(kind.clock_hz, tca9548a.CLOCK_HZ if chip.mux else kind.clock_hz)
    if bus.clock_hz > slowest:
        which = kind.name if slowest == kind.clock_hz else "TCA9548A"
        yield (*place[:2], "clock_hz"), f"{bus.clock_hz} Hz is too fast for the {which}: at most {slowest}"


def _of_addresses(place: Place, bus: BusWiring) -> Iterator[Fault]:
    """A chip that is always connected, or a mux, must have its address to itself; others, on their channel."""
    muxes = {chip.mux.address for chip in bus.chips if chip.mux}
    seen: dict[tuple[int, int] | None, dict[int, int]] = {None: {}}
    for number, chip in enumerate(bus.chips):
        channel = (chip.mux.address, chip.mux.channel) if chip.mux else None
        # Upstream chips answer on every channel: they clash with what is behind any of them.
        rooms = seen.values() if channel is None else (seen[None], seen.setdefault(channel, {}))
        here = (*place, "chip", number, "address")
        for other in (room[chip.address] for room in rooms if chip.address in room):
            yield here, f"0x{chip.address:02X} is the address of {spelled((*place, 'chip', other))} too: both answer"
        if chip.address in muxes:
            yield here, f"0x{chip.address:02X} is the address of a mux on this bus too: both answer"
        seen[channel][chip.address] = number


def _of_switches(harness: Harness) -> Iterator[Fault]:
    def wired() -> Iterator[tuple[Place, str]]:
        for number, scanner in enumerate(harness.scanners):
            keys = enumerate(scanner.switches)
            yield from ((("scanner", number, "switches", key), name) for key, name in keys if name)
        for number, bus in enumerate(harness.buses):
            for index, chip in enumerate(bus.chips):
                here = ("bus", number, "chip", index, "pins")
                yield from (((*here, pin), name) for pin, name in chip.pins.items())

    yield from _of_names(wired(), "switch")


def _of_names(named: Iterable[tuple[Place, str]], what: str) -> Iterator[Fault]:
    """Every name must be good and stand once."""
    seen: dict[str, Place] = {}
    for place, name in named:
        if reason := fault(name):
            yield place, f"{shortened(repr(name))} is no name of a {what}: it {reason}"
        if name in seen:
            yield place, f"{what} {name!r} is {spelled(seen[name])} already: a {what} has one place"
        seen[name] = place

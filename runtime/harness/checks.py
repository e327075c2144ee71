"""The rules that a harness must satisfy beyond the types of its fields. The first fault in order counts."""

from collections.abc import Iterable, Iterator, Sequence

from thenar.drivers.errors import SettingError
from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.chips import CHIPS
from thenar.drivers.line_reader import line_port_fault
from thenar.drivers.ports import device_fault, port_fault
from thenar.drivers.scanner_datagrams import scanner_port_fault
from thenar.drivers.senders import parse_address
from thenar.drivers.spi.chips import SPI_CHIPS

from ..names import fault, nearest, shortened
from ..toml_source import Place, spelled
from .wiring import BusWiring, ChipWiring, GloveWiring, Harness, SpiWiring, StreamWiring

Fault = tuple[Place, str]
_SENSORS = (18, 22)


def faults(harness: Harness) -> Iterator[Fault]:
    """Yield the faults of `harness` and their places; later faults may be consequences of earlier ones."""
    if reason := fault(harness.name):
        yield ("name",), f"{shortened(repr(harness.name))} is not a valid glove name: it {reason}"
    if harness.cyberglove is not None:
        yield from _of_glove(harness.cyberglove)
    yield from _of_devices(harness)
    for number, scanner in enumerate(harness.scanners):
        if not (scanner.switches or scanner.taxels):
            yield ("scanner", number), "the key switches is missing: a board has switches, taxels or both"
        if scanner.mux and not scanner.taxels:
            yield ("scanner", number, "mux"), "is a multiplexer without taxels: name them, or leave it out"
    for number, bus in enumerate(harness.buses):
        yield from _of_bus(("bus", number), bus)
    for number, chip in enumerate(harness.spi):
        yield from _of_spi(("spi", number), chip)
    for number, stream in enumerate(harness.streams):
        yield from _of_stream(("stream", number), stream)
    joints = [("stream", number, "joints") for number, stream in enumerate(harness.streams) if stream.joints]
    for place in joints if harness.cyberglove is not None else joints[1:]:
        yield place, "joints must come from one device, and another one measures them already"
    yield from _of_elements(harness)


def _of_glove(glove: GloveWiring) -> Iterator[Fault]:
    counts = _SENSORS if glove.sensors is None else (glove.sensors,)
    if glove.joints and len(glove.joints) not in counts:
        wanted = " or ".join(map(str, counts))
        yield ("cyberglove", "joints"), f"{len(glove.joints)} names for {wanted} sensors: name every one, in wire order"
    named = ((("cyberglove", "joints", n), name) for n, name in enumerate(glove.joints) if name)
    yield from _of_names(named, "sensor")


_FAULT_OF = {"scanner": scanner_port_fault, "stream": line_port_fault}


def _of_devices(harness: Harness) -> Iterator[Fault]:
    places: list[tuple[Place, str]] = [(("scanner", n, "port"), line.port) for n, line in enumerate(harness.scanners)]
    places += [(("bus", n, "device"), bus.device) for n, bus in enumerate(harness.buses)]
    places += [(("spi", n, "device"), chip.device) for n, chip in enumerate(harness.spi)]
    places += [(("stream", n, "port"), stream.port) for n, stream in enumerate(harness.streams)]
    if harness.cyberglove is not None:
        places.insert(0, (("cyberglove", "port"), harness.cyberglove.port))
    seen: dict[str, Place] = {}
    for place, device in places:
        fault_of = device_fault if place[-1] == "device" else _FAULT_OF.get(str(place[0]), port_fault)
        if reason := fault_of(device):
            yield place, f"{shortened(repr(device))} {reason}"
        if device in seen:
            yield place, f"{device} is already {spelled(seen[device])}: name each device in one entry only"
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
    yield from _of_pins(place, chip, [pin for pin in kind.pins if pin not in kind.not_inputs])
    for pin in chip.pins:
        if pin in kind.not_inputs:
            yield (*place, "pins", pin), f"must not be an input: {kind.not_inputs[pin]}; use another pin"
    if chip.closed == "high" and chip.measures:
        yield (
            (*place, "closed"),
            f"a {kind.name} measures taxels: leave it out",
        )
    if chip.closed == "high" and not kind.registers:  # an input that nothing pulls down reads high, open or closed
        yield (*place, "closed"), f"a {kind.name} pulls its inputs up: let switches pull them down"
    slowest = min(kind.clock_hz, tca9548a.CLOCK_HZ if chip.mux else kind.clock_hz)
    if bus.clock_hz > slowest:
        which = kind.name if slowest == kind.clock_hz else "TCA9548A"
        yield (*place[:2], "clock_hz"), f"{bus.clock_hz} Hz is too fast for the {which}: at most {slowest}"


def _of_spi(place: Place, chip: SpiWiring) -> Iterator[Fault]:
    if chip.kind not in SPI_CHIPS:
        yield (*place, "kind"), f"there is no SPI converter {chip.kind!r}{nearest(chip.kind, list(SPI_CHIPS))}"
    yield from _of_pins(place, chip, chip.chip.pins)
    if chip.clock_hz > chip.chip.most_hz:
        yield (*place, "clock_hz"), f"{chip.clock_hz} Hz is too fast for the {chip.kind}: at most {chip.chip.most_hz}"


def _of_stream(place: Place, stream: StreamWiring) -> Iterator[Fault]:
    if not stream.used:
        yield place, "must have one of the keys switches, joints and taxels; doctor --line proposes them"
    known = tuple(filter(None, stream.columns)) or (*stream.used, *([] if stream.time is None else [stream.time]))
    named: list[tuple[Place, str]] = [(("time",), stream.time)] if stream.time is not None else []
    named += [(("switches", number), name) for number, name in enumerate(stream.switches)]
    named += [((kind, name), name) for kind in ("joints", "taxels") for name in getattr(stream, kind)]
    for where, name in named:
        if name not in known:
            yield (*place, *where), f"there is no column {shortened(repr(name))}{nearest(name, known)}"
        if stream.time == name and where != ("time",):
            yield (*place, *where), f"{name!r} is the sender's clock"
    if stream.sender is not None and (reason := _sender_fault(stream.port, stream.sender)):
        yield (*place, "from"), reason
    yield from _of_values(place, stream)
    columns = ((*place, "columns", number) for number in range(len(stream.columns)))
    yield from _of_names(((where, name) for where, name in zip(columns, stream.columns, strict=True) if name), "column")


def _sender_fault(port: str, sender: str) -> str:
    if not port.startswith("udp:"):
        return "is for udp:// ports, to which several may send: leave it out"
    try:
        parse_address(sender)
    except SettingError as reason:
        return str(reason)
    return ""


def _of_values(place: Place, stream: StreamWiring) -> Iterator[Fault]:
    for name in stream.thresholds:
        if name not in stream.switches:
            yield (*place, "thresholds", name), f"there is no switch {name!r}{nearest(name, stream.switches)}"
    for kind, ranges in (("joints", stream.joints), ("taxels", stream.taxels)):
        for name, (low, high) in ranges.items():
            if low == high:
                yield (*place, kind, name), f"a range from {low} to {high} is empty: write the least, then the greatest"
    if stream.calibration is not None and not stream.joints:
        yield (*place, "calibration"), "is for joints, and there are none: name that of taxels under [taxels]"


def _of_pins(place: Place, chip: ChipWiring | SpiWiring, usable: Sequence[str]) -> Iterator[Fault]:
    for pin in chip.pins:
        if pin not in chip.chip.pins:
            yield (*place, "pins", pin), f"a {chip.kind} has no pin {pin!r}{nearest(pin, usable)}"


def _of_addresses(place: Place, bus: BusWiring) -> Iterator[Fault]:
    """Yield address clashes: a chip that is always connected, or a mux, needs a unique address; others, per channel."""
    muxes = {chip.mux.address for chip in bus.chips if chip.mux}
    seen: dict[tuple[int, int] | None, dict[int, int]] = {None: {}}
    for number, chip in enumerate(bus.chips):
        channel = (chip.mux.address, chip.mux.channel) if chip.mux else None
        # Upstream chips respond on every channel: they clash with chips behind any of them.
        rooms = seen.values() if channel is None else (seen[None], seen.setdefault(channel, {}))
        here = (*place, "chip", number, "address")
        for other in (room[chip.address] for room in rooms if chip.address in room):
            yield here, f"0x{chip.address:02X} is the address of {spelled((*place, 'chip', other))} too: change one"
        if chip.address in muxes:
            yield here, f"0x{chip.address:02X} is also the address of a mux on this bus: change one"
        seen[channel][chip.address] = number


def _of_elements(harness: Harness) -> Iterator[Fault]:
    """Yield names used twice; a taxel and a switch may not share a name either, since levels are named by taxel."""

    def wired() -> Iterator[tuple[Place, str]]:
        for number, scanner in enumerate(harness.scanners):
            for key, names in (("switches", scanner.switches), ("taxels", scanner.taxels)):
                yield from ((("scanner", number, key, place), name) for place, name in enumerate(names) if name)
        for number, stream in enumerate(harness.streams):
            yield from ((("stream", number, "switches", place), name) for place, name in enumerate(stream.switches))
            for key, ranges in (("joints", stream.joints), ("taxels", stream.taxels)):
                yield from ((("stream", number, key, name), name) for name in ranges)
        chips: list[tuple[Place, ChipWiring | SpiWiring]] = [
            (("bus", n, "chip", m), chip) for n, bus in enumerate(harness.buses) for m, chip in enumerate(bus.chips)
        ]
        chips += [(("spi", n), chip) for n, chip in enumerate(harness.spi)]
        for here, chip in chips:
            yield from (((*here, "pins", pin), name) for pin, name in chip.pins.items())

    yield from _of_names(wired(), "switch or taxel" if harness.taxel_names else "switch")


def _of_names(named: Iterable[tuple[Place, str]], what: str) -> Iterator[Fault]:
    """Yield names that are invalid or used twice."""
    seen: dict[str, Place] = {}
    for place, name in named:
        if reason := fault(name):
            yield place, f"{shortened(repr(name))} is not a valid name of a {what}: it {reason}"
        if name in seen:
            yield place, f"{what} {name!r} is already {spelled(seen[name])}: wire it in one place"
        seen[name] = place

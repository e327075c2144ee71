"""The rules that a harness must satisfy beyond the types of its fields. The first fault in order counts."""

import re
from collections.abc import Iterator, Mapping, Sequence

from thenar.drivers import cd74hc4067
from thenar.drivers.errors import SettingError
from thenar.drivers.frames import frame_format
from thenar.drivers.i2c import tca9548a
from thenar.drivers.i2c.chips import CHIPS
from thenar.drivers.ports import device_fault, port_fault
from thenar.drivers.spi.chips import SPI_CHIPS
from thenar.drivers.transports import OTHER_PORTS, line_port_fault

from ..names import fault, nearest, shortened
from ..toml_source import Place, spelled
from ..toml_struct import Fault, used_twice, wrong_names
from .wiring import SLOWEST_HZ, BoardWiring, BusWiring, ChipWiring, GloveWiring, Harness, SpiWiring, StreamWiring

_SENSORS = (18, 22)
_THRESHOLD = StreamWiring(port="-").threshold
# As sketches name them: a number, or a macro of the board's core.
_PIN = re.compile(r"\d{1,4}|[A-Za-z_][A-Za-z0-9_]{0,31}")


def faults(harness: Harness) -> Iterator[Fault]:
    """Yield the faults of `harness` and their places; later faults may be consequences of earlier ones."""
    if reason := fault(harness.name):
        yield ("name",), f"{shortened(repr(harness.name))} is not a valid glove name: it {reason}"
    if harness.cyberglove is not None:
        yield from _of_glove(harness.cyberglove)
    yield from _of_devices(harness)
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
    yield from wrong_names(named, "sensor")


def _of_devices(harness: Harness) -> Iterator[Fault]:
    places: list[tuple[Place, str]] = [(("bus", n, "device"), bus.device) for n, bus in enumerate(harness.buses)]
    places += [(("spi", n, "device"), chip.device) for n, chip in enumerate(harness.spi)]
    places += [(("stream", n, "port"), stream.port) for n, stream in enumerate(harness.streams)]
    if harness.cyberglove is not None:
        places.insert(0, (("cyberglove", "port"), harness.cyberglove.port))
    for place, device in places:
        fault_of = device_fault if place[-1] == "device" else port_fault
        if reason := (line_port_fault if place[0] == "stream" else fault_of)(device):
            yield place, f"{shortened(repr(device))} {reason}"
    yield from used_twice(places, "name each device in one entry only")


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
    if stream.frame is not None:
        yield from _of_frame((*place, "frame"), stream, stream.frame)
    known = tuple(filter(None, stream.columns)) or (*stream.used, *([] if stream.time is None else [stream.time]))
    named: list[tuple[Place, str]] = [(("time",), stream.time)] if stream.time is not None else []
    named += [(("switches", number), name) for number, name in enumerate(stream.switches)]
    named += [((kind, name), name) for kind in ("joints", "taxels") for name in getattr(stream, kind)]
    for where, name in named:
        if name not in known:
            yield (*place, *where), f"there is no column {shortened(repr(name))}{nearest(name, known)}"
        if stream.time == name and where != ("time",):
            yield (*place, *where), f"{name!r} is the sender's clock"
    yield from _of_values(place, stream)
    if stream.board is not None:
        yield from _of_board((*place, "board"), stream, stream.board)
    columns = ((*place, "columns", number) for number in range(len(stream.columns)))
    yield from wrong_names(
        ((where, name) for where, name in zip(columns, stream.columns, strict=True) if name), "column"
    )


def _of_frame(place: Place, stream: StreamWiring, pattern: str) -> Iterator[Fault]:
    """Yield faults of the pattern of binary frames."""
    if stream.port.startswith(OTHER_PORTS):
        yield place, "is for a port of bytes, not of messages: leave it out"
    try:
        numbers = frame_format(pattern).numbers
    except SettingError as reason:
        yield place, str(reason)
        return
    if numbers != len(stream.columns):
        said = f"{len(stream.columns)} columns are named, but a frame has {numbers} numbers"
        yield place, f'{said}: name every one in order, "" for unused ones'


def _of_board(place: Place, stream: StreamWiring, board: BoardWiring) -> Iterator[Fault]:
    if stream.columns or stream.time or stream.thresholds or stream.threshold != _THRESHOLD or stream.closed != "high":
        yield place, "a board names its columns and sends its clock: leave out columns, time, thresholds and closed"
    keys = () if board.matrix is None else board.matrix.keys
    switches: list[tuple[Place, str]] = [
        ((*place, "matrix", "keys", n, m), name) for n, row in enumerate(keys) for m, name in enumerate(row) if name
    ]
    for number, chip in enumerate(board.chips):
        here = (*place, "chip", number)
        if chip.mux is not None or (chip.kind in CHIPS and not chip.chip.registers):
            yield here, "a board reads chips with registers that are on its bus itself: choose another chip"
        switches += [((*here, "pins", pin), name) for pin, name in chip.pins.items()]
    bus = BusWiring(device="", clock_hz=SLOWEST_HZ, chips=board.chips)
    yield from _of_bus(place, bus)
    pins: list[tuple[Place, str]] = [((*place, "pins", name), name) for name in board.pins]
    for known, named in ((stream.used, pins), (stream.switches, switches)):
        for where, name in named:
            if name not in known:
                yield where, f"the stream has no such column {shortened(repr(name))}{nearest(name, known)}"
    yield from _of_board_pins(place, stream, board)
    yield from wrong_names([*pins, *switches], "input")


def _of_board_pins(place: Place, stream: StreamWiring, board: BoardWiring) -> Iterator[Fault]:
    """Yield pins that no sketch can name, or that are used twice, and multiplexers that cannot be read."""
    if len(board.select) not in (0, len(cd74hc4067.SELECTS)):
        yield (*place, "select"), f"{len(board.select)} pins: a CD74HC4067 has four, S0 to S3"
    behind = {name: pin for name, pin in board.pins.items() if "." in pin}
    yield from _of_multiplexed(place, stream, behind)
    if behind and not board.select:
        yield (*place, "select"), "is missing: the pins at S0 to S3 of the multiplexers"
    used: list[tuple[Place, str]] = [((*place, "select", number), pin) for number, pin in enumerate(board.select)]
    if (matrix := board.matrix) is not None:
        used += [((*place, "matrix", "rows", number), pin) for number, pin in enumerate(matrix.rows)]
        used += [((*place, "matrix", "columns", number), pin) for number, pin in enumerate(matrix.columns)]
        rows, columns = len(matrix.rows), len(matrix.columns)
        if [len(row) for row in matrix.keys] != [columns] * rows:
            yield (*place, "matrix", "keys"), f'must be {rows} lists of {columns} names, "" where there is no key'
    used += [((*place, "pins", name), pin) for name, pin in board.pins.items() if name not in behind]
    used += [((*place, "pins"), pin) for pin in dict.fromkeys(pin.partition(".")[0] for pin in behind.values())]
    for where, pin in used:
        if not _PIN.fullmatch(pin):
            yield where, f'{shortened(repr(pin))} is no pin of a sketch: write "2", "A0" or "PA3"'
    yield from used_twice(used, "use another one")


def _of_multiplexed(place: Place, stream: StreamWiring, behind: Mapping[str, str]) -> Iterator[Fault]:
    """Yield faults of the inputs behind multiplexers, by the channel of each."""
    for name, pin in behind.items():
        where, channel = (*place, "pins", name), pin.partition(".")[2]
        if name in stream.switches:
            yield where, f"{pin} is behind a multiplexer, which is for joints and taxels: use another pin"
        if not (channel.isdecimal() and int(channel) < cd74hc4067.CHANNELS):
            yield where, f"{shortened(repr(pin))} is no channel of a CD74HC4067: the channels of A0 are A0.0 to A0.15"
    yield from used_twice([((*place, "pins", name), pin) for name, pin in behind.items()], "use another one")


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

    yield from wrong_names(wired(), "switch or taxel" if harness.taxel_names else "switch")

"""How a microcontroller is wired to a glove: the tables of `board.toml`, reading them and checking them.

Keys are numbered as in the board's frames: with pins and chips, key k is the build's kept switch k, all in one row,
without the levels of taxels; in a matrix it is row * columns + column. A board without keys reports one open key.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta, Struct, field

from thenar.drivers.i2c.chips import CHIPS, expanders
from thenar.drivers.scanner_protocol import MOST_ASKED
from thenar.runtime.harness import checks
from thenar.runtime.harness.wiring import Baud, BusWiring, ChipWiring, Debounce, Harness, ScannerWiring
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.manifest import Switch
from thenar.runtime.names import fault, list_names, nearest, shortened
from thenar.runtime.toml_source import Place, TomlText, read_source, spelled
from thenar.runtime.toml_struct import check_finite, convert

from . import FirmwareError
from .targets import Wired, wired
from .targets.avr import Avr, best_setting, near_rates
from .words import Names

# A CD74HC4067: its channels, and the pins that select a channel.
MUX_CHANNELS, SELECT_PINS = 16, 4
_USUAL_HZ = 16_000_000
Microseconds = Annotated[int, Meta(ge=0, le=60_000_000)]
ShortMicroseconds = Annotated[int, Meta(ge=0, le=65_535)]


class _Table(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of `board.toml`."""


class BoardDebounce(_Table, frozen=True):
    """Debouncing on the board, as SET_DEBOUNCE would set it; 0 leaves it to the host."""

    press_us: ShortMicroseconds = 0
    release_us: ShortMicroseconds = 0


class Matrix(_Table, frozen=True):
    """A matrix of keys: rows are driven low one at a time; columns are read with the part's pull-ups.

    switches   names, one list per row, "" where there is no key
    diodes     whether every key has a diode, its cathode towards the row
    settle_us  from driving a row low to reading the columns
    """

    rows: Annotated[tuple[str, ...], Meta(min_length=1)]
    columns: Annotated[tuple[str, ...], Meta(min_length=1)]
    switches: tuple[tuple[str, ...], ...]
    diodes: bool
    settle_us: Annotated[int, Meta(ge=1, le=1000)] = 20


class BoardBus(_Table, frozen=True):
    """The I2C bus: its SCL clock."""

    clock_hz: Annotated[int, Meta(ge=50_000, le=400_000)] = 400_000


class Wifi(_Table, frozen=True):
    """The host line is Wi-Fi: frames are UDP datagrams, and the board listens at `port`."""

    port: Annotated[int, Meta(ge=1024, le=65_535)] = 5253


class GloveUart(_Table, frozen=True):
    """A CyberGlove on a UART: `joints` are our names of its sensors in wire order, "" for an unused one."""

    uart: Annotated[int, Meta(ge=0, le=3)] = 1
    baud: Baud = 115_200
    sensors: Literal[18, 22] = 18
    rate_hz: Annotated[float, Meta(gt=0.0, le=1000.0)] | None = None
    joints: tuple[str, ...] = ()


class TaxelInputs(_Table, frozen=True):
    """Taxels as voltages on the part's converter, directly or behind CD74HC4067 multiplexers.

    inputs     channels of the converter ("ADC0"): a taxel on each, or the common pin of a multiplexer
    select     the pins that drive S0 to S3 of all multiplexers together; empty without multiplexers
    names      the taxel of each channel of the board, "" for none: channel n of multiplexer m is channel 16 m + n
    settle_us  settling time of a channel after the multiplexers were switched
    """

    inputs: Annotated[tuple[str, ...], Meta(min_length=1)]
    names: Annotated[tuple[str, ...], Meta(min_length=1, max_length=MOST_ASKED)]
    select: tuple[str, ...] = ()
    settle_us: Annotated[int, Meta(ge=0, le=10_000)] = 100

    @property
    def per_input(self) -> int:
        """The number of channels per input."""
        return MUX_CHANNELS if self.select else 1


class Board(_Table, frozen=True):
    """A microcontroller and everything wired to its pins; a loaded board has been checked.

    pins and analog map names of switches and joints to pins ("PD2") and channels ("ADC0"). clock_hz applies to AVRs
    only: the clock of other parts is fixed.
    """

    part: str
    clock_hz: Annotated[int, Meta(ge=1_000_000, le=20_000_000)] = _USUAL_HZ
    baud: Annotated[int, Meta(ge=1200, le=2_500_000)] = 1_000_000
    board: Annotated[int, Meta(ge=0, le=0xFFFF_FFFF)] = 1
    scan_us: Annotated[int, Meta(ge=100, le=60_000_000)] = 1000
    state_us: Microseconds = 0
    heartbeat_us: Microseconds = 50_000
    debounce: BoardDebounce = BoardDebounce()
    wifi: Wifi | None = None
    pins: dict[str, str] = {}
    matrix: Matrix | None = None
    bus: BoardBus = BoardBus()
    chips: tuple[ChipWiring, ...] = field(default=(), name="chip")
    cyberglove: GloveUart | None = None
    analog: dict[str, str] = {}
    taxels: TaxelInputs | None = None

    @property
    def channels(self) -> int:
        """The number of analog channels that it reports to the host."""
        return 0 if self.taxels is None else len(self.taxels.names)

    @property
    def microcontroller(self) -> Wired:
        """The target whose part it is."""
        return wired()[self.part]

    @property
    def avr(self) -> Avr | None:
        """The part if it is an AVR, whose registers the firmware sets itself; None where Arduino's core does."""
        part = self.microcontroller
        return part if isinstance(part, Avr) else None

    @property
    def wired(self) -> tuple[str, ...]:
        """The names of all switches that are wired."""
        if self.matrix is not None:
            return tuple(name for row in self.matrix.switches for name in row if name)
        return (*self.pins, *(name for chip in self.chips for name in chip.numbered_pins.values()))


def keys_of(board: Board, switches: Sequence[Switch]) -> tuple[str, ...]:
    """Return the names of a build's switches that are keys of the board: all but the levels of its taxels."""
    taxels = () if board.taxels is None else board.taxels.names
    return tuple(each.name for each in switches if each.threshold is None or each.threshold.taxel.name not in taxels)


def rows_and_columns(board: Board, switches: Sequence[str]) -> tuple[int, int]:
    """Return the number of rows and columns of keys that the board reports to the host; pins and chips are one row."""
    if board.matrix is not None:
        return len(board.matrix.rows), len(board.matrix.columns)
    return 1, len(switches) or int(board.channels > 0)


def key_names(board: Board, switches: Sequence[str]) -> tuple[str, ...]:
    """Return the switch of every key, "" for none: a build's `switches` in its order, or the matrix row by row."""
    if board.matrix is not None:
        return tuple(name for row in board.matrix.switches for name in row)
    return tuple(switches)


def check_switches(board: Board, switches: Sequence[str]) -> None:
    """Raise FirmwareError unless the board has a pin or key for each of a build's `switches`."""
    wired = set(board.wired)
    lacking = [name for name in switches if name not in wired]
    if lacking:
        raise FirmwareError(
            f"the board has no pin or column for {list_names(lacking)}, which the build keeps: add what is missing to "
            "its board.toml, or compile the build for the switches that are there"
        )
    if not switches and not board.channels:
        raise FirmwareError(
            "the build keeps no switch, so there is nothing to scan: compile it with --inputs both or --inputs switches"
        )


def host_name(board: Board) -> str:
    """Return the host name of a board on Wi-Fi."""
    return f"thenar-{board.board}"


def glove_toml(name: str, board: Board, names: Names, port: str | None = None) -> str:
    """Return the `glove.toml` for a host with the board at `port`, by default the usual port.

    Debouncing is disabled in it if the board debounces.

    Raises FirmwareError if the board lacks a switch of the build.
    """
    switches = keys_of(board, names.switches)
    check_switches(board, switches)
    taxels = board.taxels
    usual = "/dev/ttyACM0" if board.wifi is None else f"udp://{host_name(board)}:{board.wifi.port}"
    line = ScannerWiring(
        port=port or usual,
        baud=board.baud,
        switches=key_names(board, switches),
        taxels=() if taxels is None else taxels.names,
        mux="cd74hc4067" if taxels is not None and taxels.select else None,
    )
    debounce = Debounce(enabled=not (board.debounce.press_us or board.debounce.release_us))
    return harness_to_toml(Harness(name=name, scanners=(line,), debounce=debounce))


Fault = tuple[Place, str]
_TIMER_HZ = 400  # the timer has periods of 20 ms and counts eighths of the processor's clock
_KINDS = tuple(kind for kind, chip in expanders().items() if chip.registers)
_TOLERANCE = 0.025


def faults(board: Board) -> Iterator[Fault]:
    """Yield the faults of `board` and their places; a fault may be the consequence of an earlier one."""
    if board.part not in wired():
        yield ("part",), f"{board.part!r} is not one of its values{nearest(board.part, list(wired()))}"
    yield from _of_clocks(board)
    yield from _of_inputs(board)
    if board.matrix is not None:
        yield from _of_matrix(board.matrix)
    yield from _of_chips(board)
    if board.cyberglove is not None:
        yield from _of_glove(board.cyberglove, board)
    yield from _of_analog(board)
    if board.taxels is not None:
        yield from _of_taxels(board, board.taxels)
    yield from _of_pins(board)
    yield from _of_names(board)


def _of_clocks(board: Board) -> Iterator[Fault]:
    part = board.avr
    if part is None and board.clock_hz != _USUAL_HZ:
        yield ("clock_hz",), f"Arduino's core sets the clock of {board.microcontroller.named}: leave it out"
    if part is not None and board.clock_hz > part.highest_hz:
        yield ("clock_hz",), f"{part.named} runs at {part.highest_hz} Hz at most"
    if board.clock_hz % _TIMER_HZ:
        yield ("clock_hz",), f"must be a multiple of {_TIMER_HZ}: otherwise the microsecond clock would not be exact"
    yield from _of_baud(("baud",), board.baud, board)
    if board.wifi is not None and not board.microcontroller.wireless:
        able = ", ".join(name for name, each in wired().items() if each.wireless)
        yield ("wifi",), f"{board.microcontroller.named} has no Wi-Fi: use one of {able}"
    for key in ("state_us", "heartbeat_us"):
        if 0 < getattr(board, key) < board.scan_us:
            yield (key,), f"must be 0 (none) or at least scan_us, {board.scan_us}: every frame sent needs a new scan"


def _of_baud(place: Place, baud: int, board: Board) -> Iterator[Fault]:
    if board.avr is None:  # these have fractional baud rate dividers
        return
    clock_hz = board.clock_hz
    setting = best_setting(baud, clock_hz)
    if setting is None or abs(setting.error) > _TOLERANCE:
        rates = ", ".join(map(str, near_rates(baud, clock_hz)))
        yield place, f"a UART at {clock_hz} Hz cannot make {baud} baud within {_TOLERANCE:.1%}: use one of {rates}"


def _of_inputs(board: Board) -> Iterator[Fault]:
    kinds = {"pins": bool(board.pins), "matrix": board.matrix is not None, "chip": bool(board.chips)}
    there: list[Place] = [(kind,) for kind, used in kinds.items() if used]
    if len(there) > 1:
        yield (
            there[1],
            f"{spelled(there[0])} is given too: wire the switches to only one of pins, a matrix and chips",
        )
    if not there and board.taxels is None:
        yield (), "no switch is wired: add [pins], [matrix] or [[chip]] tables"
    if board.cyberglove is not None and board.analog:
        yield ("analog",), "[cyberglove] is given too: joints come from only one of them"


def _of_matrix(matrix: Matrix) -> Iterator[Fault]:
    if len(matrix.switches) != len(matrix.rows):
        yield ("matrix", "switches"), f"{len(matrix.switches)} lists for {len(matrix.rows)} rows: one list per row"
    for number, row in enumerate(matrix.switches):
        if len(row) != len(matrix.columns):
            here: Place = ("matrix", "switches", number)
            yield here, f'{len(row)} names for {len(matrix.columns)} columns: write "" where there is no key'


def _of_chips(board: Board) -> Iterator[Fault]:
    for number, chip in enumerate(board.chips):
        here: Place = ("chip", number)
        if chip.kind in CHIPS and chip.kind not in _KINDS:
            yield (*here, "kind"), f"the firmware cannot read a {chip.kind}: it reads {', '.join(_KINDS)}"
        if chip.mux is not None:
            yield (
                (*here, "mux"),
                "the firmware cannot select multiplexer channels: wire the chip to the bus itself",
            )
    if board.avr is not None and board.chips and board.clock_hz < 16 * board.bus.clock_hz:
        yield ("bus", "clock_hz"), f"must be at most a 16th of the part's clock, {board.clock_hz // 16}"
    if board.avr is not None and board.chips and board.clock_hz > (16 + 2 * 255) * board.bus.clock_hz:
        yield ("bus", "clock_hz"), f"is too low for the part's divider: at least {board.clock_hz // 526 + 1}"
    bus = BusWiring(device="bus", clock_hz=board.bus.clock_hz, chips=board.chips)
    for place, reason in checks.faults(Harness(name="board", buses=(bus,))):
        where = place[2:] if place[2:3] == ("chip",) else ("bus", *place[2:])
        yield where, reason.replace("bus[0].", "")


def _of_glove(glove: GloveUart, board: Board) -> Iterator[Fault]:
    part = board.microcontroller
    if len(part.uarts) == 1:
        yield ("cyberglove",), f"{part.named} has one UART, which the host uses: use an atmega2560, or [analog]"
    elif not 0 < glove.uart < len(part.uarts):
        which = "UART 0 is the host's" if glove.uart == 0 else f"{part.named} has no UART {glove.uart}"
        able = ", ".join(map(str, range(1, len(part.uarts))))
        yield ("cyberglove", "uart"), f"{which}: use {' or '.join(able.rsplit(', ', 1))}"
    if glove.joints and len(glove.joints) != glove.sensors:
        place: Place = ("cyberglove", "joints")
        yield place, f"{len(glove.joints)} names for {glove.sensors} sensors: name every one, in wire order"
    yield from _of_baud(("cyberglove", "baud"), glove.baud, board)


def _of_analog(board: Board) -> Iterator[Fault]:
    part, seen = board.microcontroller, dict[str, str]()
    for joint, channel in board.analog.items():
        if reason := _no_channel(part, channel):
            yield ("analog", joint), reason
        if channel in seen:
            yield (
                ("analog", joint),
                f"{channel} is already used by {seen[channel]}: give each joint its own channel",
            )
        seen[channel] = joint


def _no_channel(part: Wired, channel: str) -> str:
    """Return why a channel cannot be used; "" if it can, or if only its pin cannot."""
    if channel in part.analog:
        return ""
    if channel in part.tied:
        return f"{channel} of {part.named} cannot be used: {part.tied[channel]}"
    return f"{part.named} has no channel {channel!r}{nearest(channel, list(part.analog))}"


def _of_taxels(board: Board, taxels: TaxelInputs) -> Iterator[Fault]:
    if len(taxels.select) not in (0, SELECT_PINS):
        yield ("taxels", "select"), f"{len(taxels.select)} pins: a CD74HC4067 has {SELECT_PINS} select pins, S0 to S3"
    room = taxels.per_input * len(taxels.inputs)
    if len(taxels.names) > room:
        yield ("taxels", "names"), f"{len(taxels.names)} names for {room} channels"
    seen = {at: f"analog.{name}" for name, at in board.analog.items()}
    for number, channel in enumerate(taxels.inputs):
        here: Place = ("taxels", "inputs", number)
        if reason := _no_channel(board.microcontroller, channel):
            yield here, reason
        if channel in seen:
            yield here, f"{channel} is already {seen[channel]}: give each input its own channel"
        seen[channel] = spelled(here)
    rows = () if board.matrix is None else board.matrix.rows
    for number, pin in enumerate(taxels.select):
        if board.avr is not None and pin[:2] in {row[:2] for row in rows}:
            yield ("taxels", "select", number), f"port {pin[1:2]} drives a row of the matrix: use another port"


def _of_pins(board: Board) -> Iterator[Fault]:
    part = board.microcontroller
    taken = _held(board, part)
    for place, pin in _used(board):
        if pin in part.tied:
            yield place, f"{pin} of {part.named} cannot be used: {part.tied[pin]}"
        elif pin not in part.pins and pin not in taken:
            yield place, f"{part.named} has no usable pin {pin!r}{nearest(pin, part.pins)}"
        if pin in taken:
            yield place, f"{pin} is already {taken[pin]}: use another pin"
        taken[pin] = f"the pin of {spelled(place)}"


def _held(board: Board, part: Wired) -> dict[str, str]:
    """Return the pins that are not free, and their uses."""
    held = dict.fromkeys(part.uarts[0], "a pin of UART 0 (the host's)")
    if board.cyberglove is not None and board.cyberglove.uart < len(part.uarts):
        number = board.cyberglove.uart
        held |= dict.fromkeys(part.uarts[number], f"a pin of UART {number} (the glove's)")
    if board.chips:
        held |= dict(zip(part.twi, ("the bus's SDA", "the bus's SCL"), strict=True))
    return held


def _used(board: Board) -> Iterator[tuple[Place, str]]:
    yield from ((("pins", name), pin) for name, pin in board.pins.items())
    if board.matrix is not None:
        yield from ((("matrix", "rows", n), pin) for n, pin in enumerate(board.matrix.rows))
        yield from ((("matrix", "columns", n), pin) for n, pin in enumerate(board.matrix.columns))
    channels = board.microcontroller.analog
    yield from ((("analog", name), channels[at]) for name, at in board.analog.items() if channels.get(at))
    if board.taxels is not None:
        yield from ((("taxels", "select", n), pin) for n, pin in enumerate(board.taxels.select))
        inputs = enumerate(board.taxels.inputs)
        yield from ((("taxels", "inputs", n), channels[at]) for n, at in inputs if channels.get(at))


def _of_names(board: Board) -> Iterator[Fault]:
    """Check the names; those in TOML keys are unique anyway, and those of chips have been checked."""
    joints: list[tuple[Place, str]] = [(("analog", name), name) for name in board.analog]
    if board.cyberglove is not None:
        joints += [(("cyberglove", "joints", n), name) for n, name in enumerate(board.cyberglove.joints) if name]
    for place, name in joints:
        if reason := fault(name):
            yield place, f"{shortened(repr(name))} is not a valid joint name: it {reason}"
    named: list[tuple[Place, str]] = [(("pins", name), name) for name in board.pins]
    if board.matrix is not None:
        rows = enumerate(board.matrix.switches)
        named += [(("matrix", "switches", r, c), name) for r, row in rows for c, name in enumerate(row) if name]
    if board.taxels is not None:
        named += [(("taxels", "names", n), name) for n, name in enumerate(board.taxels.names) if name]
    seen: dict[str, Place] = {}
    for place, name in named:
        if reason := fault(name):
            yield place, f"{shortened(repr(name))} is not a valid switch name: it {reason}"
        if name in seen:
            yield place, f"switch {name!r} is already at {spelled(seen[name])}: give each switch one place"
        seen[name] = place


def load_board(path: str | Path) -> Board:
    """Return the board in a TOML file. Raises FirmwareError with file, line and key."""
    return _board_of(read_source(Path(path), FirmwareError))


def parse_board(text: str, name: str = "board.toml") -> Board:
    """Return the board in `text`, which messages call `name`. Raises FirmwareError as `load_board` does."""
    return _board_of(TomlText(name, text, FirmwareError))


def _board_of(source: TomlText) -> Board:
    tables = source.tables()
    check_finite(source, (), tables)
    board = convert(source, (), tables, Board)
    for place, reason in faults(board):
        raise source.error(place, reason)
    return board

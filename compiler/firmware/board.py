"""How a microcontroller is wired to a glove: the tables of `board.toml`, field by field.

Keys are numbered as the board numbers them in its frames: with pins and chips, key k is the build's kept switch k, all
in one row; in a matrix it is row * columns + column.
"""

from collections.abc import Sequence
from typing import Annotated, Literal

from msgspec import Meta, Struct, field

from thenar.runtime.harness.wiring import Baud, ChipWiring, Debounce, Harness, ScannerWiring
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.names import list_names

from .errors import FirmwareError
from .targets.avr import AVRS, Avr
from .words import Names

Microseconds = Annotated[int, Meta(ge=0, le=60_000_000)]
ShortMicroseconds = Annotated[int, Meta(ge=0, le=65_535)]


class _Table(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of `board.toml`."""


class BoardDebounce(_Table, frozen=True):
    """Debouncing on the board, as SET_DEBOUNCE would set it; 0: not at all, which leaves it to the host."""

    press_us: ShortMicroseconds = 0
    release_us: ShortMicroseconds = 0


class Matrix(_Table, frozen=True):
    """A matrix of keys: rows are driven low one at a time, columns are read against the part's pull-ups.

    switches   names, a list a row, "" where there is no key
    diodes     whether every key has one, its cathode towards the row
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


class GloveUart(_Table, frozen=True):
    """A CyberGlove on a UART of the part: `joints` are our names of its sensors in wire order, "" for one not used."""

    uart: Annotated[int, Meta(ge=0, le=3)] = 1
    baud: Baud = 115_200
    sensors: Literal[18, 22] = 18
    rate_hz: Annotated[float, Meta(gt=0.0, le=1000.0)] | None = None
    joints: tuple[str, ...] = ()


class Board(_Table, frozen=True):
    """A microcontroller and what hangs on its pins; one that was loaded has been found sound.

    pins and analog map names of switches and joints to pins ("PD2") and channels ("ADC0").
    """

    part: str
    clock_hz: Annotated[int, Meta(ge=1_000_000, le=20_000_000)] = 16_000_000
    baud: Annotated[int, Meta(ge=1200, le=2_500_000)] = 1_000_000
    board: Annotated[int, Meta(ge=0, le=0xFFFF_FFFF)] = 1
    scan_us: Annotated[int, Meta(ge=100, le=60_000_000)] = 1000
    state_us: Microseconds = 0
    heartbeat_us: Microseconds = 50_000
    early_exit: bool = False
    debounce: BoardDebounce = BoardDebounce()
    pins: dict[str, str] = {}
    matrix: Matrix | None = None
    bus: BoardBus = BoardBus()
    chips: tuple[ChipWiring, ...] = field(default=(), name="chip")
    cyberglove: GloveUart | None = None
    analog: dict[str, str] = {}

    @property
    def microcontroller(self) -> Avr:
        """The target whose part it is."""
        return AVRS[self.part]

    @property
    def wired(self) -> tuple[str, ...]:
        """The names of all switches that are wired."""
        if self.matrix is not None:
            return tuple(name for row in self.matrix.switches for name in row if name)
        return (*self.pins, *(name for chip in self.chips for name in chip.numbered_pins.values()))


def rows_and_columns(board: Board, switches: Sequence[str]) -> tuple[int, int]:
    """Return how many rows and columns of keys the board tells the host of; pins and chips are one row."""
    if board.matrix is not None:
        return len(board.matrix.rows), len(board.matrix.columns)
    return 1, len(switches)


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
            f"the board has no pin or key for {list_names(lacking)}, which the build keeps: add what is missing to "
            "its board.toml, or compile the build for the switches that are there"
        )
    if not switches:
        raise FirmwareError(
            "the build keeps no switch, so there is nothing to scan: compile it with --inputs both or switches"
        )


def glove_toml(name: str, board: Board, names: Names, port: str = "/dev/ttyACM0") -> str:
    """Return the `glove.toml` for a host that has the board at `port`. A board that debounces is not debounced again.

    Raises FirmwareError if the board lacks a switch of the build.
    """
    switches = tuple(switch.name for switch in names.switches)
    check_switches(board, switches)
    line = ScannerWiring(port=port, baud=board.baud, switches=key_names(board, switches))
    debounce = Debounce(enabled=not (board.debounce.press_us or board.debounce.release_us))
    return harness_to_toml(Harness(name=name, scanners=(line,), debounce=debounce))

"""Sketches for boards that print rows: they read those inputs of a stream's board that a build keeps."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from itertools import combinations
from operator import xor

from thenar.firmware_templates.rendering import render
from thenar.runtime.harness.wiring import BoardMatrix, BoardWiring, BusWiring, Harness, StreamWiring
from thenar.runtime.manifest import Manifest
from thenar.runtime.names import list_names, shortened
from thenar.runtime.scanning.ports import ports_of
from thenar.runtime.scanning.timing import reading_of

from . import FirmwareError
from .words import check_name, comment, string

_SEPARATORS = ",*$"
_BITS_A_BYTE = 10  # on a serial line
# The number of a switch or a reading, the pin or the expression that gives it, its name.
_Input = tuple[int, str, str]


@dataclass(frozen=True, slots=True)
class _Kept:
    """The elements of a build: switches, and joints and taxels, which are readings."""

    switches: tuple[str, ...]
    readings: tuple[str, ...]

    @classmethod
    def of(cls, names: Manifest, harness: Harness) -> "_Kept":
        """Return those of a build; a level that is wired as a switch is a switch."""
        wired = set(harness.switches)
        switches = (each.name for each in names.switches if each.threshold is None or each.name in wired)
        levels = (each.threshold for each in names.switches if each.threshold is not None and each.name not in wired)
        taxels = dict.fromkeys(level.taxel.name for level in levels)
        return cls(tuple(switches), (*(joint.name for joint in names.joints), *taxels))

    def on(self, stream: StreamWiring) -> "_Kept":
        """Return those that are columns of a stream."""
        measured = {*stream.joints, *stream.taxels}
        switches = (name for name in self.switches if name in stream.switches)
        return _Kept(tuple(switches), tuple(name for name in self.readings if name in measured))

    @property
    def columns(self) -> tuple[str, ...]:
        """All of them, as a board names them."""
        return (*self.switches, *self.readings)

    @property
    def nibbles(self) -> int:
        """The number of hexadecimal digits of the switches."""
        return -(-len(self.switches) // 4)

    @property
    def longest(self) -> int:
        """The number of bytes of the longest row."""
        number, clock = (1 << 16) - 1, (1 << 32) - 1
        return len(f"$row,{number},{clock},{'F' * self.nibbles}{f',{number}' * len(self.readings)}*00\r\n")


def rows_files(name: str, names: Manifest, harness: Harness) -> dict[str, str]:
    """Return path -> text of a folder with a sketch for every board of the harness that has elements of a build.

    Parameters
    ----------
    name : str
        The name of the sketch, as `words.check_name` allows it; the second board's is `name`_2.
    names : Manifest
        The build's manifest.
    harness : Harness
        The glove, whose streams describe the boards.

    Raises
    ------
    FirmwareError
        If no stream has a board, an element of the build is not wired, or a board cannot read or print one.
    """
    check_name(name)
    kept = _Kept.of(names, harness)
    known = {*harness.switches, *harness.sensor_names, *harness.taxel_names}
    if lacking := [element for element in kept.columns if element not in known]:
        raise FirmwareError(f"harness {harness.name!r} has no {list_names(lacking)}, which the build keeps: add it")
    boards = [(stream, stream.board, kept.on(stream)) for stream in harness.streams if stream.board is not None]
    boards = [(stream, board, own) for stream, board, own in boards if own.columns]
    if not boards:
        raise FirmwareError(
            f"no stream of harness {harness.name!r} has a board with elements of the build: describe the board's "
            "inputs in [stream.board]"
        )
    files, sketches = dict[str, str](), []
    for number, (stream, board, own) in enumerate(boards, 1):
        sketch = name if number == 1 else f"{name}_{number}"
        files[f"{sketch}/{sketch}.ino"] = _sketch(sketch, own, stream, board)
        baud = round(_BITS_A_BYTE * own.longest * stream.rate_hz)
        sketches.append({"name": sketch, "stream": stream, "kept": own, "baud": baud})
    return {**files, "README.md": render("rows/README.md.j2", name=name, sketches=sketches)}


def _sketch(name: str, kept: _Kept, stream: StreamWiring, board: BoardWiring) -> str:
    if lacking := [element for element in kept.columns if element not in board.wired]:
        raise FirmwareError(
            f"the board at {stream.port} has no pin for {list_names(lacking)}, which the build keeps: add it to "
            "[stream.board]"
        )
    if odd := next((element for element in kept.columns if set(_SEPARATORS) & set(element)), None):
        raise FirmwareError(
            f"{shortened(repr(odd))} cannot be the name of a column, which ends at a comma or an asterisk and has no "
            "dollar sign: give the element another name in the recordings and in glove.toml"
        )
    numbers = {name: number for number, name in enumerate(kept.switches)}
    pins = [(numbers[name], pin, comment(name)) for name, pin in board.pins.items() if name in numbers]
    matrix = [] if board.matrix is None else list(_matrix_rows(board.matrix, numbers))
    columns = (pin for _, keys in matrix for _, pin, _ in keys)
    # The readings of analog pins, and by the channel of the multiplexers those behind them.
    analog, channels = list[_Input](), dict[int, list[_Input]]()
    for number, reading in enumerate(kept.readings):
        pin, _, channel = board.pins[reading].partition(".")
        (channels.setdefault(int(channel), []) if channel else analog).append((number, pin, comment(reading)))
    line = ",".join(("columns", *kept.columns))  # everything between `$` and `*`
    return render(
        "rows/NAME.ino.j2",
        name=name,
        kept=kept,
        stream=stream,
        board=board,
        names=[string(f",{name}") for name in kept.columns],
        checksum=f"{reduce(xor, line.encode()):02X}",
        pins=pins,
        matrix=matrix,
        pulled_up=dict.fromkeys((*(pin for _, pin, _ in pins), *(pin for pin, _ in matrix), *columns)),
        chips=list(_chips(board, numbers)),
        analog=analog,
        channels=sorted(channels.items()),
    )


def _matrix_rows(matrix: BoardMatrix, numbers: dict[str, int]) -> Iterator[tuple[str, list[_Input]]]:
    """Yield the pin of each row that has a switch of the build, and these switches with the pins of their columns."""
    _check_ghosts(matrix, numbers)
    for row, keys in zip(matrix.rows, matrix.keys, strict=True):
        placed = zip(keys, matrix.columns, strict=True)
        if inputs := [(numbers[key], column, comment(key)) for key, column in placed if key in numbers]:
            yield row, inputs


def _check_ghosts(matrix: BoardMatrix, numbers: dict[str, int]) -> None:
    """Raise FirmwareError if a switch of the build reads closed when three others are: a hand closes many at once."""
    for one, other in () if matrix.diodes else combinations(matrix.keys, 2):
        pairs = combinations([keys for keys in zip(one, other, strict=True) if all(keys)], 2)
        if square := next((keys for keys in ((*a, *b) for a, b in pairs) if numbers.keys() & set(keys)), None):
            raise FirmwareError(
                f"the matrix has no diodes, so that of {list_names(square)} the fourth reads closed when three are: "
                "put a diode in series with every key, and set diodes = true"
            )


def _chips(board: BoardWiring, numbers: dict[str, int]) -> Iterator[dict[str, object]]:
    """Yield the chips with a switch of the build: how they are set up, and the fewest readings that show the switches.

    The steps of the setup, and the conditions of a reading, are expressions in C++.
    """
    harness = Harness(name="board", buses=(BusWiring(device="bus", chips=board.chips),))
    ports = ports_of(harness, numbers, {})
    names = dict(enumerate(numbers))
    for place, wired in enumerate(board.chips):
        own = [(port, reading_of(port, harness)) for port in ports if port.chip == place]
        if not own:
            continue
        address, setup, readings = f"0x{wired.address:02X}", list[str](), []
        for write in wired.chip.setup(frozenset(wired.numbered_pins)):
            setup.append(f"write_chip({address}, {_hexed(write.data)})")
            if write.expect:
                setup.append(f"chip_has({address}, {_hexed(write.data[:1] + write.expect)})")
        for port, reading in own:
            high = enumerate(reading.high.to_bytes(reading.length, "little"))
            inputs = [
                (switch, f"{'' if port.closed_high else '!'}(reply[{bit // 8}] & 0x{1 << bit % 8:02X})")
                for bit, switch in port.switches
            ]
            readings.append(
                {
                    "read": f"read_chip({address}, {_hexed(reading.command)}, reply, {reading.length})",
                    "lost": "".join(f" || (reply[{byte}] & 0x{m:02X}) != 0x{m:02X}" for byte, m in high if m),
                    "inputs": [(switch, closed, comment(names[switch])) for switch, closed in inputs],
                }
            )
        yield {"place": wired.place, "setup": setup, "readings": readings}


def _hexed(data: bytes) -> str:
    return ", ".join(f"0x{byte:02X}" for byte in data)

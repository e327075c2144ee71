"""Sketches that print rows, on this machine with all kinds of inputs, and on an Uno in simavr."""

import ctypes
import random
import re
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import reduce
from itertools import pairwise
from operator import xor
from pathlib import Path

import pytest
import tomli_w
from msgspec.structs import replace

from thenar.compiler.firmware.rows import rows_files
from thenar.compiler.firmware.targets.avr import harness as simavr_program
from thenar.drivers.i2c.chips import CHIPS, Device
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.manifest import Calibration, Manifest, Switch, Threshold

from ...conftest import tool
from ...tables import describe
from .conftest import make_tables

Named = Callable[[Sequence[str], Sequence[str], Sequence[str]], Manifest]

SHIM = Path(__file__).with_name("arduino")
STRICT = ("-std=gnu++11", "-Wall", "-Wextra", "-Werror")
SANITIZED = ("-O1", "-shared", "-fPIC", "-fsanitize=undefined", "-fno-sanitize-recover=all")
LOW, HIGH, OUTPUT, PULLED_UP = 0, 1, 1, 2
A0 = 100
WRAP = 1 << 32


@dataclass
class Board:
    """A board: what hangs on its pins, by the names of the elements."""

    pins: dict[str, int] = field(default_factory=dict)
    matrix: dict[str, tuple[int, int]] = field(default_factory=dict)
    chips: dict[str, tuple[int, int]] = field(default_factory=dict)  # address, number of the pin
    kinds: dict[int, tuple[str, str]] = field(default_factory=dict)  # address: kind of a chip, level of closed switches
    analog: dict[str, int] = field(default_factory=dict)
    muxed: dict[str, tuple[int, int]] = field(default_factory=dict)
    select: tuple[int, ...] = (40, 41, 42, 43)
    taxels: set[str] = field(default_factory=set)
    rate_hz: int = 200

    @property
    def switches(self) -> list[str]:
        return sorted([*self.pins, *self.matrix, *self.chips])

    @property
    def readings(self) -> list[str]:
        return sorted([*self.analog, *self.muxed])

    @property
    def toml(self) -> str:
        """The glove.toml that describes it."""
        pins = {name: str(pin) for name, pin in self.pins.items()}
        pins |= {name: f"A{pin - A0}" for name, pin in self.analog.items()}
        pins |= {name: f"A{pin - A0}.{channel}" for name, (pin, channel) in self.muxed.items()}
        board: dict[str, object] = {"pins": pins}
        if self.muxed:
            board["select"] = [*map(str, self.select)]
        if self.matrix:
            rows, columns = (sorted({place[n] for place in self.matrix.values()}) for n in (0, 1))
            at = {place: name for name, place in self.matrix.items()}
            keys = [[at.get((row, column), "") for column in columns] for row in rows]
            lines = {"rows": [*map(str, rows)], "columns": [*map(str, columns)]}
            board["matrix"] = {**lines, "keys": keys, "diodes": True}
        board["chip"] = [
            {
                "kind": kind,
                "address": address,
                "closed": closed,
                "pins": {CHIPS[kind].pins[pin]: name for name, (at, pin) in self.chips.items() if at == address},
            }
            for address, (kind, closed) in self.kinds.items()
        ]
        stream: dict[str, object] = {"port": "/dev/ttyACM0", "rate_hz": self.rate_hz, "switches": self.switches}
        for kind in ("joints", "taxels"):
            stream[kind] = {n: [0, 1023] for n in self.readings if (n in self.taxels) == (kind == "taxels")}
        return tomli_w.dumps({"name": "g", "stream": [{**stream, "board": board}]})


def random_board(rng: random.Random) -> Board:
    """Return a board with some inputs of every kind, or of a few kinds."""
    board, numbers = Board(), iter(range(1000))
    free = rng.sample(range(2, 40), 30)
    board.pins = {f"s{next(numbers)}": free.pop() for _ in range(rng.choice([0, 1, 5, 9]))}
    rows, columns = [free.pop() for _ in range(rng.randint(1, 4))], [free.pop() for _ in range(rng.randint(1, 5))]
    keys = [(row, column) for row in rows for column in columns]
    board.matrix = {f"s{next(numbers)}": keys.pop() for _ in range(rng.choice([0, len(keys)]))}
    for address in rng.sample([0x20, 0x22, 0x23], rng.choice([0, 1, 3])):
        registers = [name for name, chip in CHIPS.items() if address in chip.addresses and chip.registers]
        kind = rng.choice([name for name in registers if name in {"mcp23008", "mcp23017", "pca9555", "tca6424a"}])
        chip = CHIPS[kind]
        usable = [number for number, pin in enumerate(chip.pins) if pin not in chip.not_inputs]
        board.kinds[address] = kind, "high" if kind == "tca6424a" else "low"
        used = rng.sample(usable, rng.randint(1, len(usable)))
        board.chips |= {f"s{next(numbers)}": (address, pin) for pin in used}
    board.analog = {f"r{next(numbers)}": A0 + pin for pin in rng.sample(range(4), rng.randint(0, 3))}
    taps = [(A0 + pin, channel) for pin in (4, 5) for channel in range(16)]
    board.muxed = {f"r{next(numbers)}": tap for tap in rng.sample(taps, rng.choice([0, 1, 9]))}
    board.taxels = {name for name in board.readings if rng.random() < 0.4}
    return board


class World:
    """What a sketch finds at its pins and its bus: the board's inputs, and the time that calls take."""

    def __init__(self, board: Board, clock: int = 0, tick_us: int = 11) -> None:
        self.board, self.clock, self.tick_us = board, clock, tick_us
        self.closed: set[str] = set()
        self.values: dict[str, int] = {}
        self.modes: dict[int, int] = {}
        self.levels: dict[int, int] = {}
        self.changed: dict[int, int] = {}
        self.chips: dict[int, Device] = {address: CHIPS[kind].model() for address, (kind, _) in board.kinds.items()}
        self.unplugged: set[int] = set()
        self.printed: list[str] = []
        self.datagrams: list[tuple[str, int, str]] = []
        self.wifi = True

    def set(self, closed: set[str], values: dict[str, int]) -> None:
        """Set all inputs."""
        self.closed, self.values = closed, values
        for address, chip in self.chips.items():
            here = {pin: name for name, (at, pin) in self.board.chips.items() if at == address}
            high = self.board.kinds[address][1] == "high"
            low = sum(1 << pin for pin, name in here.items() if (name in closed) != high)
            chip.levels = (1 << chip.pins) - 1 & ~low

    def micros(self) -> int:
        self.clock += self.tick_us
        return self.clock % WRAP

    def delay(self, us: int) -> None:
        self.clock += us

    def mode(self, pin: int, mode: int) -> None:
        self.modes[pin], self.changed[pin] = mode, self.clock

    def write(self, pin: int, level: int) -> None:
        assert self.modes[pin] == OUTPUT
        self.levels[pin], self.changed[pin] = level, self.clock

    def read(self, pin: int) -> int:
        assert self.modes[pin] == PULLED_UP
        direct = any(at == pin and name in self.closed for name, at in self.board.pins.items())
        return LOW if direct or any(self._pulls(key, pin) for key in self.board.matrix) else HIGH

    def _pulls(self, key: str, pin: int) -> bool:
        """Return whether a key pulls its column low; the wire takes 15 us."""
        row, column = self.board.matrix[key]
        driven = self.modes.get(row) == OUTPUT and self.levels[row] == LOW and self.clock - self.changed[row] >= 15
        return column == pin and key in self.closed and driven

    def analog(self, pin: int) -> int:
        self.clock += 110
        for name, at in self.board.analog.items():
            if at == pin:
                return self.values[name]
        assert self.clock - max(self.changed[select] for select in self.board.select) >= 200
        channel = sum(self.levels[select] << bit for bit, select in enumerate(self.board.select))
        return next(self.values[name] for name, at in self.board.muxed.items() if at == (pin, channel))

    def bus_write(self, address: int, data: "ctypes._Pointer[ctypes.c_uint8]", size: int) -> int:
        self.clock += 25 * (size + 1)
        if address in self.unplugged or address not in self.chips:
            return 0
        self.chips[address].write(bytes(data[:size]))
        return 1

    def bus_read(self, address: int, data: "ctypes._Pointer[ctypes.c_uint8]", size: int) -> int:
        self.clock += 25 * (size + 1)
        if address in self.unplugged:
            return 0
        for place, byte in enumerate(self.chips[address].read(size)):
            data[place] = byte
        return 1

    def print(self, text: bytes) -> None:
        self.printed.append(text.decode())

    def joined(self) -> int:
        return int(self.wifi)

    def datagram(self, host: bytes, port: int, text: bytes) -> None:
        self.datagrams.append((host.decode(), port, text.decode()))


_BYTES, _INT = ctypes.POINTER(ctypes.c_uint8), ctypes.c_int
CALLS = {
    "micros": ctypes.CFUNCTYPE(ctypes.c_uint32),
    "delay": ctypes.CFUNCTYPE(None, _INT),
    "mode": ctypes.CFUNCTYPE(None, _INT, _INT),
    "write": ctypes.CFUNCTYPE(None, _INT, _INT),
    "read": ctypes.CFUNCTYPE(_INT, _INT),
    "analog": ctypes.CFUNCTYPE(_INT, _INT),
    "bus_write": ctypes.CFUNCTYPE(_INT, _INT, _BYTES, _INT),
    "bus_read": ctypes.CFUNCTYPE(_INT, _INT, _BYTES, _INT),
    "print": ctypes.CFUNCTYPE(None, ctypes.c_char_p),
    "joined": ctypes.CFUNCTYPE(_INT),
    "datagram": ctypes.CFUNCTYPE(None, ctypes.c_char_p, _INT, ctypes.c_char_p),
}


class Running:
    """A sketch that runs in a world."""

    def __init__(self, library: Path, world: World) -> None:
        self.world, self._library = world, ctypes.CDLL(str(library))
        self._calls = {name: kind(getattr(world, name)) for name, kind in CALLS.items()}
        functions = (ctypes.c_void_p * len(CALLS)).in_dll(self._library, "world")
        for place, call in enumerate(self._calls.values()):
            functions[place] = ctypes.cast(call, ctypes.c_void_p)
        self._library.begin()

    def run(self, us: int) -> list[str]:
        """Return the lines that it prints in so many microseconds."""
        end = self.world.clock + us
        self.world.printed.clear()
        while self.world.clock < end:
            self._library.turn()
        return "".join(self.world.printed).splitlines(keepends=True)


@dataclass(frozen=True)
class Row:
    number: int
    clock: int
    closed: set[int]
    readings: list[int]


def fields_of(line: str) -> list[str]:
    """Return the fields of a line, whose checksum is right."""
    found = re.fullmatch(r"\$([^$*\r\n]*)\*([0-9A-F]{2})\r\n", line)
    assert found is not None, line
    assert int(found[2], 16) == reduce(xor, found[1].encode()), line
    return found[1].split(",")


def row_of(line: str, switches: int) -> Row:
    word, number, clock, bits, *readings = fields_of(line)
    assert word == "row"
    assert len(bits) == (switches + 3) // 4
    value = int(bits, 16) if bits else 0
    assert value < 1 << switches
    return Row(
        int(number), int(clock), {k for k in range(switches) if value >> k & 1}, [int(each) for each in readings]
    )


@pytest.fixture
def named() -> Named:
    """Return what makes the names of a build: switches, joints, and taxels, each of which has two levels."""

    def named(switches: Sequence[str], joints: Sequence[str], taxels: Sequence[str]) -> Manifest:
        plain = [Switch(number, name, 0.5) for number, name in enumerate(switches)]
        levels = [
            Switch(0, f"{name}>{code}", 0.5, Threshold(code, 0.0, Calibration(0, name, "counts", 0, 0.0, 1, 1.0)))
            for name in taxels
            for code in (100, 600)
        ]
        raw = tuple(Calibration(number, name, "raw", 1, 1.0, 255, 255.0) for number, name in enumerate(joints))
        return replace(describe(make_tables()), switches=(*plain, *levels), joints=raw)

    return named


@pytest.fixture
def compiled(tmp_path: Path) -> Callable[..., Path]:
    """Return what compiles the only sketch of a folder for this machine, strictly."""

    def compiled(files: dict[str, str], secrets: str = "") -> Path:
        (path,) = (path for path in files if path.endswith(".ino"))
        folder = tmp_path / Path(path).stem
        folder.mkdir()
        (folder / "sketch.ino").write_text(files[path])
        for name in ("Wire.h", "WiFi.h", "WiFiUdp.h"):
            (folder / name).write_text("")
        if secrets:
            (folder / "secrets.h").write_text(secrets)
        (folder / "program.cpp").write_text(
            "#include <Arduino.h>\nWorld world;\nSerialPort Serial;\nTwoWire Wire;\nWiFiClass WiFi;\n"
            '#include "sketch.ino"\n'
            'extern "C" void begin() { setup(); }\nextern "C" void turn() { loop(); }\n'
        )
        command = [tool("g++"), *STRICT, *SANITIZED, f"-I{SHIM}", f"-I{folder}", str(folder / "program.cpp")]
        done = subprocess.run([*command, "-o", str(folder / "program.so")], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert done.stderr == ""
        return folder / "program.so"

    return compiled


def levels_of(rng: random.Random, board: Board) -> tuple[set[str], dict[str, int]]:
    closed = {name for name in board.switches if rng.random() < 0.5}
    return closed, {name: rng.randint(0, 1023) for name in board.readings}


@pytest.mark.parametrize("seed", range(12))
def test_rows_hold_the_levels_of_whatever_is_kept(seed: int, named: Named, compiled: Callable[..., Path]) -> None:
    rng = random.Random(seed)
    board = random_board(rng)
    switches = [name for name in board.switches if rng.random() < 0.8] or board.switches
    readings = [name for name in board.readings if rng.random() < 0.8] or board.readings
    rng.shuffle(switches)
    rng.shuffle(readings)
    joints, taxels = ([n for n in readings if (n in board.taxels) == taxel] for taxel in (False, True))
    library = compiled(rows_files("hand", named(switches, joints, taxels), parse_harness(board.toml, "glove.toml")))
    world = World(board, clock=WRAP - 150_000)
    world.set(*levels_of(rng, board))
    running = Running(library, world)
    numbers = []
    for _ in range(60):
        closed, values = levels_of(rng, board)
        world.set(closed, values)
        for line in running.run(5000):
            if line.startswith("$columns"):
                assert fields_of(line) == ["columns", *switches, *joints, *taxels]
            else:
                row = row_of(line, len(switches))
                assert {switches[k] for k in row.closed} == closed & set(switches)
                assert row.readings == [values[name] for name in (*joints, *taxels)]
                numbers.append((row.number, row.clock))
    assert [number for number, _ in numbers] == list(range(len(numbers)))
    assert len(numbers) >= 30
    assert any(after < before for (_, before), (_, after) in pairwise(numbers))
    steps = [(after - before) % WRAP for (_, before), (_, after) in pairwise(numbers)]
    assert abs(sum(steps) / len(steps) - 5000) < 500 or min(steps) > 5000


FOUR = Board(pins={"a": 2, "b": 3, "c": 4}, chips={"d": (0x20, 0)}, kinds={0x20: ("mcp23017", "low")})


@pytest.fixture
def four(named: Named, compiled: Callable[..., Path]) -> Running:
    """Return a sketch of three switches on pins and one on a chip."""
    world = World(FOUR)
    world.set(set(), {})
    return Running(compiled(rows_files("hand", named("abcd", [], []), parse_harness(FOUR.toml, "glove.toml"))), world)


def rows_in(lines: Sequence[str]) -> Iterator[Row]:
    return (row_of(line, 4) for line in lines if line.startswith("$row"))


def test_columns_come_first_and_then_every_second_and_rows_at_their_rate(four: Running) -> None:
    lines = four.run(5_000_000)
    assert lines[0].startswith("$columns,a,b,c,d*")
    assert sum(line.startswith("$columns") for line in lines) == 5
    clocks = [row.clock for row in rows_in(lines)]
    assert abs(len(clocks) - 1000) <= 2
    assert all(abs(clock - clocks[0] - 5000 * number) < 500 for number, clock in enumerate(clocks))


def test_the_number_of_a_row_begins_again_after_65535(named: Named, compiled: Callable[..., Path]) -> None:
    board = Board(pins={"a": 2}, rate_hz=10_000)
    world = World(board, tick_us=100)
    files = rows_files("hand", named(["a"], [], []), parse_harness(board.toml, "glove.toml"))
    lines = Running(compiled(files), world).run(66_000 * 100)
    numbers = [row_of(line, 1).number for line in lines if line.startswith("$row")]
    assert numbers == [number % 65_536 for number in range(len(numbers))]
    assert len(numbers) > 65_900


@pytest.mark.parametrize("how", ["unplugged", "without power"])
def test_a_lost_chip_skips_rows_and_is_set_up_again(four: Running, how: str) -> None:
    world = four.world
    before = list(rows_in(four.run(100_000)))
    if how == "unplugged":
        world.unplugged.add(0x20)
        assert list(rows_in(four.run(100_000))) == []
        world.unplugged.clear()
    world.chips[0x20].reset()
    world.set({"a", "d"}, {})
    after = list(rows_in(four.run(100_000)))
    assert after[0].number > before[-1].number + 1
    assert all(row.closed == {0, 3} for row in after)
    lost = 20 if how == "unplugged" else 0
    assert abs(len(after) - 19) <= 1
    assert abs(after[0].number - before[-1].number - 2 - lost) <= 1


SECRETS = '#define SSID "lab"\n#define PASSWORD "secret"\n#define HOST "10.0.0.7"\n#define PORT 5253\n'


def test_with_secrets_rows_are_datagrams_and_networks_are_rejoined(named: Named, compiled: Callable[..., Path]) -> None:
    board = Board(pins={"a": 2}, analog={"i": A0})
    world = World(board, tick_us=50)
    world.set({"a"}, {"i": 700})
    world.wifi = False
    files = rows_files("hand", named(["a"], ["i"], []), parse_harness(board.toml, "glove.toml"))
    running = Running(compiled(files, SECRETS), world)
    assert running.run(12_000_000) == []
    assert world.datagrams == [("joins", 0, "")] * 2
    world.wifi, world.datagrams = True, []
    assert running.run(1_100_000) == []
    assert {(host, port) for host, port, _ in world.datagrams} == {("10.0.0.7", 5253)}
    lines = [text for _, _, text in world.datagrams]
    assert any(fields_of(line) == ["columns", "a", "i"] for line in lines)
    rows = [row_of(line, 1) for line in lines if line.startswith("$row")]
    assert len(rows) > 200
    assert all((row.closed, row.readings) == ({0}, [700]) for row in rows)


def test_every_board_gets_a_sketch_of_its_own_elements(named: Named) -> None:
    second = '[[stream]]\nport = "/dev/ttyACM1"\nswitches = ["x", "y"]\n[stream.board]\npins = { x = "2", y = "3" }\n'
    glove = FOUR.toml + second + '[cyberglove]\nport = "/dev/ttyUSB0"\njoints = ["bent"' + ', ""' * 17 + "]\n"
    files = rows_files("hand", named(["y", "a", "d"], ["bent"], []), parse_harness(glove, "glove.toml"))
    assert set(files) == {"hand/hand.ino", "hand_2/hand_2.ino", "README.md"}
    assert re.findall(r'^ +",(\w+)"$', files["hand/hand.ino"], re.MULTILINE) == ["a", "d"]
    assert re.findall(r'^ +",(\w+)"$', files["hand_2/hand_2.ino"], re.MULTILINE) == ["y"]
    assert "Wire" not in files["hand_2/hand_2.ino"]
    assert "| `hand_2/` | `/dev/ttyACM1` | 1 | 0 |" in files["README.md"]


def test_a_name_of_any_kind_is_printed_and_ends_no_comment(named: Named, compiled: Callable[..., Path]) -> None:
    odd = ["x/ \\", 'tip "??/ \\', "Daumenspitze é", "// {{"]
    board = Board(pins={name: pin for pin, name in enumerate(odd, 2)})
    world = World(board)
    world.set({odd[1]}, {})
    files = rows_files("hand", named(odd, [], []), parse_harness(board.toml, "glove.toml"))
    assert files["hand/hand.ino"].isascii()
    lines = Running(compiled(files), world).run(100_000)
    assert fields_of(lines[0]) == ["columns", *odd]
    assert all(row.closed == {1} for row in rows_in(lines))


UNO = """\
name = "g"
[[stream]]
port = "/dev/ttyACM0"
rate_hz = 100
switches = ["a", "b", "c", "d", "e"]
joints = { i = [0, 1023], k = [0, 1023] }
[stream.board]
pins = { a = "2", b = "3", c = "8", d = "12", e = "A3", i = "A0", k = "A1" }
"""
AVR_PINS = {"a": "D2", "b": "D3", "c": "B0", "d": "B4", "e": "C3"}


@pytest.fixture
def built(tmp_path: Path, arduino: Callable[..., Path]) -> Callable[..., Path]:
    """Return what has Arduino's builder compile a sketch for an Uno, without a warning."""

    def built(files: dict[str, str]) -> Path:
        for name, text in files.items():
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).write_text(text)
        (sketch,) = tmp_path.glob("*/*.ino")
        return arduino(sketch, sketch.name)

    return built


@pytest.mark.slow
def test_a_sketch_with_inputs_of_every_kind_compiles_for_an_uno(named: Named, built: Callable[..., Path]) -> None:
    board = Board(
        pins={"a": 2},
        matrix={"b": (8, 9), "c": (10, 9)},
        chips={"d": (0x20, 3), "e": (0x21, 8)},
        kinds={0x20: ("mcp23008", "low"), 0x21: ("pca9555", "low")},
        analog={"i": A0},
        muxed={"k": (A0 + 1, 4), "t": (A0 + 1, 15)},
        select=(4, 5, 6, 7),
        taxels={"t"},
    )
    assert built(rows_files("hand", named("abcde", "ik", "t"), parse_harness(board.toml, "glove.toml"))).is_file()


@pytest.mark.slow
def test_on_an_uno_rows_hold_the_levels_of_pins_and_analog_pins(named: Named, built: Callable[..., Path]) -> None:
    tool("avr-gcc")
    elf = built(rows_files("hand", named("abcde", "ik", ""), parse_harness(UNO, "glove.toml")))
    program, rng = simavr_program("simavr_rows"), random.Random(1)
    for _ in range(8):
        closed, volts = {n for n in range(5) if rng.random() < 0.5}, [rng.randint(0, 4990) for _ in range(2)]
        levels = [f"{AVR_PINS['abcde'[n]]}=0" for n in closed]
        levels += [f"ADC{n}={millivolts}" for n, millivolts in enumerate(volts)]
        command = [str(program), "atmega328p", "16000000", str(elf), "300000", *levels]
        text = subprocess.run(command, capture_output=True, check=True).stdout.decode()
        lines = re.findall(r"[^\n]*\n", text)
        assert fields_of(lines[0]) == ["columns", *"abcde", "i", "k"]
        rows = [row_of(line, 5) for line in lines[1:]]
        assert [row.number for row in rows] == list(range(len(rows)))
        assert 26 <= len(rows) <= 31
        for row, after in pairwise(rows):
            assert abs(after.clock - row.clock - 10_000) < 500
        for row in rows:
            assert row.closed == closed
            assert all(abs(code - 1024 * mv / 5000) <= 2 for code, mv in zip(row.readings, volts, strict=True))


PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "wire-a-board.md"
EXAMPLES = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("text", EXAMPLES, ids=range(len(EXAMPLES)))
def test_every_example_of_the_page_is_a_board_whose_sketch_compiles(
    text: str, named: Named, compiled: Callable[..., Path]
) -> None:
    harness = parse_harness(text, "glove.toml")
    (stream,) = harness.streams
    files = rows_files("hand", named(stream.switches, list(stream.joints), list(stream.taxels)), harness)
    assert re.findall(r'^ +",(\w+)"$', files["hand/hand.ino"], re.MULTILINE) == [*stream.used]
    assert compiled(files).is_file()


def test_the_lines_that_the_documentation_shows_are_sound() -> None:
    devices = (PAGE.parents[1] / "reference" / "devices.md").read_text(encoding="utf-8")
    columns, row = re.findall(r"^    (\$(?:columns|row),\S+)$", devices, re.MULTILINE)
    assert fields_of(f"{columns}\r\n")[1:] == ["thumb_tip", "index_tip", "index_mcp"]
    assert row_of(f"{row}\r\n", 2) == Row(17, 3_400_112, {0, 1}, [512])

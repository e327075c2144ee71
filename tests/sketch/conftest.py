"""Sketches for Arduino's cores as programs of this machine, and a network that loses, doubles and delays datagrams."""

import select
import socket
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import count
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from time import monotonic
from types import TracebackType
from typing import Any, Self

import numpy as np
import pytest

from thenar.compiler.firmware.board import parse_board
from thenar.compiler.firmware.generate import Firmware
from thenar.compiler.firmware.targets.base import Mode
from thenar.runtime.build import Build
from thenar.runtime.manifest import SCHEMA, Calibration, Manifest, Options, Origin, Proof, Switch
from thenar.runtime.tables import IntegerTables

SHIM = Path(__file__).with_name("arduino")
CHIPS = Path(__file__).parents[1] / "simavr"  # whose models of port expanders need no libsimavr
STRICT_C = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
STRICT_CPP = ("-std=gnu++17", "-Wall", "-Wextra", "-Wconversion", "-Werror")
SANITIZED = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
ANSWER_S = 20.0
SWITCHES = tuple(f"s{number}" for number in range(8))
JOINTS = ("thumb_rotation", "index_pij")


def small_build(switches: Sequence[str] = SWITCHES) -> Build:
    """Return a build of these switches and two joints, in bytes, of three grasp types."""
    random = np.random.default_rng(5)

    def rows(*shape: int) -> np.ndarray:
        return random.integers(-90, 91, shape).astype(np.int16)

    tables = IntegerTables(
        bias=rows(3),
        switch_rows=rows(len(switches), 3),
        thresholds=tuple(np.array([60, 140], np.uint16) for _ in JOINTS),
        joint_rows=tuple(rows(3, 3) for _ in JOINTS),
        switch_means=rows(len(switches), 3),
        joint_means=rows(2, 3),
        scale=100.0,
    )
    manifest = Manifest(
        schema=SCHEMA,
        checksum="",
        thenar="0.1.0",
        tables_sha256="0" * 64,
        ensemble_sha256="0" * 64,
        source=Origin("1" * 64, 60, "own", 160, joints=22),
        options=Options(13, 100, "both", 1.0, 4, 1),
        grasps=("power grip", "tip pinch", "lateral pinch"),
        switches=tuple(Switch(number, name, 0.5) for number, name in enumerate(switches)),
        joints=tuple(Calibration(n, name, "raw", 1, 1.0, 255, 255.0) for n, name in enumerate(JOINTS)),
        proof=Proof(16, tables.scale, tables.bound, 4.5, 9.0, 60, 0),
        rates=(),
    )
    return Build(manifest, tables)


_NUMBERS = count()


class SketchBoard:
    """A sketch that runs; in the words of bench.cpp."""

    def __init__(self, program: Path) -> None:
        self._errors = program.with_name(f"{next(_NUMBERS)}.stderr")
        with self._errors.open("wb") as errors:
            self._process = subprocess.Popen(
                [str(program)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True
            )
        self._lines: Queue[str] = Queue()
        self._reader = Thread(target=self._read, name="reader of the board")
        self._reader.start()
        self.ports: dict[str, str] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
        assert "runtime error" not in (said := self._errors.read_text()), said

    def port(self, name: str) -> str:
        """Return the port of that name, once the sketch has opened it: "udp", "serial", "serial1"."""
        while name not in self.ports:
            opened, _, path = self._line().partition(" ")
            self.ports[opened] = path
        return self.ports[name]

    def do(self, *commands: str) -> None:
        """Tell the board to do these things; return when the last one is done."""
        assert self._process.stdin is not None
        for command in commands:
            self._process.stdin.write(f"{command}\n")
            self._process.stdin.flush()
            while (line := self._line()) != "ok":
                opened, _, path = line.partition(" ")
                self.ports[opened] = path

    def close(self) -> None:
        """End it. Does no harm twice."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(ANSWER_S)
        self._reader.join()
        self._process.stdout.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line.strip())
        self._lines.put("")

    def _line(self) -> str:
        try:
            line = self._lines.get(timeout=ANSWER_S)
        except Empty:
            line = ""
        if not line:
            raise AssertionError(f"the board does not answer: {self._errors.read_text()}")
        return line


@dataclass
class Weather:
    """What becomes of datagrams: shares that are dropped, doubled, and held for up to `late_s`."""

    dropped: float = 0.0
    doubled: float = 0.0
    held: float = 0.0
    late_s: float = 0.05


@dataclass
class Network:
    """A way between a host and the board at `board`, both on this machine; the host finds it at `url`.

    weather may be changed at any time; forged datagrams are put in as if they came from the board.
    """

    board: int
    seed: int
    weather: Weather = field(default_factory=Weather)
    passed: int = 0
    lost: int = 0
    doubles: int = 0
    last: bytes = b""

    def __enter__(self) -> Self:
        self._random = np.random.default_rng(self.seed)
        self._to_host, self._to_board, self._wake, self._end = (
            *(socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)),
            *socket.socketpair(),
        )
        for each in (self._to_host, self._to_board):
            each.bind(("127.0.0.1", 0))
            each.setblocking(False)
        self._host: Any = None
        self._due: list[tuple[float, int, bool, bytes]] = []
        self._number = 0
        self._thread = Thread(target=self._run, name="network")
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._wake.close()
        self._thread.join()
        for each in (self._to_host, self._to_board, self._end):
            each.close()

    @property
    def url(self) -> str:
        """Where the host finds the board."""
        return f"udp://127.0.0.1:{self._to_host.getsockname()[1]}"

    def forge(self, datagram: bytes) -> None:
        """Send the host a datagram that is not the board's, from its address."""
        self._to_host.sendto(datagram, self._host)

    def _run(self) -> None:
        while True:
            wait = max(0.0, self._due[0][0] - monotonic()) if self._due else None
            ready, _, _ = select.select([self._to_host, self._to_board, self._end], [], [], wait)
            if self._end in ready:
                return
            for each in ready:
                self._take(each)
            while self._due and self._due[0][0] <= monotonic():
                _, _, to_board, datagram = heappop(self._due)
                self._deliver(to_board, datagram)

    def _take(self, at: socket.socket) -> None:
        try:
            datagram, sender = at.recvfrom(4096)
        except (BlockingIOError, ConnectionRefusedError):
            return
        to_board = at is self._to_host
        if to_board:
            self._host = sender
        else:
            self.last = datagram
        weather, draws = self.weather, self._random.random(4)
        if draws[0] < weather.dropped:
            self.lost += 1
            return
        times = 2 if draws[1] < weather.doubled else 1
        self.doubles += times - 1
        for time in range(times):
            late_s = weather.late_s * draws[3] if draws[2] < weather.held or time else 0.0
            self._number += 1
            heappush(self._due, (monotonic() + late_s, self._number, to_board, datagram))

    def _deliver(self, to_board: bool, datagram: bytes) -> None:
        self.passed += 1
        try:
            if to_board:
                self._to_board.sendto(datagram, ("127.0.0.1", self.board))
            elif self._host is not None:
                self._to_host.sendto(datagram, self._host)
        except ConnectionRefusedError:
            pass


def write(folder: Path, text: str, mode: Mode = "scan", build: Build | None = None) -> Path:
    """Write the firmware of such a board.toml to `folder`, and return the folder of its sketch."""
    board, used = parse_board(text), small_build() if build is None else build
    files = Firmware(used.tables, used.manifest, board.part, mode, board=board).files()
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(content)
    (sketch,) = (path.parent for path in folder.glob("*/*.ino"))
    if (sketch / "secrets.example.h").exists():
        (sketch / "secrets.h").write_text((sketch / "secrets.example.h").read_text())
    return sketch


def compiled(sketch: Path, tool: Callable[[str], str], bench: Sequence[Path]) -> Path:
    """Return the program of the sketch in that folder, compiled strictly, with sanitizers, for this bench."""
    objects = list(map(str, bench))
    for source in sorted(sketch.iterdir()):
        commands = {
            ".c": [tool("gcc"), *STRICT_C, *SANITIZED, "-c", str(source)],
            ".cpp": [tool("g++"), *STRICT_CPP, *SANITIZED, f"-I{SHIM}", "-c", str(source)],
            ".ino": [tool("g++"), *STRICT_CPP, f"-I{SHIM}", "-include", "Arduino.h", "-x", "c++", "-c", str(source)],
        }
        if source.suffix in commands:
            objects.append(str(sketch / f"{source.name}.o"))
            done = subprocess.run(
                [*commands[source.suffix], "-o", objects[-1]], capture_output=True, text=True, check=False
            )
            assert (done.returncode, done.stderr) == (0, ""), source.name
    linked = [tool("g++"), *SANITIZED, *objects, "-o", str(sketch / "program")]
    subprocess.run(linked, check=True, timeout=300)
    return sketch / "program"


@pytest.fixture(scope="session")
def bench(tool: Callable[[str], str], tmp_path_factory: pytest.TempPathFactory) -> Sequence[Path]:
    """Return the compiled shim and models of chips, the same for all sketches."""
    folder = tmp_path_factory.mktemp("bench")
    chips = [tool("gcc"), *SANITIZED, "-c", str(CHIPS / "board_chips.c")]
    shim = [tool("g++"), *STRICT_CPP, *SANITIZED, f"-I{SHIM}", f"-I{CHIPS}", "-c", str(SHIM / "bench.cpp")]
    made = folder / "chips.o", folder / "bench.o"
    for command, to in zip((chips, shim), made, strict=True):
        subprocess.run([*command, "-o", str(to)], check=True, timeout=300)
    return made


@pytest.fixture(scope="session")
def program(
    tool: Callable[[str], str], tmp_path_factory: pytest.TempPathFactory, bench: Sequence[Path]
) -> Callable[..., Path]:
    """Return what compiles the firmware of a board.toml, once."""
    made: dict[tuple[str, Mode], Path] = {}

    def program(text: str, mode: Mode = "scan") -> Path:
        if (text, mode) not in made:
            made[text, mode] = compiled(write(tmp_path_factory.mktemp("sketch"), text, mode), tool, bench)
        return made[text, mode]

    return program


@pytest.fixture
def written() -> Callable[..., Path]:
    """Return what writes the firmware of a board.toml to a folder, and gives that of its sketch."""
    return write


@pytest.fixture
def shim() -> Path:
    """Return the folder of the headers that stand for Arduino's core."""
    return SHIM


@pytest.fixture(scope="session")
def build() -> Build:
    """Return the build that all boards carry."""
    return small_build()


@pytest.fixture
def of_switches() -> Callable[[Sequence[str]], Build]:
    """Return what makes a build of other switches."""
    return small_build


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture
def start(program: Callable[..., Path], stack: ExitStack) -> Callable[..., SketchBoard]:
    """Return what starts a board of such a board.toml."""
    return lambda *of: stack.enter_context(SketchBoard(program(*of)))


@pytest.fixture
def connect(stack: ExitStack) -> Callable[..., Network]:
    """Return what puts a network before a board."""

    def connect(board: SketchBoard, seed: int = 1, **weather: float) -> Network:
        return stack.enter_context(Network(int(board.port("udp")), seed, Weather(**weather)))

    return connect

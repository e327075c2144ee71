"""Firmware on a microcontroller in simavr, switches on its pins, and `thenar run` at the other end of its line."""

import importlib.util
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from threading import Thread
from time import monotonic
from typing import Any, Literal

import msgspec
import pytest

from thenar.compiler.firmware import generate
from thenar.compiler.firmware.board import Board, glove_toml, parse_board
from thenar.compiler.firmware.simavr import harness, missing
from thenar.runtime.build import Build
from thenar.runtime.sinks.jsonl import Line

ENDING_S = 20.0
# By so much a frame may be younger than its age says.
TRIP_US = 25_000
# Of the wires of a matrix; the firmware waits 20 us for them.
RISE_US = 16
_HARNESS = Path(__file__).parents[2] / "simavr" / "simulated.py"


def wiring_of(board: Board, switches: Sequence[str], port: Path) -> list[str]:
    """Return the lines by which simavr_board is wired like `board`; key k is switches[k]."""
    numbers = {name: number for number, name in enumerate(switches)}
    lines = [f"part {board.part} {board.clock_hz}", f"uart 0 {board.baud} {port}", f"rise {RISE_US}"]
    lines += [f"pin {numbers[name]} {pin} GND" for name, pin in board.pins.items()]
    if board.matrix is not None:
        word = "diode" if board.matrix.diodes else "pin"
        for row, names in zip(board.matrix.rows, board.matrix.switches, strict=True):
            keys = zip(board.matrix.columns, names, strict=True)
            lines += [f"{word} {numbers[name]} {column} {row}" for column, name in keys if name]
    for chip in board.chips:
        lines.append(f"chip {chip.kind} {chip.address}")
        keyed = chip.numbered_pins.items()
        lines += [f"key {numbers[name]} {chip.address} {pin} {chip.closed}" for pin, name in keyed]
    return lines


class Client:
    """One `thenar run`, whose lines go into the scene's grasps."""

    def __init__(self, arguments: Sequence[str], folder: Path, scene: Any) -> None:
        self._scene, self._errors = scene, folder / "stderr"
        with self._errors.open("wb") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "thenar.cli", "run", *arguments], stdout=subprocess.PIPE, stderr=errors
            )
        self._reader = Thread(target=self._read, name="reader of the run")
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for text in self.process.stdout:
            if text.endswith(b"\n"):
                self._scene.grasps.add(msgspec.json.decode(text, type=Line))

    def close(self) -> None:
        self.process.terminate()
        code = self.process.wait(ENDING_S)
        self._reader.join()
        assert self.process.stdout is not None
        self.process.stdout.close()
        assert code == 0, self._errors.read_text()


class Firmware:
    """A board that runs the firmware of a build, and the scene that it looks at."""

    def __init__(self, board: Any, scene: Any) -> None:
        self.board, self.scene = board, scene
        self._done: Any = None
        self._show = scene.show
        scene._show = self._set
        scene.show = self.show

    def _set(self, closed: Sequence[bool], _sensors: bytes) -> None:
        self._done = self.board.set_keys(closed)

    def show(self, row: int) -> None:
        """Put a row on the switches. What the board tells of them has its own time, which may be behind.

        The row before stays until the board's own time is later than whatever was published of it can be: each row that
        was waited for counts, however busy the computer is.
        """
        grasps = self.scene.grasps.since(0)
        last_us = max((grasp.time_us - (grasp.switch_age_us or 0) for grasp in grasps), default=0)
        end = monotonic() + ENDING_S
        while self.board.do("now").board_us <= last_us + TRIP_US:
            assert monotonic() < end, "the board's time stands still"
        self._show(row)
        shown = self.scene.shown[-1]
        self.scene.shown[-1] = replace(shown, begun_us=min(shown.begun_us, self._done.board_us))


@pytest.fixture(scope="session")
def simulated(tool: Callable[[str], str]) -> Any:
    """Return the module by which boards are simulated."""
    for name in ("avr-gcc", "make"):
        tool(name)
    if (gone := missing()) is not None:
        assert "libsimavr" in gone, gone
        tool("libsimavr-dev")
    spec = importlib.util.spec_from_file_location("simulated", _HARNESS)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as closing:
        yield closing


@pytest.fixture
def flash(simulated: Any, stack: ExitStack, tmp_path: Path) -> Callable[..., Any]:
    """Return what makes the firmware of a build and starts it on a simulated board.

    The board has its port at tmp_path / "port"; its key k is switches[k]. `wiring` is what hangs on it besides.
    """

    def start(build: Build, board: Board, mode: Literal["scan", "glove"], switches: Sequence[str], *wiring: str) -> Any:
        folder = tmp_path / "firmware"
        folder.mkdir()
        request = generate.Firmware(
            build.tables, build.manifest, "avr328p" if board.part == "atmega328p" else "avr2560", mode, board=board
        )
        for name, content in request.files().items():
            (folder / name).write_text(content)
        subprocess.run(["make", "-s", "-C", str(folder)], check=True, timeout=120)
        lines = [*wiring_of(board, switches, tmp_path / "port"), *wiring]
        elf = next(folder.glob("*.elf"))
        return stack.enter_context(simulated.SimulatedBoard(harness("simavr_board"), lines, elf))

    return start


@pytest.fixture
def firmware(stage: Any, make_scene: Any, flash: Callable[..., Any], tmp_path: Path) -> Callable[[str], Firmware]:
    """Return what starts a board, of such a board.toml, that scans the switches of the build of switches."""

    def start(text: str) -> Firmware:
        truth, board = stage.truth("switches"), parse_board(text)
        running = flash(truth.build, board, "scan", truth.performance.switch_names)
        glove = glove_toml("bench", board, truth.build.manifest, str(tmp_path / "port"))
        (tmp_path / "glove.toml").write_text(glove)
        return Firmware(running, make_scene(truth, None))

    return start


@pytest.fixture
def run(stage: Any, stack: ExitStack, tmp_path: Path) -> Callable[[Firmware], Client]:
    """Return what starts `thenar run` on such firmware."""

    def start(firmware: Firmware) -> Client:
        glove = str(tmp_path / "glove.toml")
        where = [str(stage.builds["switches"]), "--glove", glove, "--sink", "jsonl:-"]
        client = Client([*where, "--lead", "0", "--dwell-ms", "0"], tmp_path, firmware.scene)
        stack.callback(client.close)
        return client

    return start

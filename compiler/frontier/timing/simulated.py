"""Measure classifying and scanning in a simulator: compile a layout and run its slowest frames; on an AVR, run thenar's
scanning firmware on a simulated board that scans without pause.
"""

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thenar.runtime.harness.wiring import BusWiring
from thenar.runtime.scanning.ports import ports_of

from ...firmware import FirmwareError
from ...firmware.board import Board, BoardBus
from ...firmware.choose import Fit
from ...firmware.classifier import LIBRARY_NAME, Library
from ...firmware.generate import Firmware
from ...firmware.measuring import run_counted, slow_frames
from ...firmware.simavr import harness
from ...firmware.targets import TARGETS
from ...firmware.tools import call, workshop
from ...firmware.words import numbered
from .python_times import random_tables
from .scan_times import overhead_of, scan_times
from .wirings import Wiring, names_of

_TRIALS = (
    ("mcp23017", 5, 400_000),
    ("mcp23017", 26, 400_000),
    ("mcp23017", 40, 400_000),
    ("mcp23017", 84, 400_000),
    ("mcp23017", 26, 100_000),
    ("pca9555", 16, 400_000),
    ("pca9555", 40, 400_000),
    ("pca9555", 40, 100_000),
    ("tca6424a", 16, 400_000),
    ("tca6424a", 33, 400_000),
)
# Cycles of a simulation: some tens of scans.
_WATCHED = 1_600_000
# A START, and a repeated one before reading: chips with registers, the only ones that an AVR's firmware reads.
_STARTS = 2


@dataclass(frozen=True, slots=True)
class Outcome:
    """Predicted and counted cycles, or instructions, of the slowest frame; microseconds on host."""

    predicted: float
    counted: float

    @property
    def error(self) -> float:
        """The relative error of the prediction."""
        return abs(self.predicted - self.counted) / self.counted


def run_layout(fit: Fit) -> Outcome:
    """Compile a classifier for its part, and run slow frames. Raises FirmwareError."""
    assert fit.cost is not None
    library = Library(LIBRARY_NAME, numbered(fit.layout.tables), fit.layout, fit.target.avr)
    return Outcome(fit.cost.cycles, float(run_counted(library, fit.target, slow_frames(library)).most))


@dataclass(frozen=True, slots=True)
class ScanTrial:
    """A number of switches on chips of one kind, read by an AVR, `target` ("avr328p"), at a clock of the bus."""

    target: str
    kind: str
    switches: int
    clock_hz: int

    @property
    def wiring(self) -> Wiring:
        """Their wiring."""
        return Wiring(self.kind, self.clock_hz, muxes=False)


def scan_trials(target: str) -> tuple[ScanTrial, ...]:
    """Return trials of an AVR: few and many switches, on every kind of chip that it reads, at both clocks."""
    return tuple(ScanTrial(target, *trial) for trial in _TRIALS)


def run_scan(trial: ScanTrial) -> Outcome:
    """Return the predicted and the simulated time of a whole scan, in microseconds. Raises FirmwareError."""
    nothing = np.zeros((1, trial.switches), bool), np.zeros((1, 0), np.uint16)
    tables = random_tables(trial.switches, 0, 2)
    times = scan_times(names_of(trial.switches), tables, trial.wiring, *nothing, overhead_of(trial.target))
    return Outcome(times.full_us, simulated_scan_us(trial))


def simulated_scan_us(trial: ScanTrial) -> float:
    """Return the microseconds from scan to scan while no switch changes. Raises FirmwareError."""
    glove = trial.wiring.harness_of(names_of(trial.switches))
    (bus,) = glove.buses
    numbers = {name: number for number, name in enumerate(glove.switches)}
    tables = random_tables(trial.switches, 0, 2)
    board = _board(trial, bus)
    firmware = Firmware(tables, numbered(tables), trial.target, "scan", board=board)
    slowed, always = f"THENAR_SCAN_US UINT32_C({board.scan_us})", "THENAR_SCAN_US UINT32_C(1)"
    files = {name: text.replace(slowed, always) for name, text in firmware.files().items()}
    with workshop(files) as folder:
        call(["make", "-s"], folder)
        cycles, starts = _watched(folder, board)
    return cycles * 1e6 * _STARTS * len(ports_of(glove, numbers)) / (starts * board.clock_hz)


def _board(trial: ScanTrial, bus: BusWiring) -> Board:
    return Board(part=TARGETS[trial.target].part, scan_us=50_000, bus=BoardBus(clock_hz=bus.clock_hz), chips=bus.chips)


def _watched(folder: Path, board: Board) -> tuple[int, int]:
    """Return cycles of the simulated part, and the number of START conditions in that time."""
    lines = [f"part {board.part} {board.clock_hz}", f"uart 0 {board.baud} {folder / 'port'}"]
    lines += [f"chip {chip.kind} {chip.address}" for chip in board.chips]
    (folder / "wiring").write_text("\n".join(lines) + "\n")
    elf = next(folder.glob("*.elf"))
    command = [str(harness("simavr_board")), str(folder / "wiring"), str(elf)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as running:
        try:
            return _counted(running)
        finally:
            running.terminate()


def _counted(board: "subprocess.Popen[bytes]") -> tuple[int, int]:
    assert board.stdout is not None
    board.stdout.readline()  # the names of its ports
    # By then it has booted and set its chips up.
    first = then = _now(board)
    while then[0] < _WATCHED // 4:
        first = then = _now(board)
    while then[0] - first[0] < _WATCHED:
        then = _now(board)
    if then[1] == first[1]:
        raise FirmwareError("the firmware of a simulated board does not scan")
    return then[0] - first[0], then[1] - first[1]


def _now(board: "subprocess.Popen[bytes]") -> tuple[int, int]:
    """Return the board's cycles and START conditions so far."""
    assert board.stdin is not None
    assert board.stdout is not None
    board.stdin.write(b"now\n")
    board.stdin.flush()
    reply = board.stdout.readline()
    if not reply:
        raise FirmwareError("the simulated board ended by itself")
    reported = json.loads(reply)
    return int(reported["cycle"]), int(reported["starts"])

"""Scan times of an AVR: thenar's scanning firmware on a simulated board that scans without pause."""

import json
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.board import Board, BoardBus
from thenar.compiler.firmware.generate import Firmware
from thenar.compiler.firmware.simavr import harness, missing
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.tools import call, workshop
from thenar.compiler.firmware.words import numbered
from thenar.compiler.frontier.timing.python_times import random_tables
from thenar.compiler.frontier.timing.scan_times import overhead_of, scan_times
from thenar.compiler.frontier.timing.wirings import Wiring, names_of
from thenar.runtime.harness.wiring import BusWiring
from thenar.runtime.scanning.ports import ports_of

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


def predicted_scan_us(trial: ScanTrial) -> float:
    """Return the time of a whole scan by the model."""
    nothing = np.zeros((1, trial.switches), bool), np.zeros((1, 0), np.uint16)
    tables = random_tables(trial.switches, 0, 2)
    return scan_times(names_of(trial.switches), tables, trial.wiring, *nothing, overhead_of(trial.target)).full_us


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


@pytest.fixture(autouse=True)
def simavr(tool: Callable[[str], str]) -> None:
    for name in ("avr-gcc", "make"):
        tool(name)
    if missing() is not None:
        tool("libsimavr-dev")


def test_a_scan_by_the_firmware_of_a_simulated_board_takes_what_is_predicted() -> None:
    trial = ScanTrial("avr328p", "mcp23017", 33, 400_000)
    counted = simulated_scan_us(trial)
    assert predicted_scan_us(trial) == pytest.approx(counted, rel=0.05)
    # More than the wire alone, by far: three chips at 400 kHz.
    assert counted > 2 * 341.4


@pytest.mark.slow
@pytest.mark.parametrize("platform", ["avr328p", "avr2560"])
def test_scans_of_all_sizes_take_what_is_predicted(platform: str) -> None:
    trials = scan_trials(platform)
    errors = {trial: abs(predicted_scan_us(trial) / simulated_scan_us(trial) - 1) for trial in trials}
    print(errors)
    assert {trial.clock_hz for trial in trials} == {100_000, 400_000}
    assert max(errors.values()) < 0.08
    assert sum(errors.values()) / len(errors) < 0.03

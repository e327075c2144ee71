"""Frames per second on emulated wires: the devices run here, the live loop in a separate process (livewire.py)."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Literal

import msgspec
from liveplay import Played, board, glove, performed, repeated, with_glove
from livewire import Rate

from thenar.drivers.lines import checked, switches_field
from thenar.drivers.serial_line import BITS_A_BYTE
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.scanning.timing import free_us, glove_us
from thenar.simulator.playing.bench import Bench

LIVEWIRE = Path(__file__).with_name("livewire.py")
_SAMPLE_S = 0.1


@dataclass(frozen=True, slots=True)
class Found:
    """Frames per second: the limit of the wire, the output of the emulated device, and the rate of a run."""

    what: str
    allowed_hz: float
    sent_hz: float
    arrived_hz: float
    run: Rate

    @property
    def share(self) -> float:
        """Frames that led to a grasp, as a share of the wire's limit."""
        return self.run.recognised_hz / self.allowed_hz

    @property
    def own_share(self) -> float:
        """That share of a bus if system calls took the wire's time, with the measured time between them."""
        wire_us = 1e6 / self.allowed_hz
        return wire_us / (wire_us + self.run.between_us)


def of_glove(scene: Played, folder: Path, seconds: float, joints: Path, sensors: Literal[18, 22]) -> Found:
    """Measure a CyberGlove that streams at its maximum rate; `joints` is a build that uses no switches."""
    wiring = msgspec.structs.replace(glove(scene, sensors), mask=False)
    with performed(scene, Harness(name="glove", cyberglove=wiring), folder) as bench:
        device = bench.glove
        assert device is not None
        with _metered(lambda: device.records) as sent_hz:
            run = _ran(joints, bench, folder, seconds)
    what = f"CyberGlove, {sensors} sensors, {wiring.baud} baud"
    return Found(what, 1e6 / glove_us(wiring, sensors), sent_hz(), run.glove_hz, run)


def of_board(scene: Played, folder: Path, seconds: float, keys: int, baud: int, hz: int) -> Found:
    """Measure a board that prints rows at `hz`, 0: as often as its line permits; together with a CyberGlove."""
    row = len(checked(("row", "65535", "4294967295", switches_field(0, keys))))
    harness = with_glove(board(scene, keys, baud), glove(scene))
    stream = harness.streams[0]
    names = len(checked(("columns", *stream.switches)))
    stream = msgspec.structs.replace(stream, rate_hz=hz or (baud / BITS_A_BYTE - names) / row)
    harness = msgspec.structs.replace(harness, streams=(stream,))
    with performed(scene, harness, folder) as bench:
        line = bench.lines[-1]
        with _metered(lambda: line.sent_bytes / row) as sent_hz:
            run = _ran(scene.folder, bench, folder, seconds)
    what = f"board of {keys} switches, {baud} baud" + (f", {hz} rows a second" if hz else "")
    return Found(what, stream.rate_hz, sent_hz(), run.switches_hz, run)


def of_bus(scene: Played, folder: Path, seconds: float, what: str, harness: Harness) -> Found:
    """Measure a bus that is scanned without a pause, together with a CyberGlove.

    The wire would allow more scans in the time in which SCL neither ran nor had to rest.
    """
    with performed(scene, harness, folder) as bench:
        i2c, clock_hz = bench.i2c, harness.buses[0].clock_hz
        assert i2c is not None

        def busy_s() -> float:
            seen = i2c.counters(0)
            return seen.scl_periods / clock_hz + seen.transfers * free_us(clock_hz) / 1e6

        with _metered(busy_s) as share:
            run = _ran(scene.folder, bench, folder, seconds)
    return Found(what, run.switches_hz / share(), run.switches_hz, run.switches_hz, run)


def _ran(build: Path, bench: Bench, folder: Path, seconds: float) -> Rate:
    """Run livewire.py on the emulated devices."""
    path = folder / "glove.toml"
    path.write_text(harness_to_toml(bench.harness))
    command = [sys.executable, str(LIVEWIRE), str(build), str(path), str(seconds)]
    done = subprocess.run(command, env=os.environ | bench.environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr)
    return msgspec.json.decode(done.stdout, type=Rate)


@contextmanager
def _metered(counted: Callable[[], float]) -> Iterator[Callable[[], float]]:
    """Yield a function that returns the growth of a count per second, the median of those tenths in which it grew."""
    seen: list[tuple[float, float]] = []
    with repeated(_SAMPLE_S, lambda: seen.append((time.perf_counter(), counted()))):
        yield lambda: median(
            (after[1] - before[1]) / (after[0] - before[0]) for before, after in pairwise(seen) if after[1] > before[1]
        )

"""Frames per second on emulated wires: the devices run here, the live loop in a separate process (livewire.py)."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from itertools import count, pairwise
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from threading import Event, Thread
from typing import Literal

import msgspec
from liveplay import Played, board, glove, with_glove
from livewire import Rate

from thenar.drivers.emulated.cyberglove import EmulatedCyberGlove
from thenar.drivers.emulated.lines import BoardSender
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.drivers.lines import checked, switches_field
from thenar.drivers.serial_line import BITS_A_BYTE
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.scanning.timing import free_us, glove_us
from thenar.simulator.playing.bench import Bench

LIVEWIRE = Path(__file__).with_name("livewire.py")
_CHANGE_S = 0.01
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


def of_glove(scene: Played, joints: Path, sensors: Literal[18, 22], seconds: float) -> Found:
    """Measure a CyberGlove that streams at its maximum rate; `joints` is a build that uses no switches."""
    with (
        TemporaryDirectory() as folder,
        PtyLine(Path(folder, "glove")) as line,
        EmulatedCyberGlove(line, sensors=sensors) as device,
        changing(scene, lambda _, raw: device.set((raw + raw)[:sensors])),
    ):
        wiring = msgspec.structs.replace(glove(scene, str(line.link), sensors), mask=False)
        with _metered(lambda: device.records) as sent_hz:
            run = _ran(joints, Harness(name="glove", cyberglove=wiring), seconds, folder)
    what = f"CyberGlove, {sensors} sensors, {line.baud} baud"
    return Found(what, 1e6 / glove_us(wiring, sensors), sent_hz(), run.glove_hz, run)


def of_board(scene: Played, keys: int, baud: int, hz: int, seconds: float) -> Found:
    """Measure a board that prints rows at `hz`, 0: as often as its line permits; together with a CyberGlove."""
    row = len(checked(("row", "65535", "4294967295", switches_field(0, keys))))
    with TemporaryDirectory() as folder:
        harness = with_glove(board(scene, f"{folder}/board", keys, baud), glove(scene, f"{folder}/glove"))
        stream = harness.streams[0]
        names = len(checked(("columns", *stream.switches)))
        stream = msgspec.structs.replace(stream, rate_hz=hz or (baud / BITS_A_BYTE - names) / row)
        harness = msgspec.structs.replace(harness, streams=(stream,))
        with (
            PtyLine(Path(folder, "board"), baud) as line,
            PtyLine(Path(folder, "glove")) as other,
            BoardSender(line.send, stream.switches, (), stream.rate_hz) as device,
            EmulatedCyberGlove(other) as hand,
            changing(scene, lambda closed, _: device.show(closed)),
            changing(scene, lambda _, raw: hand.set(raw)),
            _metered(lambda: line.sent_bytes / row) as sent_hz,
        ):
            run = _ran(scene.folder, harness, seconds, folder)
    what = f"board of {keys} switches, {baud} baud" + (f", {hz} rows a second" if hz else "")
    return Found(what, stream.rate_hz, sent_hz(), run.switches_hz, run)


def of_bus(scene: Played, what: str, harness: Harness, seconds: float) -> Found:
    """Measure a bus that is scanned without a pause, together with a CyberGlove.

    The wire would allow more scans in the time in which SCL neither ran nor had to rest.
    """
    with TemporaryDirectory() as folder:
        both = with_glove(harness, glove(scene))
        with Bench(both, scene.performance.switch_names, Path(folder)) as bench:
            i2c, clock_hz = bench.i2c, harness.buses[0].clock_hz
            assert i2c is not None

            def busy_s() -> float:
                seen = i2c.counters(0)
                return seen.scl_periods / clock_hz + seen.transfers * free_us(clock_hz) / 1e6

            wired = with_glove(bench.harness, glove(scene, f"{folder}/cyberglove"))
            with _metered(busy_s) as share, shown(scene, bench):
                run = _ran(scene.folder, wired, seconds, folder, bench.environment)
    return Found(what, run.switches_hz / share(), run.switches_hz, run.switches_hz, run)


def _ran(
    build: Path, harness: Harness, seconds: float, folder: str, environment: Mapping[str, str] | None = None
) -> Rate:
    """Run livewire.py on the emulated devices."""
    path = Path(folder, "glove.toml")
    path.write_text(harness_to_toml(harness))
    command = [sys.executable, str(LIVEWIRE), str(build), str(path), str(seconds)]
    done = subprocess.run(
        command, env=os.environ | dict(environment or {}), capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(done.stderr)
    return msgspec.json.decode(done.stdout, type=Rate)


@contextmanager
def _every(seconds: float, do: Callable[[], object]) -> Iterator[None]:
    """Repeat an action in a thread."""
    stop = Event()

    def run() -> None:
        while not stop.wait(seconds):
            do()

    thread = Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


@contextmanager
def _metered(counted: Callable[[], float]) -> Iterator[Callable[[], float]]:
    """Yield a function that returns the growth of a count per second, the median of those tenths in which it grew."""
    seen: list[tuple[float, float]] = []
    with _every(_SAMPLE_S, lambda: seen.append((time.perf_counter(), counted()))):
        yield lambda: median(
            (after[1] - before[1]) / (after[0] - before[0]) for before, after in pairwise(seen) if after[1] > before[1]
        )


def changing(scene: Played, show: Callable[[dict[str, float], bytes], None]) -> AbstractContextManager[None]:
    """Show row after row of the performance: the values of the kept switches, and the glove's bytes."""
    rows = count()

    def step() -> None:
        row = next(rows) % len(scene.performance)
        closed = {name: float(scene.keys[row] >> bit & 1) for bit, name in enumerate(scene.kept)}
        show(closed, scene.performance.sensors[row].tobytes())

    return _every(_CHANGE_S, step)


def shown(scene: Played, bench: Bench) -> AbstractContextManager[None]:
    """Show row after row on all devices of a bench."""
    rows = count()

    def step() -> None:
        row = next(rows) % len(scene.performance)
        bench.show(scene.performance.switches[row].tolist(), scene.performance.sensors[row].tobytes())

    return _every(_CHANGE_S, step)

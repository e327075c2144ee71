"""Inputs for the benchmarks of the live loop: scenes, their builds, gloves wired for them, emulated devices that show
a performance, and frames in memory.
"""

import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from threading import Event, Thread
from typing import Literal

import msgspec
import numpy as np

from thenar.compiler import compile_build
from thenar.compiler.glove.propose import propose_harness
from thenar.drivers.cyberglove_protocol import ALWAYS, PLUGGED
from thenar.runtime import Build
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.harness.wiring import GloveWiring, Harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.live.sources import FrameBuffer, Snapshot
from thenar.simulator import load_scene, simulate
from thenar.simulator.playing.bench import Bench
from thenar.simulator.playing.performance import Performance, of_scene

# Reads a port as fast as lines come, so that they are sent and not lost.
_READER = "import socket, sys; s = socket.create_connection(('127.0.0.1', sys.argv[1]))\nwhile s.recv(65536): pass"
SENSORS: Literal[18] = 18
STATUS = ALWAYS | PLUGGED
# How long a frame from memory counts as fresh: even a busy computer makes none of them old.
_LONGEST_US = 1_000_000
_CHANGE_S = 0.01


@dataclass(frozen=True, eq=False)
class Played:
    """A performance, the folder of a build of its scene, and the performer's calibration."""

    folder: Path
    build: Build
    performance: Performance
    calibration: Path

    @property
    def kept(self) -> tuple[str, ...]:
        """The names of the kept switches, in the build's order."""
        return tuple(switch.name for switch in self.build.manifest.switches)


def played(name: str, folder: Path, prune: int = 0) -> Played:
    """Simulate and compile a shipped scene; the first subject performs."""
    scene = load_scene(name)
    compiled = compile_build(simulate(scene, 1).grasp_set, folder / name, rounds=100, folds=0, prune=prune).folder
    performance = of_scene(scene, jobs=1)
    calibration = folder / f"{name}.toml"
    calibration.write_text(performance.calibration.to_toml())
    return Played(compiled, Build.load(compiled), performance, calibration)


def joints_alone(name: str, folder: Path) -> Path:
    """Return a build of a shipped scene that uses only the joints."""
    return compile_build(
        simulate(load_scene(name), 1).grasp_set, folder / "joints", rounds=100, folds=0, inputs="joints"
    ).folder


def glove(played: Played, sensors: Literal[18, 22] = SENSORS) -> GloveWiring:
    """Return a CyberGlove that streams as fast as it can."""
    return GloveWiring(port="glove", sensors=sensors, calibration=str(played.calibration))


def board(played: Played, keys: int = 0, baud: int = 115_200) -> Harness:
    """Return a glove whose kept switches are the first of a board that prints at least `keys` of them."""
    names = [*played.kept, *(f"spare_{number}" for number in range(len(played.kept), keys))]
    text = f'name = "board"\n[[stream]]\nport = "board"\nbaud = {baud}\nrate_hz = 100\nswitches = {names!r}\n'
    return parse_harness(text + "[stream.board]\n", "board")


def with_glove(harness: Harness, wiring: GloveWiring) -> Harness:
    """Return `harness` with a CyberGlove added."""
    return msgspec.structs.replace(harness, cyberglove=wiring)


def wired(scene: Played, names: tuple[str, ...], clock_hz: int) -> Harness:
    """Return a glove with these switches on MCP23017, scanned as often as the wire allows, and a CyberGlove."""
    proposed = propose_harness(names, device="/dev/i2c-7")
    bus = msgspec.structs.replace(proposed.buses[0], clock_hz=clock_hz, rate_hz=10_000.0)
    return with_glove(msgspec.structs.replace(proposed, buses=(bus,)), glove(scene))


@contextmanager
def repeated(seconds: float, do: Callable[[], object]) -> Iterator[None]:
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
def performed(scene: Played, harness: Harness, folder: Path) -> Iterator[Bench]:
    """Emulate all devices of a glove, and show row after row of the performance on them."""
    rows = cycle(range(len(scene.performance)))
    sensors = 0 if harness.cyberglove is None else harness.cyberglove.all_sensors

    def step() -> None:
        row = next(rows)
        raw = scene.performance.sensors[row].tobytes()
        bench.show(scene.performance.switches[row].tolist(), (raw + raw)[:sensors])

    with Bench(harness, scene.performance.switch_names, folder) as bench, repeated(_CHANGE_S, step):
        yield bench


def run_arguments(build: Path, harness: Harness, folder: Path, *options: str) -> list[str]:
    """Write the glove's file into `folder`, and return the arguments of a `thenar run` with preshapes."""
    path = folder / "glove.toml"
    path.write_text(harness_to_toml(harness))
    return ["run", str(build), "--glove", str(path), "--preshape", "barrett_bh8", *options]


class Memory:
    """A feed for a glove that returns what was put into it: no device, no thread, no waiting."""

    def __init__(self, switches: int) -> None:
        self._arrivals = FrameBuffer(switches, [(1 << switches) - 1])

    def put(self, time_us: int, closed: int, sensors: bytes | None) -> None:
        """Add a frame of the switches, preceded by one of the glove unless that is None."""
        if sensors is not None:
            self._arrivals.put_glove(GloveFrame(time_us, sensors, STATUS), _LONGEST_US)
        self._arrivals.put_switches(0, SwitchFrame(time_us, closed), _LONGEST_US)

    def take(self) -> Snapshot:
        """Return the frames that were put in."""
        return self._arrivals.take()


def restless(switches: int, frames: int, seed: int) -> list[tuple[int, bytes]]:
    """Return frames that differ as much as chance allows: half of the switches, and all sensors, change."""
    rng = np.random.default_rng(seed)
    bits, sensors = rng.random((frames, switches)) < 0.5, rng.integers(1, 256, (frames, SENSORS), dtype=np.uint8)
    masks = [sum(1 << number for number, shut in enumerate(row) if shut) for row in bits.tolist()]
    return [(closed, raw.tobytes()) for closed, raw in zip(masks, sensors, strict=True)]


def free_port() -> int:
    """Return a port of this machine that nobody serves."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


@contextmanager
def read_along(port: int) -> Iterator[None]:
    """Let a separate process read the lines at a port of this machine."""
    with subprocess.Popen([sys.executable, "-c", _READER, str(port)]) as reader:
        try:
            yield
        finally:
            reader.terminate()

"""The live side of the benchmark's wires, in a separate process like `thenar run`; benchmarks/live.py starts it.

    python benchmarks/livewire.py BUILD GLOVE.toml SECONDS

With all sinks on, it prints frames per second, and their cost, as JSON.
"""

import sys
import time
from dataclasses import dataclass
from fcntl import ioctl
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec
import smbus2.smbus2
from liveplay import free_port, read_along

import thenar.drivers.i2c.node
from thenar.runtime import Glove
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.live.sources import Snapshot, Sources

_START_S = 20.0


class Rate(msgspec.Struct):
    """The rates of a run: frames per second received from each device; frames that led to a grasp, of the switches or,
    without any, of the glove; microseconds of CPU per grasp, of the loop's thread and of the whole process; for a bus,
    microseconds per scan between two system calls.
    """

    switches_hz: float
    glove_hz: float
    recognised_hz: float
    loop_us: float
    process_us: float
    between_us: float


@dataclass(eq=False)
class Counted:
    """Sources that count the frames they deliver."""

    sources: Sources
    switches: int = 0
    gloves: int = 0
    recognised: int = 0

    def take(self) -> Snapshot:
        """Take frames from the sources, and count them."""
        taken = self.sources.take()
        switches = sum(isinstance(frame, SwitchFrame) for frame in taken.arrived)
        gloves = len(taken.arrived) - switches
        self.switches += switches
        self.gloves += gloves
        self.recognised += bool(switches if self.sources.switch_period_us else gloves)
        return taken


def rate(build: str, glove: str, seconds: float) -> Rate:
    """Run with all sinks on for `seconds`, once all devices are ready."""
    with TemporaryDirectory() as name:
        folder, port = Path(name), free_port()
        run = Glove(
            build,
            glove,
            preshapes="barrett_bh8",
            sinks=[f"jsonl:{folder}/lines?every", f"tcp:{port}"],
            record=folder / "run.mcap",
            status=True,
        )
        with run, read_along(port):
            feed = Counted(run.sources)
            run.feed = feed.take
            _run(run, _START_S, until_well=True)
            return _over(run, feed, seconds)


def _over(glove: Glove, feed: Counted, seconds: float) -> Rate:
    ioctls = Ioctls()
    ioctls.stand_in()
    counts, clocks = _counts(glove, feed), _clocks()
    _run(glove, seconds)
    inside_s = ioctls.wall_ns / 1e9
    wall_s, loop_s, process_s = (now - then for now, then in zip(_clocks(), clocks, strict=True))
    switches, gloves, recognised, grasps = (now - then for now, then in zip(_counts(glove, feed), counts, strict=True))
    each, between_us = 1e6 / grasps, 1e6 * (wall_s - inside_s) / switches if ioctls.count else 0.0
    return Rate(switches / wall_s, gloves / wall_s, recognised / wall_s, loop_s * each, process_s * each, between_us)


def _counts(glove: Glove, feed: Counted) -> tuple[int, int, int, int]:
    return feed.switches, feed.gloves, feed.recognised, glove.frames


def _clocks() -> tuple[float, float, float]:
    return time.perf_counter(), time.thread_time(), time.process_time()


def _run(glove: Glove, seconds: float, *, until_well: bool = False) -> None:
    """Run for `seconds`, or until all devices are ready."""
    end = time.monotonic() + seconds
    for moment in glove:
        if until_well and moment.grasp.health == "ok":
            return
        if time.monotonic() > end:
            break
    if until_well:
        raise SystemExit(f"no frames arrived: {glove.sources.devices()}")


@dataclass(eq=False)
class Ioctls:
    """Replaces ioctl in the I2C driver and in smbus2, and measures its time."""

    count: int = 0
    wall_ns: int = 0

    def stand_in(self) -> None:
        """Install the replacement."""
        for module in (smbus2.smbus2, thenar.drivers.i2c.node):
            vars(module)["ioctl"] = self

    def __call__(self, *arguments: Any) -> Any:
        """Call ioctl."""
        start = time.perf_counter_ns()
        try:
            return ioctl(*arguments)
        finally:
            self.count += 1
            self.wall_ns += time.perf_counter_ns() - start


if __name__ == "__main__":
    print(msgspec.json.encode(rate(sys.argv[1], sys.argv[2], float(sys.argv[3]))).decode())

"""The live side of the benchmark's wires, in a separate process like `thenar run`; benchmarks/live.py starts it.

    python benchmarks/livewire.py BUILD GLOVE.toml SECONDS

Prints JSON: frames per second with all sinks on, and their cost.
"""

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
from liveplay import read_along

from thenar.runtime import Glove
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.live.sources import Snapshot, Sources

_START_S = 20.0


class Rate(msgspec.Struct):
    """The rates of a run: frames per second received from each device; frames that led to a grasp, of the switches or,
    without any, of the glove; microseconds of CPU per grasp, of the loop's thread and of the whole process.
    """

    switches_hz: float
    glove_hz: float
    recognised_hz: float
    loop_us: float
    process_us: float


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
        folder = Path(name)
        run = Glove(
            build,
            glove,
            preshapes="barrett_bh8",
            sinks=["jsonl:/dev/null", f"unix:{folder}/socket"],
            record=folder / "run.mcap",
            status=True,
        )
        with run, read_along(folder / "socket"):
            feed = Counted(run.sources)
            run.feed = feed
            _run(run, _START_S, until_well=True)
            before = _state(run, feed)
            _run(run, seconds)
            counted = zip(_state(run, feed), before, strict=True)
            wall_s, loop_s, process_s, switches, gloves, recognised, grasps = (now - then for now, then in counted)
    us = 1e6 / grasps
    return Rate(switches / wall_s, gloves / wall_s, recognised / wall_s, loop_s * us, process_s * us)


def _state(glove: Glove, feed: Counted) -> tuple[float, ...]:
    """Return the clocks of the wall, the loop's thread and the process, and the counts of frames and grasps."""
    clocks = time.perf_counter(), time.thread_time(), time.process_time()
    return *clocks, feed.switches, feed.gloves, feed.recognised, glove.frames


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


if __name__ == "__main__":
    print(msgspec.json.encode(rate(sys.argv[1], sys.argv[2], float(sys.argv[3]))).decode())

"""Runs the live loop through frames from memory, as fast as they go, by a clock that goes a millisecond a frame.

    python soaked.py BUILD GLOVE.toml ROWS.npz FOLDER FRAMES CPU_S MOST_BYTES

Switches come every millisecond, the glove every ten, but for half a second in ten; all sinks are on, one with a reader;
files may have MOST_BYTES at most, so that the recording ends amid the run. After every WINDOW frames a line of JSON.
"""

import os
import resource
import socket
import sys
import threading
import time
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from statistics import quantiles

import msgspec
import numpy as np

import thenar.cli.run_live
import thenar.runtime.live.arrivals
import thenar.runtime.live.loop
from thenar.cli.teller import Teller
from thenar.runtime import Build
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.live.arrivals import Arrivals, Taken
from thenar.runtime.live.frames import GloveFrame, SwitchFrame
from thenar.runtime.live.loop import LiveLoop
from thenar.runtime.live.parts import Part, Parts
from thenar.runtime.live.system import System
from thenar.runtime.preshape.loading import load_preshapes
from thenar.runtime.preshape.selector import PreshapeSelector
from thenar.runtime.recording.session import Session
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.sinks.angles import AngleReader
from thenar.runtime.sinks.fanout import Fanout
from thenar.runtime.sinks.opening import open_sink

WINDOW = 10_000
SWITCH_US, GLOVE_FRAMES, AWAY_FRAMES, HELD_FRAMES = 1000, 10, 500, 400
PLUGGED = 0x81
LONGEST_US = 20_000


class Sample(msgspec.Struct):
    """The state of the process after so many frames; us is the CPU of a frame, the tenth percentile of a window."""

    frames: int
    us: float
    rss_kib: int
    threads: int
    files: int
    recording: bool
    failure: str


class Clock:
    """Microseconds that go by as they are told to."""

    def __init__(self) -> None:
        self.us = 1_000_000

    def __call__(self) -> int:
        return self.us


class Feed:
    """Rows of a performance, with one switch and one sensor that never rest."""

    patience_s = 0.0

    def __init__(self, rows: Path, switches: int, clock: Clock) -> None:
        self._clock = clock
        self._part = Part((1 << switches) - 1)
        self._arrivals = Arrivals(Parts(switches, [self._part]))
        with np.load(rows) as held:
            self._closed = [sum(1 << k for k, shut in enumerate(row) if shut) for row in held["bits"].tolist()]
            self._sensors = [row.tobytes() for row in held["sensors"]]

    def put(self, frame: int) -> None:
        """Let what belongs to this frame come in."""
        now, row = self._clock(), frame // HELD_FRAMES % len(self._closed)
        if frame % GLOVE_FRAMES == 0 and frame % WINDOW >= AWAY_FRAMES:
            sensors = bytearray(self._sensors[row])
            sensors[frame // GLOVE_FRAMES % len(sensors)] ^= 1
            self._arrivals.put_glove(GloveFrame(now, bytes(byte or 1 for byte in sensors), PLUGGED))
        closed = self._closed[row] ^ (1 << frame // 8 % self._part.owned.bit_length())
        self._arrivals.put_switches(self._part, SwitchFrame(now, closed), LONGEST_US)

    def wait(self, timeout_s: float) -> bool:
        """Return whether something came in."""
        return self._arrivals.wait(timeout_s)

    def take(self) -> Taken:
        """Return what came in."""
        return self._arrivals.take()


def soak(system: System, rows: Path, folder: Path, frames: int, cpu_s: float) -> None:
    """Print a sample a window, until there were so many frames or so much CPU was used."""
    clock = Clock()
    for module in (thenar.runtime.live.arrivals, thenar.runtime.live.loop, thenar.cli.run_live):
        module.now_us = clock  # type: ignore[attr-defined]
    with ExitStack() as stack:
        fanout = Fanout([open_sink("jsonl:/dev/null"), open_sink(f"unix:{folder}/socket")])
        stack.callback(fanout.close)
        reader = stack.enter_context(socket.socket(socket.AF_UNIX))
        reader.settimeout(10.0)
        reader.connect(f"{folder}/socket")
        recorder = stack.enter_context(Recorder(folder / "soak.mcap", _session(system)))
        teller = _teller(system, fanout, recorder)
        feed = Feed(rows, len(system.switch_names), clock)
        loop = LiveLoop(feed, system.recognizer(), teller.tell, recorder)
        spent: list[float] = []
        for frame in count():
            if frame % WINDOW == 0 and frame:
                print(msgspec.json.encode(_sample(frame, spent, recorder)).decode(), flush=True)
                spent.clear()
                if frame >= frames or time.process_time() >= cpu_s:
                    break
            clock.us += SWITCH_US
            feed.put(frame)
            start = time.thread_time_ns()
            loop.step()
            spent.append((time.thread_time_ns() - start) / 1e3)
            while len(reader.recv(65536)) == 65536:
                pass


def _teller(system: System, fanout: Fanout, recorder: Recorder) -> Teller:
    assert system.calibration is not None
    selector = PreshapeSelector(load_preshapes("barrett_bh8"))
    angles = AngleReader(system.sensor_names, system.calibration)
    stop = threading.Event()
    return Teller(system, fanout, system.sources(), None, stop, selector, angles, recorder, status=True)


def _sample(frame: int, spent: list[float], recorder: Recorder) -> Sample:
    status = Path("/proc/self/status").read_text().splitlines()
    rss_kib = next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))
    files = len(os.listdir("/proc/self/fd"))  # noqa: PTH208
    failure = recorder.failure or ""
    tenth = quantiles(spent, n=10)[0]
    return Sample(frame, tenth, rss_kib, threading.active_count(), files, not failure, failure)


def _session(system: System) -> Session:
    build = system.build.manifest.checksum
    return Session(thenar="0", switches=system.switch_names, sensors=system.sensor_names, build=build)


def main() -> None:
    build, glove, rows, folder, frames, cpu_s, most = sys.argv[1:]
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(most), int(most)))
    soak(System.of(Build.load(build), load_harness(glove)), Path(rows), Path(folder), int(frames), float(cpu_s))


if __name__ == "__main__":
    main()

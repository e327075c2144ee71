"""Runs the live loop through frames from memory, as fast as they go, by a clock that goes a millisecond a frame.

    python soaked.py BUILD GLOVE.toml ROWS.npz FOLDER FRAMES MOST_BYTES

Switches come every millisecond, the glove every ten, but for half a second in ten; all sinks are on, one with a reader;
files may have MOST_BYTES at most, so that the recording ends amid the run. After every WINDOW frames a line of JSON.
"""

import ctypes
import gc
import os
import resource
import socket
import sys
import threading
import time
from itertools import count
from pathlib import Path
from types import FrameType

import msgspec
import numpy as np

import thenar.runtime.live.sources
from thenar.runtime import Build, Glove
from thenar.runtime.frames import GloveFrame, SwitchFrame, now_us
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.live.sources import FrameBuffer, Snapshot
from thenar.runtime.recording.writer import LiveRecorder
from thenar.runtime.sinks.base import open_sink
from thenar.runtime.sinks.sockets import SocketLines

WINDOW = 10_000
# Calls are counted in the last frames of a window, in which every period of the feed lies at the same place.
COUNTED = 1000
SWITCH_US, GLOVE_FRAMES, AWAY_FRAMES, HELD_FRAMES = 1000, 10, 500, 400
PLUGGED = 0x81
LONGEST_US = 20_000
# The socket is read once in so many frames, far fewer than wait in a sink: a turn of every thread in each frame would
# take twice the time of the frames themselves.
READ_FRAMES = 8


class Sample(msgspec.Struct):
    """The state of the process after so many frames, and the mean number of calls that a counted frame made.

    used_kib  the memory in use, without the gaps between its pieces, which depend on how threads took turns
    """

    frames: int
    calls: float
    rss_kib: int
    used_kib: int
    threads: int
    files: int
    recording: bool
    failure: str


class Mallinfo2(ctypes.Structure):
    """What glibc's malloc says of itself."""

    _names = ("arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost")
    _fields_ = tuple((name, ctypes.c_size_t) for name in _names)


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
        self._switches = switches
        self._arrivals = FrameBuffer(switches, [(1 << switches) - 1])
        with np.load(rows) as held:
            self._closed = [sum(1 << k for k, shut in enumerate(row) if shut) for row in held["bits"].tolist()]
            self._sensors = [row.tobytes() for row in held["sensors"]]

    def put(self, frame: int) -> None:
        """Let what belongs to this frame come in."""
        now, row = self._clock(), frame // HELD_FRAMES % len(self._closed)
        if frame % GLOVE_FRAMES == 0 and frame % WINDOW >= AWAY_FRAMES:
            sensors = bytearray(self._sensors[row])
            sensors[frame // GLOVE_FRAMES % len(sensors)] ^= 1
            self._arrivals.put_glove(GloveFrame(now, bytes(byte or 1 for byte in sensors), PLUGGED), LONGEST_US)
        closed = self._closed[row] ^ (1 << frame // 8 % self._switches)
        self._arrivals.put_switches(0, SwitchFrame(now, closed), LONGEST_US)

    def take(self) -> Snapshot:
        """Return what came in."""
        return self._arrivals.take()


def soak(build: Build, harness: Harness, rows: Path, folder: Path, frames: int) -> None:
    """Print a sample a window, until there were so many frames."""
    clock = Clock()
    vars(thenar.runtime.live.sources)["now_us"] = clock
    feed = Feed(rows, build.tables.n_switches, clock)
    lines = open_sink("tcp:0")
    assert isinstance(lines, SocketLines)
    glove = Glove(
        build,
        harness,
        preshapes="barrett_bh8",
        sinks=("jsonl:/dev/null?every", lines),
        record=folder / "soak.mcap",
        status=True,
        feed=feed.take,
    )
    with glove, socket.create_connection(lines.address, 10.0) as reader:
        assert glove.recorder is not None
        calls = 0

        def count_call(frame: FrameType, event: str, _what: object) -> None:
            nonlocal calls
            # The clock is read once more where a writer is at work, which depends on how threads took turns.
            calls += event in {"call", "c_call"} and frame.f_code is not now_us.__code__

        for frame in count():
            if frame % WINDOW == 0 and frame:
                print(msgspec.json.encode(_sample(frame, calls / COUNTED, glove.recorder)).decode(), flush=True)
                calls = 0
                if frame >= frames:
                    break
            clock.us += SWITCH_US
            feed.put(frame)
            sys.setprofile(count_call if frame % WINDOW >= WINDOW - COUNTED else None)
            next(glove)
            sys.setprofile(None)
            while frame % READ_FRAMES == 0 and len(reader.recv(65536)) == 65536:
                pass


def _rest() -> None:
    """Wait until the threads have written what waits: how much that is depends on how they took turns."""
    worked_s = -1.0
    while time.process_time() - worked_s > 0.001:
        worked_s = time.process_time()
        time.sleep(0.01)


def _sample(frame: int, calls: float, recorder: LiveRecorder) -> Sample:
    _rest()
    # What is free goes back first: how far a queue once grew depends on the load of the machine.
    gc.collect()
    library = ctypes.CDLL(None)
    library.malloc_trim(0)
    library.mallinfo2.restype = Mallinfo2
    info = library.mallinfo2()
    status = Path("/proc/self/status").read_text().splitlines()
    rss_kib = next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))
    files = len(os.listdir("/proc/self/fd"))  # noqa: PTH208
    failure = recorder.failure or ""
    used_kib = (info.uordblks + info.hblkhd) >> 10
    return Sample(frame, calls, rss_kib, used_kib, threading.active_count(), files, not failure, failure)


def main() -> None:
    build, glove, rows, folder, frames, most = sys.argv[1:]
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(most), int(most)))
    soak(Build.load(build), load_harness(glove), Path(rows), Path(folder), int(frames))


if __name__ == "__main__":
    main()

"""An hour of `thenar run` on emulated devices, in real time: nothing may grow.

    python benchmarks/soak.py [--minutes N]

A CyberGlove, a board that prints rows, and expanders on I2C where umockdev is installed; JSON lines, a socket that is
read, health, preshapes, and a recording until its file has 256 MiB. Prints a line per minute (six lines in shorter
runs) and exits with 1 if memory, threads, file descriptors or the CPU per grasp grew, or if the run ended.
"""

import argparse
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from liveplay import Played, board, free_port, glove, performed, played, run_arguments, wired, with_glove
from msgspec.structs import replace
from scipy.stats import theilslopes

from thenar.runtime.harness.wiring import Harness

MINUTE_S = 60.0
MOST_FILE = 256 << 20
# The growth allowed from the first minutes, in which caches fill, to the end.
MOST_KIB, MOST_SHARE = 2048, 0.5
WARM_UP = 2
LEAST_SAMPLES = 3
_TICKS = os.sysconf("SC_CLK_TCK")
# Instead of `ulimit -f`, which counts in blocks whose size depends on the shell.
LIMITED = (
    "import os, resource as r, sys; r.setrlimit(r.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2);"
    " os.execv(sys.argv[2], sys.argv[2:])"
)


@dataclass(frozen=True, slots=True)
class Sample:
    """The state of the run: resident KiB, threads, file descriptors, lines read, microseconds of CPU a line."""

    rss_kib: int
    threads: int
    files: int
    lines: int
    us: float


class Reader:
    """Reads the lines that a run sends to a port of this machine, once it serves it."""

    def __init__(self, port: int) -> None:
        end = time.monotonic() + MINUTE_S
        while True:
            try:
                self._socket = socket.create_connection(("127.0.0.1", port))
                return
            except OSError:
                if time.monotonic() > end:
                    raise
                time.sleep(0.1)

    def lines(self, until: float) -> int:
        """Return the number of lines until a moment of the monotonic clock; fewer if the run ends."""
        lines = 0
        while (left := until - time.monotonic()) > 0:
            self._socket.settimeout(left)
            try:
                data = self._socket.recv(1 << 16)
            except TimeoutError:
                break
            if not data:
                break
            lines += data.count(b"\n")
        return lines


def glove_of_all(scene: Played) -> Harness:
    """Return a glove whose kept switches are half on a board, half on expanders, if these can be emulated."""
    if shutil.which("umockdev-wrapper") is None:
        return with_glove(board(scene), glove(scene))
    half = len(scene.kept) // 2
    stream = replace(board(scene).streams[0], switches=scene.kept[:half])
    return replace(wired(scene, scene.kept[half:], 100_000), name="soak", streams=(stream,))


def sampled(pid: int, reader: Reader, seconds: float) -> Sample:
    """Return the state of the run after `seconds`."""
    before = _cpu_s(pid)
    lines = reader.lines(time.monotonic() + seconds)
    own = Path("/proc", str(pid))
    status = dict(line.split(":", 1) for line in (own / "status").read_text().splitlines())
    us = 1e6 * (_cpu_s(pid) - before) / max(lines, 1)
    files = len(list((own / "fd").iterdir()))
    return Sample(int(status["VmRSS"].split()[0]), int(status["Threads"]), files, lines, us)


def _cpu_s(pid: int) -> float:
    """Return the CPU time of a process: fields 14 and 15 of its stat, counted from 1 (proc(5))."""
    fields = Path("/proc", str(pid), "stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def grown(samples: Sequence[Sample]) -> list[str]:
    """Return the quantities that grew, as sentences."""
    later = samples[min(WARM_UP, len(samples) - LEAST_SAMPLES) :]
    # Over all samples, extrapolated from the median pair of them.
    kib, us = (
        theilslopes([getattr(sample, name) for sample in later]).slope * (len(later) - 1) for name in ("rss_kib", "us")
    )
    found = []
    if kib > MOST_KIB:
        found.append(f"memory by {kib:.0f} KiB (at most {MOST_KIB})")
    if len({(sample.threads, sample.files) for sample in later}) > 1:
        found.append("threads or file descriptors came or went")
    share = us / median(sample.us for sample in later)
    if share > MOST_SHARE:
        found.append(f"the CPU a grasp by {share:.0%} (at most {MOST_SHARE:.0%})")
    if not all(sample.lines for sample in samples):
        found.append("for a while nothing was published")
    return found


def soak(folder: Path, minutes: float) -> list[str]:
    """Run for `minutes`; return the faults."""
    scene = played("quick", folder)
    every_s = min(MINUTE_S, minutes * MINUTE_S / 6)
    with ExitStack() as stack:
        bench = stack.enter_context(performed(scene, glove_of_all(scene), folder))
        port, record = free_port(), str(folder / "soak.mcap")
        sinks = ("--sink", f"tcp:{port}", "--sink", "jsonl:-", "--record", record, "--status")
        arguments = run_arguments(scene.folder, bench.harness, folder, *sinks)
        command = [sys.executable, "-c", LIMITED, str(MOST_FILE), sys.executable, "-m", "thenar.cli", *arguments]
        # umockdev hides /dev/null from a process that opens it by name.
        nothing, environment = subprocess.DEVNULL, os.environ | bench.environment
        run = stack.enter_context(subprocess.Popen(command, env=environment, stdout=nothing))
        stack.callback(run.terminate)
        reader, samples = Reader(port), list[Sample]()
        reader.lines(time.monotonic() + every_s / 10)
        for number in range(1, round(minutes * MINUTE_S / every_s) + 1):
            if run.poll() is not None:
                return [f"the run ended with exit code {run.returncode}"]
            samples.append(now := sampled(run.pid, reader, every_s))
            print(
                f"{number * every_s / MINUTE_S:7.1f} min  {now.rss_kib / 1024:6.1f} MiB  {now.threads} threads"
                f"  {now.files} files  {now.lines / every_s:5.0f} grasps/s  {now.us:4.0f} µs of CPU a grasp",
                flush=True,
            )
    return grown(samples)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0, help="how long (default 60)")
    options = parser.parse_args()
    with TemporaryDirectory() as name:
        wrong = soak(Path(name), options.minutes)
    print("grown: " + "; ".join(wrong) if wrong else "flat")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()

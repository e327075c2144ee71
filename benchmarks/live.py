"""The cost of the live loop, and how close its rate comes to the limit of the wires.

    python benchmarks/live.py [--seconds N]

Prints two tables and the path of a frame: microseconds of CPU per frame, with all inputs changing and with a hand at
rest; those of a row by UDP from its datagram on; frames per second on emulated devices compared with the wire's limit;
the files that a frame passes from the bytes on the wire to a published grasp, and the calls per grasp; the peak memory
of a `thenar run` compared with 45 MiB. Emulated buses need umockdev (Debian packages umockdev, gir1.2-umockdev-1.0,
python3-gi). Emulated devices and readers run on the same cores as the run, so a busy or single-core machine gives worse
numbers than a glove would.
"""

import argparse
import os
import platform
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from liveplay import (
    Memory,
    Played,
    board,
    free_port,
    glove,
    joints_alone,
    performed,
    played,
    read_along,
    restless,
    run_arguments,
    wired,
    with_glove,
)
from liverates import Found, of_board, of_bus, of_glove
from liveway import way
from rich.console import Console
from rich.table import Table

from thenar.runtime import Glove
from thenar.runtime.frames import SwitchFrame, now_us
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.live.sources import FrameBuffer
from thenar.runtime.live.system import LiveSystem
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.sources.base import sources_of

MOST_US, REST_US, ROW_US, LEAST_SHARE, MOST_MIB, MOST_FILES = 60, 25, 200, 0.9, 45, 20
FRAMES, TURNS = 500, 8
# Of rows by UDP.
COLUMNS, ROWS, PORT = 30, 2000, 45_671
# A clock so slow that the overhead of the emulation does not matter.
SLOW_HZ = 10_000
STAGES = ("the step alone", "and JSON lines, preshape, angles, health", "and MCAP", "and reports", "and a socket")
# Prints the peak of its only child in KiB: a process's own peak starts at the size of its parent.
PEAK = "import os, subprocess, sys; print(os.wait4(subprocess.Popen(sys.argv[1:]).pid, 0)[2].ru_maxrss)"


def table(title: str, *columns: str) -> Table:
    made = Table(title=title, title_justify="left")
    for column in columns:
        made.add_column(column, justify="right" if made.columns else "left")
    return made


def loop_costs(scenes: Sequence[Played], folder: Path) -> Table:
    """Return a line per stage: CPU of the thread, median and 99th percentile, of frames in memory."""
    bounds = f"at most {MOST_US} µs with all inputs changing, {REST_US} with a hand at rest"
    made, found = table(f"CPU of the live thread a frame ({bounds})", ""), []
    for scene in scenes:
        moving = restless(len(scene.kept), FRAMES, seed=1)
        for what, frames in (("changing", moving), ("at rest", moving[:1] * FRAMES)):
            made.add_column(f"{len(scene.kept)} switches, {what}: median, 99 %", justify="right")
            found.append([np.percentile(spent, (50, 99)) for spent in _stages_us(scene, frames, folder)])
    for what, each in zip(STAGES, zip(*found, strict=True), strict=True):
        made.add_row(what, *(f"{median:.0f} µs, {high:.0f} µs" for median, high in each))
    return made


def _stages_us(scene: Played, frames: Sequence[tuple[int, bytes]], folder: Path) -> list[list[float]]:
    """Return microseconds per frame for every stage. Stages alternate, so that other load affects all."""
    with ExitStack() as stack:
        gloves = [_stage(stage, scene, folder, stack) for stage in range(len(STAGES))]
        turns = [[[_step_us(*each, *frame) for frame in frames] for each in gloves] for _ in range(1 + TURNS)]
    # The first turn fills caches.
    return [list(chain(*stage)) for stage in zip(*turns[1:], strict=True)]


def _step_us(run: Callable[[], object], feed: Memory, closed: int, sensors: bytes) -> float:
    feed.put(now_us(), closed, sensors)
    start = time.thread_time_ns()
    run()
    return (time.thread_time_ns() - start) / 1e3


def _stage(stage: int, scene: Played, folder: Path, stack: ExitStack) -> tuple[Callable[[], object], Memory]:
    """Return a function that processes one moment with everything up to this stage, and its feed."""
    own, port = Path(stack.enter_context(TemporaryDirectory(dir=folder))), free_port()
    harness, feed = with_glove(board(scene), glove(scene)), Memory(len(scene.kept))
    if stage == 0:
        recognizer = LiveSystem.of(scene.build, harness).recognizer()

        def step() -> None:
            taken = feed.take()
            recognizer.step(now_us(), time.time_ns() // 1000, taken.switches, taken.glove)

        return step, feed
    sinks = ["jsonl:/dev/null?every", f"tcp:{port}"] if stage >= 4 else ["jsonl:/dev/null"]
    record = own / "run.mcap" if stage >= 2 else None
    run = Glove(
        scene.build,
        harness,
        preshapes="barrett_bh8",
        sinks=sinks,
        record=record,
        status=stage >= 3,
        feed=feed.take,
    )
    stack.enter_context(run)
    if stage >= 4:
        stack.enter_context(read_along(port))
    return lambda: next(run), feed


def row_us(scene: Played, folder: Path) -> tuple[float, float]:
    """Return microseconds of CPU a row of COLUMNS columns by UDP, medians: until its frames are there for the live
    loop, and from there to a published grasp, which goes to a file as JSON lines.

    Its columns are a clock, the build's joints and switches, and further switches. In every row half of the switches
    change, and all joints.
    """
    joints = [joint.name for joint in scene.build.manifest.joints]
    spare = COLUMNS - 1 - len(scene.kept) - len(joints)
    switches = [*scene.kept, *(f"spare_{number}" for number in range(spare))]
    ranges = ", ".join(f"{name} = [0, 1023]" for name in joints)
    harness = parse_harness(
        f'[[stream]]\nport = "udp://127.0.0.1:{PORT}"\nrate_hz = 200\ntime = "ms"\n'
        f"columns = {['ms', *switches, *joints]!r}\nswitches = {switches!r}\njoints = {{ {ranges} }}\n",
        "rows",
    )
    scan = whole_scan(harness, scene.kept)
    (source,) = sources_of(harness, scene.kept, scan)
    buffer = FrameBuffer(len(scene.kept), [source.owned])
    draw = np.random.default_rng(1)
    rows = np.hstack([draw.integers(0, 2, (ROWS, len(switches))), draw.integers(0, 1024, (ROWS, len(joints)))])
    with (
        Glove(scene.build, harness, sinks=[f"jsonl:{folder}/rows.jsonl"], feed=buffer.take) as glove,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line,
        closing(source),
    ):
        source.open()
        found = []
        for number, row in enumerate(rows.tolist()):
            line.sendto(f"{5 * number},{','.join(map(str, row))}\n".encode(), ("127.0.0.1", PORT))
            began_s = time.thread_time()
            for _ in range(2):  # its switches and its joints
                frame = source.read(1.0)
                assert frame is not None
                if isinstance(frame, SwitchFrame):
                    buffer.put_switches(0, frame, source.longest_us)
                else:
                    buffer.put_glove(frame, source.longest_us)
            there_s = time.thread_time()
            next(glove)
            found.append((there_s - began_s, time.thread_time() - there_s))
    way, loop = 1e6 * np.median(found, axis=0)
    return float(way), float(loop)


def rates(scene: Played, seconds: float, folder: Path) -> Table:
    """Return a line per wire: frames per second, with all sinks and the recording on."""
    made = table(
        f"Frames a second with everything on (at least {LEAST_SHARE:.0%} of what the wire allows)",
        *("", "wire allows", "device sent", "arrived", "in a grasp", "of the wire", "CPU a grasp: loop, process"),
        "between system calls",
    )
    joints, own, whole = joints_alone("quick", folder), scene.kept, scene.performance.switch_names
    found = [of_glove(scene, folder, seconds, joints, sensors) for sensors in (18, 22)]
    for keys, baud, hz in ((len(own), 115_200, 0), (len(whole), 115_200, 0), (len(whole), 1_000_000, 1000)):
        found.append(of_board(scene, folder, seconds, keys, baud, hz))
    found.append(of_board(scene, folder, seconds, len(whole), 1_000_000, 0))
    for names, clock_hz in ((whole, 100_000), (own, 100_000), (own, SLOW_HZ)):
        what = f"I2C at {clock_hz // 1000} kHz, {len(own)} of {len(names)} switches"
        found.append(of_bus(scene, folder, seconds, what, wired(scene, names, clock_hz)))
    for each in found:
        made.add_row(*_rate(each))
    return made


def _rate(found: Found) -> tuple[str, ...]:
    rates_hz = (found.allowed_hz, found.sent_hz, found.arrived_hz, found.run.recognised_hz)
    cost = f"{found.run.loop_us:.0f} µs, {found.run.process_us:.0f} µs"
    split = f"{found.run.between_us:.0f} µs a scan: {found.own_share:.0%}" if found.run.between_us else ""
    return found.what, *(f"{hz:.0f}" for hz in rates_hz), f"{found.share:.0%}", cost, split


def peak_mib(scene: Played, folder: Path, seconds: float) -> float:
    """Return the peak of a `thenar run` on a CyberGlove and a bus, with recording, socket and preshape."""
    with performed(scene, wired(scene, scene.kept, 400_000), folder) as bench:
        options = ("--sink", "tcp:0", "--record", str(folder / "peak.mcap"), "--status")
        run = run_arguments(scene.folder, bench.harness, folder, *options, "--frames", str(int(400 * seconds)))
        command = [sys.executable, "-c", PEAK, sys.executable, "-m", "thenar.cli", *run]
        done = subprocess.run(command, env=os.environ | bench.environment, capture_output=True, text=True, check=True)
    return int(done.stdout) / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3.0, help="of each run on a wire (default 3)")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that devices are taken away again
    console = Console(width=180)
    busy = f"{os.getloadavg()[0]:.1f} processes were busy on {os.cpu_count()} cores when it began"
    console.print(f"{platform.machine()}, Python {platform.python_version()}; {busy}\n")
    with TemporaryDirectory() as name:
        folder = Path(name)
        scenes = [played("quick", folder), played("kamakura", folder, prune=20)]
        console.print(loop_costs(scenes, folder), "")
        (folder / "few").mkdir()
        way_us, loop_us = row_us(played("quick", folder / "few", prune=60), folder)
        console.print(
            f"A row of {COLUMNS} columns by UDP, from its datagram to a grasp: {way_us + loop_us:.0f} µs (at most "
            f"{ROW_US}), of which {loop_us:.0f} are the live thread's\n"
        )
        console.print(rates(scenes[0], options.seconds, folder), "")
        files, calls = way(scenes[0], folder)
        console.print(f"A frame passes {len(files)} files (at most {MOST_FILES}), in {calls:.0f} calls")
        console.print("\n".join(files), "")
        console.print(
            f"Peak of `thenar run`: {peak_mib(scenes[0], folder, options.seconds):.0f} MiB (at most {MOST_MIB})"
        )


if __name__ == "__main__":
    main()

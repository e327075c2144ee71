"""How close the rate of the live loop comes to the limit of the wires, and its cost.

    python benchmarks/live.py [--seconds N]

Prints frames per second on emulated devices compared with the wire's limit, with microseconds of CPU per grasp, and the
peak memory of a `thenar run` compared with 80 MiB. Emulated buses need umockdev (Debian packages umockdev,
gir1.2-umockdev-1.0, python3-gi). Emulated devices and readers run on the same cores as the run, so a busy or
single-core machine gives worse numbers than a glove would.
"""

import argparse
import os
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from liveplay import Played, glove, joints_alone, machine, played, wired, with_glove
from liverates import Found, of_board, of_bus, of_glove
from rich.console import Console
from rich.table import Table

from thenar.runtime.harness.writing import harness_to_toml
from thenar.simulator.playing.bench import Bench

LEAST_SHARE, MOST_MIB = 0.9, 80
# A clock so slow that the overhead of the emulation does not matter.
SLOW_HZ = 10_000
# Prints the peak of its only child in KiB: a process's own peak starts at the size of its parent.
PEAK = "import os, subprocess, sys; print(os.wait4(subprocess.Popen(sys.argv[1:]).pid, 0)[2].ru_maxrss)"


def rates(scene: Played, seconds: float, folder: Path) -> Table:
    """Return a line per wire: frames per second, with all sinks and the recording on."""
    title = f"Frames a second with everything on (at least {LEAST_SHARE:.0%} of what the wire allows)"
    made = Table(title=title, title_justify="left")
    for column in (
        "",
        "wire allows",
        "device sent",
        "arrived",
        "in a grasp",
        "of the wire",
        "CPU a grasp: loop, process",
    ):
        made.add_column(column, justify="right" if column else "left")
    joints, own, whole = joints_alone("quick", folder), scene.kept, scene.performance.switch_names
    found = [of_glove(scene, joints, sensors, seconds) for sensors in (18, 22)]
    for keys, baud, hz in ((len(own), 115_200, 0), (len(whole), 115_200, 0), (len(whole), 1_000_000, 1000)):
        found.append(of_board(scene, keys, baud, hz, seconds))
    found.append(of_board(scene, len(whole), 1_000_000, 0, seconds))
    for names, clock_hz in ((whole, 100_000), (own, 100_000), (own, SLOW_HZ)):
        what = f"I2C at {clock_hz // 1000} kHz, {len(own)} of {len(names)} switches"
        found.append(of_bus(scene, what, wired(scene, names, clock_hz), seconds))
    for each in found:
        made.add_row(*_rate(each))
    return made


def _rate(found: Found) -> tuple[str, ...]:
    rates_hz = (found.allowed_hz, found.sent_hz, found.arrived_hz, found.run.recognised_hz)
    cost = f"{found.run.loop_us:.0f} us, {found.run.process_us:.0f} us"
    return found.what, *(f"{hz:.0f}" for hz in rates_hz), f"{found.share:.0%}", cost


def peak_mib(scene: Played, folder: Path, seconds: float) -> float:
    """Return the peak of a `thenar run` on a CyberGlove and a bus, with recording, socket and preshape."""
    harness = wired(scene, scene.kept, 400_000)
    with Bench(harness, scene.performance.switch_names, folder) as bench:
        file = folder / "glove.toml"
        file.write_text(harness_to_toml(with_glove(bench.harness, glove(scene, str(folder / "cyberglove")))))
        options = ["--sink", f"unix:{folder}/socket", "--preshape", "barrett_bh8", "--record", folder / "peak.mcap"]
        run = [sys.executable, "-m", "thenar.cli", "run", scene.folder, "--glove", file, "--status", *options]
        run += ["--frames", str(int(400 * seconds))]
        command = [sys.executable, "-c", PEAK, *map(str, run)]
        done = subprocess.run(command, env=os.environ | bench.environment, capture_output=True, text=True, check=True)
    return int(done.stdout) / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3.0, help="of each run on a wire (default 3)")
    seconds = parser.parse_args().seconds
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that devices are taken away again
    console = Console(width=180)
    console.print(machine(), "")
    with TemporaryDirectory() as name:
        folder = Path(name)
        scene = played("quick", folder)
        console.print(rates(scene, seconds, folder), "")
        console.print(f"Peak of `thenar run`: {peak_mib(scene, folder, seconds):.0f} MiB (at most {MOST_MIB})")


if __name__ == "__main__":
    main()

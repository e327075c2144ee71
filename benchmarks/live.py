"""How close the rate of the live loop comes to the limit of the wires, and its cost.

    python benchmarks/live.py [--seconds N]

Prints frames per second on emulated devices compared with the wire's limit, and microseconds of CPU per grasp. Emulated
buses need umockdev (Debian packages umockdev, gir1.2-umockdev-1.0, python3-gi). Emulated devices and readers run on the
same cores as the run, so a busy or single-core machine gives worse numbers than a glove would.
"""

import argparse
import signal
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from liveplay import Played, joints_alone, machine, played, wired
from liverates import of_board, of_bus, of_glove
from rich.console import Console
from rich.table import Table

LEAST_SHARE = 0.9
# A clock so slow that the overhead of the emulation does not matter.
SLOW_HZ = 10_000


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
        rates_hz = (each.allowed_hz, each.sent_hz, each.arrived_hz, each.run.recognised_hz)
        share = f"{each.run.recognised_hz / each.allowed_hz:.0%}"
        cost = f"{each.run.loop_us:.0f} us, {each.run.process_us:.0f} us"
        made.add_row(each.what, *(f"{hz:.0f}" for hz in rates_hz), share, cost)
    return made


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
        console.print(rates(scene, seconds, folder))


if __name__ == "__main__":
    main()

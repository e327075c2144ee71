"""The scan of the kept switches compared with that of all 160: by bus arithmetic, and measured on an emulated bus."""

import os
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, median
from tempfile import TemporaryDirectory

import msgspec
from liveplay import Played, glove, with_glove
from liverates import LIVEWIRE
from livewire import SCANS, Scanned

from thenar.compiler.glove.propose import propose_harness
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.scanning.plan import plan_scan
from thenar.runtime.scanning.ports import whole_scan
from thenar.runtime.scanning.timing import scan_us
from thenar.simulator.playing.bench import Bench

CLOCK_HZ = 100_000
ROWS = 40


@dataclass(frozen=True, slots=True)
class Scan:
    """One way to scan, averaged over rows of the performance.

    predicted_us  time on the wire; measured_us: time of a scan; python_us: the thread's work outside system calls;
    ioctls and bytes on the wire
    """

    what: str
    predicted_us: float
    measured_us: float
    python_us: float
    ioctls: float
    bytes: float


def compared(scene: Played, clock_hz: int = CLOCK_HZ) -> Iterator[Scan]:
    """Yield all 160; the kept ones on the same glove and on a separate glove."""
    full, reduced = wired(scene, scene.performance.switch_names, clock_hz), wired(scene, scene.kept, clock_hz)
    yield _measured(scene, full, "all", "all 160 switches")
    for harness, where in (
        (full, "kept switches on the glove of 160"),
        (reduced, "kept switches on a separate glove"),
    ):
        yield _measured(scene, harness, "kept", where)


def wired(scene: Played, names: tuple[str, ...], clock_hz: int) -> Harness:
    """Return a glove with these switches on MCP23017, scanned as often as the wire allows, and a CyberGlove."""
    proposed = propose_harness(names, device="/dev/i2c-7")
    bus = msgspec.structs.replace(proposed.buses[0], clock_hz=clock_hz, rate_hz=10_000.0)
    return with_glove(msgspec.structs.replace(proposed, buses=(bus,)), glove(scene))


def _measured(scene: Played, harness: Harness, which: str, what: str) -> Scan:
    rows = range(0, len(scene.performance), max(1, len(scene.performance) // ROWS))[:ROWS]
    with TemporaryDirectory() as folder:
        path = Path(folder, "glove.toml")
        path.write_text(harness_to_toml(harness))
        with Bench(harness, scene.performance.switch_names, Path(folder)) as bench:
            command = [sys.executable, str(LIVEWIRE), "scans", str(scene.folder), str(path), which]
            seen = os.environ | bench.environment
            with subprocess.Popen(
                command, text=True, env=seen, stdin=subprocess.PIPE, stdout=subprocess.PIPE
            ) as client:
                return Scan(what, _predicted_us(scene, harness, which), *_scanned(scene, bench, client, rows))


def _scanned(scene: Played, bench: Bench, client: "subprocess.Popen[str]", rows: Iterable[int]) -> tuple[float, ...]:
    """Let the client scan row after row; return the measurements of a scan, in the order of Scan."""
    assert bench.i2c is not None
    assert client.stdin is not None
    assert client.stdout is not None
    client.stdout.readline()
    before, found = bench.i2c.counters(0).total_bytes, list[Scanned]()
    for row in rows:
        sensors = scene.performance.sensors[row].tobytes()
        bench.show(scene.performance.switches[row].tolist(), sensors)
        client.stdin.write("\n")
        client.stdin.flush()
        found.append(msgspec.json.decode(client.stdout.readline(), type=Scanned))
    sent = (bench.i2c.counters(0).total_bytes - before) / (SCANS * len(found))
    client.stdin.close()
    # Median per row, so that interrupted scans do not count; mean over rows, all of which count.
    us, python_us = (fmean(map(median, each)) for each in ([f.us for f in found], [f.python_us for f in found]))
    return us, python_us, fmean(f.ioctls for f in found) / SCANS, sent


def _predicted_us(scene: Played, harness: Harness, which: str) -> float:
    """Return the calculated time of a scan on the wire."""
    if which == "all":
        return scan_us(whole_scan(harness, harness.switches), harness).us
    return scan_us(plan_scan(scene.kept, harness), harness).us

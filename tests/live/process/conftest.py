"""`thenar run` in a process of its own, on emulated devices of every kind."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Event, Thread
from time import monotonic
from typing import Any

import msgspec
import pytest

from thenar.drivers.emulated.i2c import WireCounters
from thenar.runtime.frames import now_us
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.sinks.jsonl import GraspLine, HealthLine, Line

from ...conftest import tool
from ..conftest import on_bench

_line = msgspec.json.Decoder(Line)
ENDING_S = 20.0


class Client:
    """One `thenar run`. What it writes on stdout goes into the scene's grasps, its reports into `reports`."""

    def __init__(self, arguments: list[str], environment: dict[str, str], folder: Path, scene: Any) -> None:
        self._scene = scene
        self.reports: list[HealthLine] = []
        self._errors = folder / "stderr"
        with self._errors.open("ab") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "thenar.cli", *arguments],
                stdout=subprocess.PIPE,
                stderr=errors,
                env={**os.environ, **environment},
            )
        self._reader = Thread(target=self._read, name="reader of the run")
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for text in self.process.stdout:
            if not text.endswith(b"\n"):  # killed amid a line
                return
            line = _line.decode(text)
            if isinstance(line, GraspLine):
                self._scene.grasps.add(line)
            elif isinstance(line, HealthLine):
                self.reports.append(line)

    @property
    def said(self) -> str:
        return self._errors.read_text()

    @property
    def held(self) -> tuple[int, int]:
        """How many file descriptors and threads it has; sockets not among them, of which umockdev leaves one behind
        whenever a device node could not be opened.
        """
        own = Path("/proc", str(self.process.pid))
        files = [file for file in (own / "fd").iterdir() if not str(file.readlink()).startswith("socket:")]
        return len(files), len(list((own / "task").iterdir()))

    def count(self, kind: str, name: str) -> int:
        device = next(device for device in self.reports[-1].devices if device.name.startswith(kind))
        return sum(count.value for count in device.counts if count.name.startswith(name))

    def end(self, number: signal.Signals = signal.SIGINT) -> int:
        """Send a signal and return the exit code."""
        self.process.send_signal(number)
        return self.wait()

    def wait(self) -> int:
        code = self.process.wait(ENDING_S)
        self._reader.join()
        return code

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()
        assert "Traceback" not in self.said, self.said


class Run:
    """A bench of emulated devices, the scene on it, and clients that run on it, one at a time."""

    def __init__(self, stack: ExitStack, scene: Any, harness: Harness, folder: Path, build: Path) -> None:
        self._stack, self._folder, self.build, self.scene = stack, folder, build, scene
        self.bench, wired = on_bench(stack, scene, harness, folder)
        (folder / "glove.toml").write_text(harness_to_toml(wired))

    def start(self, *options: object, glove: Path | None = None, after: Path | None = None) -> Client:
        """Start a run, of this bench or of another `glove`, once the file `after` is there."""
        if after is not None:
            self.eventually(after.exists)
        where = [
            str(self.build),
            "--glove",
            str(glove or self._folder / "glove.toml"),
            "--sink",
            "jsonl:-?every",
            "--status",
        ]
        arguments = ["run", *where, "--lead", "0", "--dwell-ms", "0", *map(str, options)]
        client = Client(arguments, self.bench.environment, self._folder, self.scene)
        self._stack.callback(client.close)
        return client

    def bus_names(self, *chips: int) -> set[str]:
        """Return the kept switches on these chips of the bus."""
        kept = set(self.scene.truth.switch_names)
        return {name for chip in chips for name in self.bench.harness.buses[0].chips[chip].pins.values()} & kept

    def wire(self) -> WireCounters:
        assert self.bench.i2c is not None
        return self.bench.i2c.counters(0)

    def now_us(self) -> int:
        return now_us()

    def eventually(self, condition: Callable[[], bool], seconds: float = ENDING_S) -> None:
        """Wait until a condition of files or counters holds, of which nobody is told."""
        end, never = monotonic() + seconds, Event()
        while not condition():
            assert monotonic() < end, f"not so in {seconds:g} s"
            never.wait(0.002)


@pytest.fixture
def run(
    stage: Any, harness_of: Callable[..., Harness], make_scene: Any, tmp_path: Path
) -> Iterator[Callable[..., Run]]:
    """Return what puts up a bench for a build: `start` starts the client."""
    tool("umockdev-wrapper")
    with ExitStack() as stack:

        def make(inputs: str, *parts: str, glove: str = "") -> Run:
            scene = make_scene(stage.truth(inputs), None)
            harness = harness_of(inputs, *parts, glove=glove)
            made = Run(stack, scene, harness, tmp_path, stage.builds[inputs])
            scene.show(0)
            return made

        yield make

"""A run in this process, on emulated serial devices; it must leave nothing behind."""

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Event, Thread
from typing import Any

import msgspec
import pytest

from thenar.runtime.harness.wiring import Harness
from thenar.runtime.live.frames import now_us
from thenar.runtime.live.keeper import DeviceState
from thenar.runtime.live.loop import LiveLoop
from thenar.runtime.live.policy import Policy
from thenar.runtime.live.system import System
from thenar.runtime.recording.writer import Recorder
from thenar.simulator.playing.bench import Bench

# The answer is the candidate of each frame.
FRANK = Policy(lead=0.0, dwell_us=0)


class Run:
    """What runs, and the scene that it looks at."""

    def __init__(
        self,
        stack: ExitStack,
        scene: Any,
        harness: Harness,
        folder: Path,
        recorder: Callable[[System], Recorder] | None,
        damage: Callable[[bytes], bytes] | None,
        unplugged: int | None,
    ) -> None:
        performance = scene.truth.performance
        self.bench = stack.enter_context(Bench(harness, performance.switch_names, folder))
        self.scene = scene
        scene._show = self.bench.show
        for line in self.bench.lines:
            line.damage = damage
        if unplugged is not None:
            self.bench.lines[unplugged].unplug()
        wired = self.bench.harness
        if wired.cyberglove is not None:
            (folder / "calibration.toml").write_text(performance.calibration.to_toml())
            glove = msgspec.structs.replace(wired.cyberglove, calibration=str(folder / "calibration.toml"))
            wired = msgspec.structs.replace(wired, cyberglove=glove)
        self.system = System.of(scene.truth.build, wired, FRANK)
        self.recorder = None if recorder is None else stack.enter_context(recorder(self.system))
        self.sources = stack.enter_context(self.system.sources())
        self.stop = Event()
        self.loop = LiveLoop(
            self.sources, self.system.recognizer(), lambda moment: scene.grasps.add(moment.grasp), self.recorder
        )
        self._thread = Thread(target=self.loop.run, args=(self.stop,), name="loop")
        self._thread.start()
        stack.callback(self.end)

    def end(self) -> None:
        self.stop.set()
        self._thread.join()

    def now_us(self) -> int:
        return now_us()

    def damaged(self, line: int) -> int:
        """Return how many messages of a line were counted as none."""
        kind, counted = [("cyberglove", ("wrong start", "wrong length")), ("scanner", ("damaged", "short"))][line]
        counts = self.counts(kind)
        return sum(counts[name] for name in counted)

    def device(self, kind: str) -> DeviceState:
        return next(state for state in self.sources.devices() if state.name.startswith(kind))

    def counts(self, kind: str) -> dict[str, int]:
        found = next(device for device in self.sources.health() if device.name.startswith(kind))
        return {count.name: count.value for count in found.counts}

    def periods_us(self) -> tuple[int, int]:
        """Of the glove and of the switches; 0 where there are none."""
        return self.sources.glove_period_us or 0, self.sources.switch_period_us or 0


@pytest.fixture
def nothing_left() -> Iterator[None]:
    """Hold that no thread and no file descriptor outlives the test."""
    threads, files = set(threading.enumerate()), len(os.listdir("/proc/self/fd"))  # noqa: PTH208
    yield
    assert set(threading.enumerate()) <= threads
    assert len(os.listdir("/proc/self/fd")) <= files  # noqa: PTH208


@pytest.fixture
def run(
    nothing_left: None, stage: Any, harness_of: Callable[..., Harness], make_scene: Any, tmp_path: Path
) -> Iterator[Callable[..., Run]]:
    """Return what starts a run of a build on the parts of a harness, showing row 0: all is well when it returns,

    unless messages are damaged, or the device of a line is unplugged, from the beginning.
    """
    with ExitStack() as stack:

        def start(
            inputs: str,
            *parts: str,
            glove: str = "",
            recorder: Callable[[System], Recorder] | None = None,
            damage: Callable[[bytes], bytes] | None = None,
            unplugged: int | None = None,
        ) -> Run:
            scene = make_scene(stage.truth(inputs), None)
            harness = harness_of(inputs, *parts, glove=glove)
            made = Run(stack, scene, harness, tmp_path, recorder, damage, unplugged)
            scene.show(0)
            if damage is None and unplugged is None:
                scene.well(now_us())
            return made

        yield start

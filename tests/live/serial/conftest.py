"""A run in this process, on emulated serial devices; it must leave nothing behind."""

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from thenar.runtime import Glove
from thenar.runtime.frames import now_us
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.policy import Policy
from thenar.runtime.published import DeviceHealth

from ..conftest import on_bench

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
        record: Path | None,
        damage: Callable[[bytes], bytes] | None,
        unplugged: int | None,
    ) -> None:
        self.scene = scene
        self.bench, wired = on_bench(stack, scene, harness, folder)
        for line in self.bench.lines:
            line.damage = damage
        if unplugged is not None:
            self.bench.lines[unplugged].unplug()
        self.glove = stack.enter_context(Glove(scene.truth.build, wired, policy=FRANK, record=record))
        self.system, self.sources, self.recorder = self.glove.system, self.glove.sources, self.glove.recorder
        # The report that came with the first grasp that rests on all devices.
        self.first_health = self.glove.health
        self._thread = Thread(target=self._run, name="loop")
        self._thread.start()
        stack.callback(self.end)

    def _run(self) -> None:
        for moment in self.glove:
            if moment.grasp.health == "ok" and self.first_health is None:
                self.first_health = self.glove.health
            self.scene.grasps.add(moment.grasp)

    def end(self) -> None:
        self.glove.stop.set()
        self._thread.join()

    def now_us(self) -> int:
        return now_us()

    def damaged(self, line: int) -> int:
        """Return how many messages of a line were counted as none."""
        kind, counted = [("cyberglove", ("wrong start", "wrong length")), ("stream", ("damaged", "misfits"))][line]
        counts = self.counts(kind)
        return sum(counts[name] for name in counted)

    def device(self, kind: str) -> DeviceHealth:
        return next(state for state in self.sources.devices() if state.name.startswith(kind))

    def opened(self, kind: str = "") -> list[int]:
        """Return how often each device of a kind was opened."""
        return [keeper.opened for keeper in self.sources._keepers if keeper.state.name.startswith(kind)]

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
            record: Path | None = None,
            damage: Callable[[bytes], bytes] | None = None,
            unplugged: int | None = None,
        ) -> Run:
            scene = make_scene(stage.truth(inputs), None)
            harness = harness_of(inputs, *parts, glove=glove)
            made = Run(stack, scene, harness, tmp_path, record, damage, unplugged)
            scene.show(0)
            if damage is None and unplugged is None:
                scene.well(now_us())
            return made

        yield start

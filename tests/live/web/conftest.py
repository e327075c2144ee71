"""A run in this process on emulated serial devices, its page, and a browser that has it open."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from selenium import webdriver

from thenar.runtime import Glove
from thenar.runtime.frames import now_us
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.policy import Policy
from thenar.runtime.web.live import LivePage, shell_message
from thenar.runtime.web.server import Server

from ...browser import Browser
from ..conftest import on_bench

PATIENCE_S = 30
# The answer is the candidate of each frame.
FRANK = Policy(lead=0.0, dwell_us=0)


@pytest.fixture(scope="module")
def chromium(new_chromium: Callable[..., webdriver.Chrome]) -> Iterator[Browser]:
    driver = new_chromium("--window-size=1400,1000")
    yield Browser(driver)
    driver.quit()


@pytest.fixture
def browser(chromium: Browser) -> Iterator[Browser]:
    """Return the browser; the page may not have complained of anything when the test ends."""
    yield chromium
    complaints = chromium.log()
    chromium.driver.get("about:blank")
    assert complaints == []


class Run:
    """What runs, the scene that it looks at, and its page."""

    def __init__(
        self, stack: ExitStack, scene: Any, harness: Harness, folder: Path, build: Path, record: Path | None
    ) -> None:
        self.scene = scene
        self.bench, wired = on_bench(stack, scene, harness, folder)
        self.glove = Glove(scene.truth.build, wired, policy=FRANK, record=record, status=True)
        server = stack.enter_context(Server("live", "127.0.0.1:0", token=None))
        system = self.glove.system
        server.publish("shell", shell_message(system.harness.name, build, system.build.manifest))
        self.page = LivePage(server, self.glove, build)
        stack.enter_context(self.glove)
        self._thread = Thread(target=self._run, name="loop")
        self._thread.start()
        stack.callback(self.end)

    def _run(self) -> None:
        for moment in self.glove:
            self.page.show(moment)
            self.scene.grasps.add(moment.grasp)

    def end(self) -> None:
        self.glove.stop.set()
        self._thread.join()


@pytest.fixture
def run(
    stage: Any, harness_of: Callable[..., Harness], make_scene: Any, tmp_path: Path
) -> Iterator[Callable[..., Run]]:
    """Return what starts a run of a glove and a board, showing row 0: all is well when it returns."""
    with ExitStack() as stack:

        def start(record: Path | None = None) -> Run:
            scene = make_scene(stage.truth("both"), None)
            made = Run(stack, scene, harness_of("both", "glove", "board"), tmp_path, stage.builds["both"], record)
            scene.show(0)
            scene.well(now_us())
            return made

        yield start

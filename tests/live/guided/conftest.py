"""Commands that serve a page, on emulated devices, and browsers that have it open."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from thenar.drivers.emulated.cyberglove import EmulatedCyberGlove
from thenar.drivers.emulated.lines import BoardSender
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.simulator.playing.performance import Performance

from ..web.conftest import Browser as PageBrowser

PATIENCE_S = 60
GLOVE = """name = "bench"
[cyberglove]
port = "{folder}/glove"
calibration = "{folder}/wearer.toml"
[[stream]]
port = "{folder}/board"
baud = 1000000
rate_hz = 200
switches = {switches}
"""


ENTER = Keys.ENTER
# Nothing is offered that needs a device which is silent, as one may be for a moment on a busy machine.
_OFFERED = "return document.querySelector(`nav button:not([hidden])[aria-keyshortcuts='${arguments[0]}']`) !== null"


class Browser(PageBrowser):
    """A browser with one page open, used by keyboard alone."""

    def see(self, url: str, *, width: int = 1400, scheme: str = "light") -> "Browser":
        """Open a page, and wait until it is connected."""
        self.open(url, width=width, scheme=scheme)
        self.wait(lambda: self.text("link").startswith("page: connected since"))
        return self

    def stage(self) -> str:
        return str(self.script("return document.getElementById('task').dataset.stage"))

    def until(self, *stages: str) -> str:
        """Wait for one of these stages, and return which it is."""
        self.wait(lambda: self.stage() in stages)
        return self.stage()

    def press(self, key: str) -> None:
        """Type a key that changes something, once it is offered, and wait until the page shows that."""
        letter = "Enter" if key == ENTER else key
        self.wait(lambda: self.script(_OFFERED, letter))
        step = self.step()
        self.type(key)
        self.wait(lambda: self.step() != step)

    def step(self) -> object:
        return self.script("return document.getElementById('task').dataset.step")

    def type(self, *keys: str) -> None:
        ActionChains(self.driver).send_keys(*keys).perform()

    def offered(self) -> list[str]:
        """Return the keys that do something now, as their buttons say."""
        return [button.text for button in self.driver.find_elements(By.CSS_SELECTOR, "nav button") if button.text]

    def faults(self) -> list[str]:
        """Return what the page complained of, but that the command and its server have ended."""
        return [one["message"] for one in self.log() if "WebSocket connection to" not in one["message"]]

    def overflow(self) -> object:
        """Return by how many pixels the page is wider than its window."""
        return self.script("return document.documentElement.scrollWidth - innerWidth")


@pytest.fixture(scope="module")
def drivers(new_chromium: Callable[..., webdriver.Chrome]) -> Iterator[Callable[[int], Browser]]:
    """Return the browsers of a module, by number: each is started when it is first asked for."""
    with ExitStack() as stack:
        made: list[Browser] = []

        def browser(number: int) -> Browser:
            while len(made) <= number:
                driver = new_chromium("--window-size=1400,1000")
                stack.callback(driver.quit)
                made.append(Browser(driver))
            return made[number]

        yield browser


@pytest.fixture
def browser(drivers: Callable[[int], Browser]) -> Iterator[Browser]:
    yield drivers(0)
    drivers(0).driver.get("about:blank")


@pytest.fixture
def other(drivers: Callable[[int], Browser]) -> Iterator[Browser]:
    yield drivers(1)
    drivers(1).driver.get("about:blank")


class Wearer:
    """The emulated devices of a glove with the hand of a performance in it."""

    def __init__(self, performance: Performance, folder: Path, stack: ExitStack) -> None:
        self.performance, self.folder = performance, folder
        names = list(performance.switch_names)
        (folder / "wearer.toml").write_text(performance.calibration.to_toml())
        (folder / "glove.toml").write_text(GLOVE.format(folder=folder, switches=names))
        sensors = len(performance.calibration.sensors)
        self.board_line = stack.enter_context(PtyLine(folder / "board", 1_000_000))
        self.glove_line = stack.enter_context(PtyLine(folder / "glove"))
        self.board = stack.enter_context(BoardSender(self.board_line.send, names, (), 200))
        self.glove = stack.enter_context(EmulatedCyberGlove(self.glove_line, sensors=sensors))
        self.show(0)

    def show(self, row: int) -> int:
        """Hold what a row of the performance holds; return how many switches are closed."""
        bits = self.performance.switches[row]
        self.board.show(dict(zip(self.performance.switch_names, bits.tolist(), strict=True)))
        self.glove.set(self.performance.sensors[row].tobytes())
        return int(bits.sum())


@pytest.fixture
def wearer(stage: Any, tmp_path: Path) -> Iterator[Wearer]:
    with ExitStack() as stack:
        yield Wearer(stage.performance, tmp_path, stack)


class Command:
    """A command with --web, as a service would run it: nobody types."""

    def __init__(self, folder: Path, *arguments: object) -> None:
        line = [sys.executable, "-m", "thenar.cli", *map(str, arguments), "--web", "127.0.0.1:0"]
        self._said = folder / "said"
        with self._said.open("wb") as said:
            self.process = subprocess.Popen(
                line, stdin=subprocess.DEVNULL, stdout=said, stderr=said, start_new_session=True, cwd=folder
            )

    @property
    def said(self) -> str:
        return self._said.read_text()

    @property
    def url(self) -> str:
        """Where the page is, once that is said."""
        for _ in range(PATIENCE_S * 20):
            if found := re.search(r"the page is at (\S+)", self.said):
                return found[1]
            try:
                self.process.wait(0.05)
                break
            except subprocess.TimeoutExpired:
                continue
        raise AssertionError(self.said)

    def finish(self) -> int:
        return self.process.wait(PATIENCE_S)

    def kill(self) -> None:
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


@pytest.fixture
def command(tmp_path: Path) -> Iterator[Callable[..., Command]]:
    begun: list[Command] = []

    def begin(*arguments: object) -> Command:
        begun.append(Command(tmp_path, *arguments))
        return begun[-1]

    yield begin
    for one in begun:
        one.kill()

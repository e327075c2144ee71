"""The page of a recording, in Chromium, of a recording that a run on emulated devices has made."""

import os
from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from thenar.runtime.frames import SwitchFrame, now_us
from thenar.runtime.published import LiveGrasp
from thenar.runtime.recording.reader import Reader
from thenar.runtime.recording.session import Label
from thenar.runtime.web.replay import ReplayPage

pytestmark = pytest.mark.slow

ROWS = (3, 9, 15, 21)
_SEEK = """
const slider = document.getElementById("at");
slider.value = arguments[0];
slider.dispatchEvent(new Event("input", {bubbles: true}));
"""


class Recorded:
    """What a recording holds: answers and frames with their seconds from its first message, and the labels' spans."""

    def __init__(self, path: Path) -> None:
        reader = Reader(path)
        entries = [entry for entry in reader if isinstance(entry, SwitchFrame | LiveGrasp)]
        first_us = min(entry.time_us for entry in entries)
        self.grasps = [entry for entry in entries if isinstance(entry, LiveGrasp)]
        self.times = [(entry.time_us - first_us) / 1e6 for entry in self.grasps]
        self.session, self.seconds = reader.session, self.times[-1]

    def at(self, seconds: float) -> LiveGrasp:
        return self.grasps[bisect_right(self.times, seconds + 1e-6) - 1]


@pytest.fixture
def recording(run: Callable[..., Any], tmp_path: Path) -> tuple[Path, dict[int, tuple[int, int]]]:
    """Return a recording of several rows, each labelled as a trial, and when each was settled, by the host's clock."""
    path, spans = tmp_path / "run.mcap", dict[int, tuple[int, int]]()
    running = run(path)
    scene, recorder = running.scene, running.glove.recorder
    for number, row in enumerate(ROWS, 1):
        scene.show(row)
        answer = scene.settled(row).candidate
        begun_us = now_us()
        scene.grasps.wait(lambda grasp, after=begun_us: grasp.time_us > after + 400_000, begun_us)
        spans[row] = begun_us, now_us()
        for event, time_us in (("begun", begun_us), ("captured", spans[row][1]), ("accepted", spans[row][1])):
            label = Label(time_us, event, number, answer, "A", "thing")  # type: ignore[arg-type]
            # A run writes no labels itself: in its thread, as the next moment comes at any time.
            recorder._thread.put(partial(recorder._recorder.label, label))
    running.end()
    recorder.close()
    return path, spans


@pytest.fixture
def show(browser: Any) -> Iterator[Callable[..., Any]]:
    """Return what opens the page of a recording in the browser."""
    with ExitStack() as stack:

        def opened(path: Path, build: Path, **how: Any) -> ReplayPage:
            page = stack.enter_context(ReplayPage(path, "127.0.0.1:0", token=None, build=build))
            stop = Event()
            thread = Thread(target=page.run, args=(stop,))
            thread.start()
            stack.callback(thread.join)
            stack.callback(stop.set)
            browser.open(page.server.url, **how)
            browser.wait(lambda: browser.text("scanned") == "" and browser.text("place") != "not read yet")
            return page

        yield opened
        browser.driver.get("about:blank")


def place(browser: Any) -> float:
    return float(browser.script("return document.getElementById('at').value"))


def test_wherever_the_slider_stands_the_page_shows_what_was_there(
    recording: tuple[Path, dict[int, tuple[int, int]]], stage: Any, browser: Any, show: Callable[..., Any]
) -> None:
    (path, spans), truth = recording, stage.truth("both")
    recorded = Recorded(path)
    show(path, stage.builds["both"])
    assert float(browser.script("return document.getElementById('at').max")) == pytest.approx(recorded.seconds, abs=0.2)
    first_us = recorded.grasps[0].time_us - 1e6 * recorded.times[0]
    for row in (*ROWS, *reversed(ROWS)):
        begun_us, end_us = spans[row]
        seconds = ((begun_us + end_us) / 2 - first_us) / 1e6
        browser.script(_SEEK, seconds)
        found, closed = recorded.at(seconds), int(truth.bits[row].sum())
        browser.wait(lambda grasp=found.grasp: browser.text("grasp") == grasp)
        said = f"{closed} of {len(truth.switch_names)} switches closed"
        browser.wait(lambda said=said: browser.text("hand-says").startswith(said))
        browser.wait(lambda label=found.candidate: browser.text("truth") == f"Truth: {label}")
        assert place(browser) == pytest.approx(seconds, abs=0.02)
        assert browser.texts("#types li[aria-current] .name") == [found.grasp]
    # A moment of a recording has no age, however long it is looked at.
    clock = "return performance.now()"
    start = browser.script(clock)
    browser.wait(lambda: browser.script(clock) > start + 1000)
    assert browser.text("age") == ""
    assert not browser.script("return document.documentElement.classList.contains('old')")
    label = browser.script("return document.getElementById('whole').getAttribute('aria-label')")
    assert f"{len(ROWS)} labelled spans" in label
    assert browser.text("faults") == ""
    assert browser.axe() == []


def test_by_keyboard_it_plays_pauses_and_goes_to_labels_and_ends(
    recording: tuple[Path, dict[int, tuple[int, int]]], stage: Any, browser: Any, show: Callable[..., Any]
) -> None:
    path, spans = recording
    recorded = Recorded(path)
    show(path, stage.builds["both"])
    first_us = recorded.grasps[0].time_us - 1e6 * recorded.times[0]

    def press(*keys: str) -> None:
        ActionChains(browser.driver).send_keys(*keys).perform()

    press(Keys.END)
    browser.wait(lambda: place(browser) == pytest.approx(recorded.seconds, abs=0.1))
    press(Keys.HOME)
    browser.wait(lambda: place(browser) == 0)
    for begun_us, _ in spans.values():
        press("n")
        browser.wait(lambda at=(begun_us - first_us) / 1e6: place(browser) == pytest.approx(at, abs=0.02))
    press(Keys.HOME)
    browser.wait(lambda: place(browser) == 0)
    assert browser.text("play") == "Play"
    press(" ")
    browser.wait(lambda: browser.text("play") == "Pause" and place(browser) > 0.2)
    press(" ")
    browser.wait(lambda: browser.text("play") == "Play")
    stands = place(browser)
    assert 0.2 < stands < recorded.seconds
    press(Keys.ARROW_RIGHT)
    browser.wait(lambda: place(browser) == pytest.approx(min(stands + 1, recorded.seconds), abs=0.05))
    browser.script("const s = document.getElementById('speed'); s.value = '10'; s.dispatchEvent(new Event('change'))")
    press(" ")
    browser.wait(lambda: browser.text("play") == "Play" and place(browser) == pytest.approx(recorded.seconds, abs=0.1))


def test_a_recording_that_is_cut_shows_what_there_is_and_says_so(
    recording: tuple[Path, dict[int, tuple[int, int]]], stage: Any, browser: Any, show: Callable[..., Any]
) -> None:
    path, _ = recording
    whole = Recorded(path).seconds
    os.truncate(path, path.stat().st_size // 2)
    left = Recorded(path)
    show(path, stage.builds["both"], width=400, scheme="dark")
    browser.wait(lambda: "run.mcap is whole up to byte" in browser.text("faults"))
    assert left.seconds < 0.8 * whole
    assert float(browser.script("return document.getElementById('at').max")) == pytest.approx(left.seconds, abs=0.1)
    browser.script(_SEEK, left.seconds)
    browser.wait(lambda: browser.text("grasp") == left.grasps[-1].grasp)
    assert browser.script("return document.documentElement.scrollWidth") <= 400
    assert browser.axe() == []

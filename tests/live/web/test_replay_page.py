"""The page of a recording, in Chromium, of a recording that a run on emulated devices has made."""

import os
from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from thenar.runtime.frames import SwitchFrame, now_us
from thenar.runtime.published import LiveGrasp
from thenar.runtime.recording.reader import Reader
from thenar.runtime.recording.session import Label
from thenar.runtime.web.replay import Replay
from thenar.runtime.web.server import Server

pytestmark = pytest.mark.slow

ROWS = (3, 9, 15, 21)
_SEEK = "location.hash = `t=${arguments[0]}`"


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


@contextmanager
def served(path: Path, *builds: Path, address: str = "127.0.0.1:0") -> Iterator[Server]:
    """Serve the page of a recording, as `thenar monitor` does."""
    with (
        Replay(path, builds) as replay,
        Server("live", address, token=None, on_message=replay.reply) as server,
    ):
        server.publish("replay", replay.about)
        yield server


@pytest.fixture
def show(browser: Any) -> Iterator[Callable[..., Server]]:
    """Return what opens the page of a recording in the browser."""
    with ExitStack() as stack:

        def opened(path: Path, *builds: Path, at: str = "", **how: Any) -> Server:
            server = stack.enter_context(served(path, *builds))
            browser.open(server.url + at, **how)
            browser.wait(lambda: browser.text("scanned") == "" and length(browser) > 0)
            seconds = Recorded(path).seconds
            browser.wait(lambda: length(browser) == pytest.approx(seconds, abs=0.2))
            return server

        yield opened
        browser.driver.get("about:blank")


def slider(browser: Any, what: str) -> str:
    return str(browser.script("return document.getElementById('timeline').getAttribute(arguments[0])", f"aria-{what}"))


def place(browser: Any) -> float:
    return float(slider(browser, "valuenow"))


def length(browser: Any) -> float:
    return float(slider(browser, "valuemax"))


def press(browser: Any, *keys: str) -> None:
    ActionChains(browser.driver).send_keys(*keys).perform()


def test_wherever_the_cursor_stands_the_page_shows_what_was_there(
    recording: tuple[Path, dict[int, tuple[int, int]]], stage: Any, browser: Any, show: Callable[..., Any]
) -> None:
    (path, spans), truth = recording, stage.truth("both")
    recorded = Recorded(path)
    show(path, stage.builds["both"])
    assert length(browser) == pytest.approx(recorded.seconds, abs=0.2)
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
        browser.wait(lambda at=seconds: place(browser) == pytest.approx(at, abs=0.02))
        browser.wait(lambda grasp=found.grasp: browser.texts("#types li[aria-current] .name") == [grasp])
        said = f"truth {found.candidate} · announced {found.grasp}"
        browser.wait(lambda said=said: said in browser.text("place") and said in slider(browser, "valuetext"))
    # A moment of a recording has no age, however long it is looked at.
    clock = "return performance.now()"
    start = browser.script(clock)
    browser.wait(lambda: browser.script(clock) > start + 1000)
    assert browser.text("age") == ""
    assert not browser.script("return document.documentElement.classList.contains('old')")
    assert browser.text("rates").startswith(f"This build recognises {len(ROWS)} of {len(ROWS)} labelled trials, 100 %.")
    assert browser.text("faults") == ""
    assert browser.axe() == []


def test_by_keyboard_it_plays_pauses_zooms_and_goes_to_the_ends(
    recording: tuple[Path, dict[int, tuple[int, int]]], stage: Any, browser: Any, show: Callable[..., Any]
) -> None:
    path, _ = recording
    recorded = Recorded(path)
    show(path, stage.builds["both"])
    press(browser, Keys.END)
    browser.wait(lambda: place(browser) == pytest.approx(recorded.seconds, abs=0.1))
    press(browser, Keys.HOME)
    browser.wait(lambda: place(browser) == 0)
    assert browser.text("play") == "Play"
    press(browser, " ")
    browser.wait(lambda: browser.text("play") == "Pause" and place(browser) > 0.2)
    press(browser, " ")
    browser.wait(lambda: browser.text("play") == "Play")
    # Where it stopped stands in the address.
    browser.wait(lambda: browser.driver.current_url.endswith(f"#t={place(browser):.2f}"))
    stands = place(browser)
    assert 0.2 < stands < recorded.seconds
    for key, by in (
        (Keys.ARROW_RIGHT, 1.0),
        (Keys.ARROW_LEFT, -1.0),
        (".", 0.02),
        (",", -0.02),
        ("l", 10.0),
        ("j", -10.0),
    ):
        expected = min(max(stands + by, 0), recorded.seconds)
        press(browser, key)
        browser.wait(lambda at=expected: place(browser) == pytest.approx(at, abs=0.02))
        stands = place(browser)
    browser.script("const s = document.getElementById('speed'); s.value = '10'; s.dispatchEvent(new Event('change'))")
    press(browser, Keys.HOME, " ")
    browser.wait(lambda: browser.text("play") == "Play" and place(browser) == pytest.approx(recorded.seconds, abs=0.1))
    press(browser, Keys.HOME)
    whole = ticks(browser)
    press(browser, "+", "+", "+")
    browser.wait(lambda: ticks(browser) != whole)
    press(browser, "-", "-", "-")
    browser.wait(lambda: ticks(browser) == whole)


def ticks(browser: Any) -> list[int]:
    """Return the pixels of the axis."""
    return list(
        browser.script(
            """const canvas = document.getElementById('timeline');
            const pen = new OffscreenCanvas(canvas.width, 1).getContext('2d', { willReadFrequently: true });
            pen.drawImage(canvas, 0, 20 - canvas.height);
            const data = pen.getImageData(0, 0, canvas.width, 1).data;
            return [...data].flatMap((value, at) => (at % 4 === 3 && value > 128 ? [at >> 2] : []))"""
        )
    )


def test_it_is_dragged_and_zoomed_by_pointers_and_a_click_puts_the_cursor(
    recording: tuple[Path, dict[int, tuple[int, int]]], stage: Any, browser: Any, show: Callable[..., Any]
) -> None:
    path, _ = recording
    show(path, stage.builds["both"])
    canvas = browser.driver.find_element(By.ID, "timeline")
    wide = canvas.size["width"]

    def click(share: float) -> None:
        offset = round((share - 0.5) * wide)
        ActionChains(browser.driver).move_to_element_with_offset(canvas, offset, 0).click().perform()

    seconds = length(browser)
    click(0.25)
    browser.wait(lambda: place(browser) == pytest.approx(0.25 * seconds, abs=0.02 * seconds))
    # The wheel zooms about the pointer: what is under it stays, and at the edges there is less.
    wheel = ScrollOrigin.from_element(canvas)
    ActionChains(browser.driver).scroll_from_origin(wheel, 0, -350).perform()
    by = 1.002**-350
    click(0.75)
    browser.wait(lambda: place(browser) == pytest.approx((0.5 + 0.25 * by) * seconds, abs=0.03 * seconds))
    # A drag moves it: the middle of the recording to the left edge, and no cursor.
    stands = place(browser)
    ActionChains(browser.driver).move_to_element(canvas).click_and_hold().move_by_offset(
        -wide // 4, 0
    ).release().perform()
    assert place(browser) == stands
    click(0.25)
    browser.wait(lambda: place(browser) == pytest.approx(0.5 * seconds, abs=0.03 * seconds))
    # Two fingers move apart to twice their distance: what is between them has twice the room.
    top = canvas.rect["y"] - browser.script("return scrollY") + 20
    middle = canvas.rect["x"] + wide / 2

    def touch(kind: str, *places: float) -> None:
        points = [{"x": middle + place, "y": top, "id": number} for number, place in enumerate(places)]
        browser.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    click(0.5)
    browser.wait(lambda: place(browser) == pytest.approx((0.5 + 0.25 * by) * seconds, abs=0.03 * seconds))
    before = ticks(browser)
    touch("touchStart", -wide / 8, wide / 8)
    touch("touchMove", -wide / 4, wide / 8)
    touch("touchMove", -wide / 4, wide / 4)
    touch("touchEnd")
    browser.wait(lambda: ticks(browser) != before)
    middle_s = place(browser)
    click(0.75)
    browser.wait(lambda: place(browser) == pytest.approx(middle_s + 0.125 * by * seconds, abs=0.03 * seconds))
    assert browser.axe() == []


def test_a_link_leads_to_its_time_and_two_pages_do_not_move_each_other(
    recording: tuple[Path, dict[int, tuple[int, int]]], stage: Any, browser: Any, show: Callable[..., Any]
) -> None:
    path, _ = recording
    server = show(path, stage.builds["both"], at="#t=0.75")
    browser.wait(lambda: place(browser) == 0.75)
    first = browser.driver.current_window_handle
    browser.driver.switch_to.new_window("window")
    browser.driver.get(server.url + "#t=0.5")
    browser.wait(lambda: browser.text("scanned") == "" and length(browser) > 0.8 and place(browser) == 0.5)
    press(browser, Keys.END, "+")
    browser.wait(lambda: place(browser) > 0.75)
    browser.driver.close()
    browser.driver.switch_to.window(first)
    assert place(browser) == 0.75
    for wrong in ("x", "NaN", "Infinity", "-Infinity"):
        browser.script(_SEEK, wrong)
    assert place(browser) == 0.75
    browser.script(_SEEK, -5)
    browser.wait(lambda: place(browser) == 0)
    browser.script(_SEEK, 1e9)
    browser.wait(lambda: place(browser) == length(browser))


def test_a_server_that_comes_back_finds_the_page_where_it_was(
    recording: tuple[Path, dict[int, tuple[int, int]]], stage: Any, browser: Any
) -> None:
    path, _ = recording
    with served(path, stage.builds["both"]) as server:
        address = server.url.removeprefix("http://").strip("/")
        browser.open(server.url + "#t=0.75")
        seconds = Recorded(path).seconds
        browser.wait(lambda: length(browser) == pytest.approx(seconds, abs=0.2) and place(browser) == 0.75)
        browser.wait(lambda: browser.text("grasp") != "no frame yet")
        before = ticks(browser)
        press(browser, "+")
        browser.wait(lambda: ticks(browser) != before)
        zoomed, shown, whole = ticks(browser), browser.text("grasp"), length(browser)
    browser.wait(lambda: browser.text("link").startswith("page: not connected"))
    assert browser.axe() == []
    with served(path, stage.builds["both"], address=address):
        browser.wait(lambda: browser.text("link").startswith("page: connected"))
        browser.wait(lambda: browser.text("scanned") == "" and browser.text("rates"))
        assert (place(browser), ticks(browser), browser.text("grasp")) == (0.75, zoomed, shown)

        def at_the_end() -> bool:
            press(browser, Keys.END)
            return place(browser) == length(browser) == whole

        browser.wait(at_the_end)  # it is read again
        browser.driver.get("about:blank")
    browser.log()  # of the server that was gone


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
    assert length(browser) == pytest.approx(left.seconds, abs=0.1)
    browser.script(_SEEK, left.seconds)
    browser.wait(lambda: browser.text("grasp") == left.grasps[-1].grasp)
    assert browser.script("return document.documentElement.scrollWidth") <= 400
    assert browser.axe() == []

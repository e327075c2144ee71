"""What the pages say of their own data, in a real browser: nothing old looks new, and only what is read is counted."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any

import pytest
from msgspec.structs import replace

from thenar.runtime.published import LiveGrasp
from thenar.runtime.web.server import Server, message

pytestmark = pytest.mark.slow

HAND = {
    **{"view": "", "placed": False, "radius_mm": 3.0, "outline": [], "strips": [], "creases": [], "labels": []},
    "switches": [{"name": name, "x_mm": 9.0 * bit, "y_mm": 0.0, "bit": bit} for bit, name in enumerate("abc")],
    **{"taxels": [], "joints": []},
}
BUILD = {
    **{"grasps": ["Add", "PoS"], "switches": ["a", "b", "c"], "joints": []},
    **{"preshapes": False, "records": False, "replay": False, "empty_hand": True},
}
SHELL = message("shell", project="bench", build="build 01234567", rate="", wearer="", pages=())
GRASP = LiveGrasp(0, 0, 0, "Add", "Add", 0.95, 9, "ok", 2_000, None, 2_000)
DETAIL = {"closed": "110", "joints": [], "taxels": {}, "probabilities": [0.95, 0.05], "late_us": 0}
_INK = "return getComputedStyle(document.getElementById(arguments[0])).color"


class Run:
    """A page of a run that sends what a test says."""

    def __init__(self, server: Server, browser: Any) -> None:
        self.server, self.browser, self._number = server, browser, 0
        browser.open(server.url)
        browser.wait(lambda: browser.text("link").startswith("page: connected since "))

    def say(self, grasp: LiveGrasp = GRASP, **more: object) -> None:
        """Publish the next moment, 10 ms after the last one."""
        self._number += 1
        now = replace(grasp, time_us=10_000 * self._number, number=self._number)
        self.server.publish("frame", message("frame", now, **(DETAIL | more)))

    def until(self, condition: Callable[[], object], **more: object) -> None:
        """Let the run go on until the page shows something."""

        def shown() -> object:
            self.say(**more)  # type: ignore[arg-type]
            return condition()

        self.browser.wait(shown)

    def health(self, *devices: tuple[str, bool]) -> None:
        told: Sequence[Mapping[str, object]] = [
            {"name": name, "connected": connected, "error": "", "counts": []} for name, connected in devices
        ]
        empty = {"quarantined": ()}
        self.server.publish("health", message("health", empty, switch_hz=0.0, glove_hz=0.0, devices=told))

    @property
    def old(self) -> bool:
        return bool(self.browser.script("return document.documentElement.classList.contains('old')"))


@pytest.fixture
def page(browser: Any) -> Any:
    with ExitStack() as stack:

        def opened(**build: object) -> Run:
            server = stack.enter_context(Server("live", "127.0.0.1:0", token=None))
            server.publish("shell", SHELL)
            server.publish("build", message("build", BUILD | build))
            server.publish("hand", message("hand", HAND))
            return Run(server, browser)

        yield opened
        browser.driver.get("about:blank")


def test_a_run_that_sends_nothing_more_is_grey_and_says_its_age(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    run.until(lambda: (browser.text("grasp"), browser.text("health"), browser.text("age")) == ("Add", "ok", ""))
    browser.wait(lambda: run.old)
    assert browser.text("age").startswith("this is ")
    assert browser.text("age").endswith(" s old")
    browser.wait(lambda: browser.text("health") == "no data")
    assert browser.text("glove-state").startswith("glove: silent since ")
    assert browser.driver.title == "no data · thenar"
    grey = "rgb(104, 112, 122)"
    browser.wait(lambda: browser.script(_INK, "grasp") == grey)
    assert browser.axe() == []
    browser.picture("stopped")
    run.until(lambda: (browser.text("health"), browser.text("age")) == ("ok", ""))
    run.until(lambda: browser.script(_INK, "grasp") != grey)


def test_a_page_without_its_server_says_since_when_there_is_no_data(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    run.until(lambda: browser.text("grasp") == "Add" and browser.text("build-state") == "build: build 01234567")
    run.server.close()
    browser.wait(lambda: browser.text("age").startswith("no data since "))
    assert run.old
    assert browser.text("link").startswith("page: not connected since ")
    assert browser.text("glove-state") == "glove: not known"
    browser.wait(lambda: browser.text("health") == "no data")
    browser.log()  # of the server that is gone


def test_a_slow_source_is_old_after_three_of_its_periods(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    for number, age_s in enumerate((90, 90, 90, 290, 310)):
        # The source has a period of 100 s.
        age_us = 1_000_000 * age_s
        now = replace(GRASP, time_us=100_000_000 * number + age_us, number=number, switch_age_us=age_us)
        closed = ("100", "110")[number % 2]
        run.server.publish("frame", message("frame", now, **(DETAIL | {"closed": closed})))
        said = f"{closed.count('1')} of 3 switches closed"
        browser.wait(lambda said=said: browser.text("hand-says").startswith(said))
        # Before the second moment, the period is not known.
        assert run.old == (number == 0 or age_s > 300)


def test_lost_devices_are_named_and_only_readable_switches_counted(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    run.health(("glove", True), ("stream", True))
    connected = ("glove: connected", "2 of 3 switches closed: a, b")
    run.until(lambda: (browser.text("glove-state"), browser.text("hand-says")) == connected)
    run.health(("glove", True), ("stream", False))
    lost = replace(GRASP, grasp="unknown", candidate="unknown", health="unknown", lost=("a", "b", "c"))
    run.until(lambda: browser.text("hand-says") == "0 of 0 readable switches closed; 3 lost", grasp=lost)
    browser.wait(lambda: browser.text("glove-state").startswith("glove: stream lost since "))
    part = replace(GRASP, health="degraded", lost=("a",))
    run.until(lambda: browser.text("hand-says") == "1 of 2 readable switches closed; 1 lost: b", grasp=part)
    # Both are silent: moments go on, but what they rest on is old.
    silent = replace(lost, switch_age_us=3_000_000, glove_age_us=2_000_000)
    run.until(lambda: run.old and browser.text("age").startswith("this is 2."), grasp=silent)
    browser.picture("lost")


def test_a_build_without_an_empty_hand_says_so_beside_the_grasp(page: Callable[..., Run], browser: Any) -> None:
    shown = "return document.getElementById('empty-hand').checkVisibility()"
    for known in (True, False):
        run = page(empty_hand=known)
        run.until(lambda: browser.text("grasp") == "Add")
        assert browser.script(shown) is not known
    browser.picture("empty-hand")


def test_bars_and_numbers_are_of_one_frame(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    pairs = """return [...document.querySelectorAll('#types li')].map((row) => [
        row.querySelector('.share').textContent, row.querySelector('.bar span').style.transform])"""
    for step in range(200):
        share = step / 200
        run.say(probabilities=[share, 1 - share])
        for words, bar in browser.script(pairs):
            assert words in ("", "–") or abs(float(words[:-2]) / 100 - float(bar[7:-1])) < 0.002


def test_a_past_that_ends_a_little_after_the_moment_is_kept(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    seconds = [(1_000_000 * number, number, ("Add", "PoS")[number % 2]) for number in range(1, 6)]
    changes = [(time_us, "Add", "Add", "ok", "held", number, kind, time_us) for time_us, number, kind in seconds]
    run.server.publish("past", message("past", changes=changes, until_us=5_001_000))
    now = replace(GRASP, time_us=4_990_000, state="held", segment=4, segment_type="Add", segment_us=4_000_000)
    run.server.publish("frame", message("frame", now, **DETAIL))
    browser.wait(lambda: len(browser.texts("#segments li")) == 5)


def test_a_recordings_wrong_predictions_are_marked_by_sign_and_words(browser: Any) -> None:
    state = {"first_us": 0, "last_us": 9_000_000, "playing": False, "speed": 1.0, "share": 1.0, "faults": []}
    predictions = [(0, "none"), (1_000_000, "Add"), (2_000_000, "unknown"), (5_000_000, "PoS")]
    truth = [(500_000, 3_000_000, "Add"), (4_000_000, 8_000_000, "Add")]
    with Server("live", "127.0.0.1:0", token=None) as server:
        server.publish("build", message("build", BUILD | {"replay": True}))
        server.publish("overview", message("overview", predictions=predictions, truth=truth))
        browser.open(server.url)
        for grasp, label, said in (
            ("Add", "Add", "Truth: Add"),
            ("PoS", "Add", "✗ Truth: Add, predicted: PoS"),
            ("unknown", "Add", "Truth: Add"),
            ("PoS", None, "Truth: no label"),
        ):
            server.publish("frame", message("frame", replace(GRASP, grasp=grasp), **DETAIL))
            server.publish("replay", message("replay", state, at_us=6_000_000, truth=label))
            browser.wait(lambda said=said: browser.text("truth") == said)
            sign = "return getComputedStyle(document.getElementById('grasp'), '::after').content"
            assert ("✗" in browser.script(sign)) == said.startswith("✗")
            if said.startswith("✗"):
                browser.wait(lambda: browser.text("grasp") == "PoS")
                browser.picture("wrong")
        # Of the first label half a second of none, of the second all of PoS.
        whole = browser.script("return document.getElementById('whole').getAttribute('aria-label')")
        assert whole.endswith("2 labelled spans, 4 predictions, wrong in 2 spans")
        browser.driver.get("about:blank")

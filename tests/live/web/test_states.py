"""What the pages say of their own data, in a real browser: nothing old looks new, and only what is read is counted."""

from collections.abc import Callable
from contextlib import ExitStack
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from msgspec import to_builtins
from msgspec.structs import replace
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from thenar.runtime.published import LiveGrasp
from thenar.runtime.web.live import change_of
from thenar.runtime.web.server import Server, message

pytestmark = pytest.mark.slow

HAND = {
    **{"view": "", "placed": False, "radius_mm": 3.0, "outline": [], "strips": [], "creases": [], "labels": []},
    "switches": [{"name": name, "x_mm": 9.0 * bit, "y_mm": 0.0, "bit": bit} for bit, name in enumerate("abc")],
    **{"taxels": [], "joints": []},
}
BUILD = {
    **{"name": "build", "grasps": ["Add", "PoS"], "switches": ["a", "b", "c"], "joints": []},
    **{"preshapes": False, "empty_hand": True, "silent_us": 500_000, "hand": HAND},
}
SHELL = message("shell", project="bench", build="build 01234567", rate="", wearer="", pages=())
GRASP = LiveGrasp(0, 0, 0, "Add", "Add", 0.95, 9, "ok", 2_000, None, 2_000)
DETAIL = {"closed": "110", "joints": [], "taxels": {}, "probabilities": [0.95, 0.05], "late_us": 0}


def told(grasp: LiveGrasp, **more: object) -> dict[str, object]:
    """Return what a page is told of a moment, on a clock that began in 1970."""
    return {**to_builtins(grasp), "change": change_of(grasp, 0), **(DETAIL | more)}


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
        self.server.publish("frame", message("frame", told(now, **more)))

    def until(self, condition: Callable[[], object], **more: object) -> None:
        """Let the run go on until the page shows something."""

        def shown() -> object:
            self.say(**more)  # type: ignore[arg-type]
            return condition()

        self.browser.wait(shown)

    def glove(self, level: str, words: str, lasts_s: float | None = None) -> None:
        self.server.publish("glove", message("glove", {"is": level}, words=words, lasts_s=lasts_s))

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
    assert browser.driver.title == "no data · thenar"
    grey = "rgb(104, 112, 122)"
    browser.wait(lambda: browser.script(_INK, "grasp") == grey)
    assert browser.axe() == []
    browser.picture("stopped")
    run.until(lambda: (browser.text("health"), browser.text("age")) == ("ok", ""))
    run.until(lambda: browser.script(_INK, "grasp") != grey)


def test_a_page_without_its_server_says_since_when_there_is_no_data(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    run.glove("good", "connected")
    said = ("Add", "build: build 01234567", "glove: connected")
    run.until(lambda: tuple(map(browser.text, ("grasp", "build-state", "glove-state"))) == said)
    run.server.close()
    browser.wait(lambda: browser.text("age").startswith("no data since "))
    assert run.old
    assert browser.text("link").startswith("page: not connected since ")
    assert browser.text("glove-state") == "glove: not known"
    browser.wait(lambda: browser.text("health") == "no data")
    browser.log()  # of the server that is gone


def test_a_page_asks_a_server_that_is_gone_less_and_less_often(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    browser.script("""const Real = WebSocket;
        window.asked = [];
        window.WebSocket = class extends Real {
          constructor(address) {
            asked.push([performance.now(), String(address)]);
            super(address);
          }
        };""")
    run.server.close()
    browser.wait(lambda: browser.script("return asked.length") >= 4)
    asked = browser.script("return asked")
    gaps = [later - earlier for (earlier, _), (later, _) in pairwise(asked)]
    assert all(gap >= least - 2 for gap, least in zip(gaps, (500, 1000, 2000), strict=False))
    # Browsers of some years ago take no others.
    assert all(address.startswith("ws://127.0.0.1:") for _, address in asked)
    browser.log()  # of the server that is gone


# A drawing of switches of 1 mm, so many millimetres apart, on a small screen: where each can be pressed.
_AREAS = """const [apart, done] = arguments;
    import("/hand.js").then(({ drawHand, draw }) => {
      const svg = draw("svg"), hand = { view: "", placed: true, radius_mm: 1, strips: [], creases: [], labels: [] };
      svg.style.width = "240px";
      document.body.append(svg);
      const switches = [0, 1, 2].map((bit) => ({ name: `s${bit}`, x_mm: apart * bit, y_mm: 0, bit }));
      const outline = [[-100, 0], [100, 0], [0, 100]];
      drawHand(svg, { ...hand, outline, switches, taxels: [], joints: [] }, { onSwitch: () => {} });
      const areas = [...svg.querySelectorAll(".area")].map((area) => area.getBoundingClientRect());
      done(areas.map(({ left, right }) => [left, right]));
      svg.remove();
    });"""


@pytest.mark.parametrize(("apart", "least"), [(45, 24), (12, 11)])
def test_a_finger_presses_a_switch_on_a_small_screen(
    page: Callable[..., Run], browser: Any, apart: int, least: int
) -> None:
    page()
    areas = browser.driver.execute_async_script(_AREAS, apart)
    assert len(areas) == 3
    assert all(right - left > least - 0.5 for left, right in areas)
    # None is on another.
    assert all(right <= left + 0.5 for (_, right), (left, _) in pairwise(areas))


def test_a_slow_source_is_old_after_three_of_its_periods(page: Callable[..., Run], browser: Any) -> None:
    run = page(silent_us=300_000_000)
    for number, age_s in enumerate((90, 90, 90, 290, 310)):
        age_us = 1_000_000 * age_s
        now = replace(GRASP, time_us=100_000_000 * number + age_us, number=number, switch_age_us=age_us)
        closed = ("100", "110")[number % 2]
        run.server.publish("frame", message("frame", told(now, closed=closed)))
        said = f"{closed.count('1')} of 3 switches closed"
        browser.wait(lambda said=said: browser.text("hand-says").startswith(said))
        assert run.old == (age_s > 300)


def test_only_readable_switches_are_counted(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    run.until(lambda: browser.text("hand-says") == "2 of 3 switches closed: a, b")
    # The drawing is named by them.
    assert browser.driver.find_element("id", "hand").accessible_name == "Hand 2 of 3 switches closed: a, b"
    lost = replace(GRASP, grasp="unknown", candidate="unknown", health="unknown", lost=("a", "b", "c"))
    run.until(lambda: browser.text("hand-says") == "0 of 0 readable switches closed; 3 lost", grasp=lost)
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
        row.querySelector('.share').textContent, row.querySelector('progress').value])"""
    for step in range(200):
        share = step / 200
        run.say(probabilities=[share, 1 - share])
        for words, bar in browser.script(pairs):
            assert words in ("", "–") or abs(float(words[:-2]) / 100 - bar) < 0.002


def test_the_gloves_state_stands_in_the_bar_until_it_is_old(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    shown = "return document.getElementById('glove-state').checkVisibility()"
    assert not browser.script(shown)
    for level, words in (("good", "connected"), ("bad", "stream lost since 10:24:07"), ("warn", "not in use")):
        run.glove(level, words)
        browser.wait(lambda words=words: browser.text("glove-state") == f"glove: {words}")
        assert browser.script("return document.getElementById('glove-state').dataset.is") == level
        assert browser.script(shown)
    run.glove("good", "connected", lasts_s=0.2)
    browser.wait(lambda: browser.text("glove-state").startswith("glove: silent since "))
    run.glove("good", "connected", lasts_s=3)
    browser.wait(lambda: browser.text("glove-state") == "glove: connected")


def test_a_past_that_ends_a_little_after_the_moment_is_kept(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    changes = [(10**6 * number, ("Add", "PoS")[number % 2], "", "Add", 10**6 * number) for number in range(1, 6)]
    run.server.publish("past", message("past", changes=changes, until_us=5_001_000))
    now = replace(GRASP, time_us=4_990_000, state="held", segment=4, segment_type="Add", segment_us=4_000_000)
    run.server.publish("frame", message("frame", told(now)))
    now = replace(now, time_us=5_002_000, segment_us=5_000_000)
    run.server.publish("frame", message("frame", told(now)))
    browser.wait(lambda: "announced Add" in browser.text("place"))
    said = list[str]()
    for _ in range(4):
        press(browser, Keys.ARROW_LEFT)
        said.append(browser.text("place"))
    kinds = ["Add", "PoS", "Add", "PoS"]
    browser.wait(lambda: f"announced {kinds[-1]}" in browser.text("place"))
    assert "segment Add, 1.0 s" in browser.text("place")


def test_a_new_build_and_a_new_server_go_on_with_the_past(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    run.until(lambda: browser.text("grasp") == "Add" and browser.text("place").startswith("now"))
    assert browser.text("news") == ""
    run.server.publish("build", message("build", BUILD | {"name": "build-2", "grasps": ["PoS", "Tip"]}))
    browser.wait(lambda: browser.text("news") == "The run goes on with build-2, before it was build.")
    other = replace(GRASP, grasp="PoS", candidate="PoS")
    run.until(lambda: browser.text("grasp") == "PoS" and browser.texts("#types .name") == ["PoS", "Tip"], grasp=other)
    assert browser.axe() == []
    # Another server, of which the past begins later.
    address = run.server.url.removeprefix("http://").strip("/")
    run.server.close()
    browser.wait(lambda: browser.text("age").startswith("no data since "))
    with Server("live", address, token=None) as server:
        server.publish("past", message("past", changes=[(10**8, "Tip", "", "", None)], until_us=10**8))
        run.server, run._number = server, 10_000
        run.until(lambda: browser.text("link").startswith("page: connected") and browser.text("age") == "")
        browser.wait(lambda: browser.text("place").startswith("now"))
        press(browser, Keys.HOME)
        browser.wait(lambda: "announced Add" in browser.text("place"))
        browser.driver.get("about:blank")
    browser.log()  # of the server that is gone


# The numbers of spans, and the seconds that they reach back, after so many changes of which each lasts for so long.
_KEPT = """const [count, us, done] = arguments;
    import("/timeline.js").then(({ Timeline }) => {
      const timeline = new Timeline(document.createElement("canvas"), { moved() {}, toggle() {} });
      for (let at = 0; at < count; at++) {
        const [grasp, health, began] = at % 2 ? ["Add", "degraded", at * us] : ["PoS", "", null];
        timeline.follow([[at * us, grasp, health, began === null ? "" : "Add", began]], at * us);
      }
      const [{ announced, health, segments }] = timeline.tracks;
      done([announced.length, health.length, segments.length, (timeline.last - announced[0].from) / 1e6]);
    });"""


# Where the spans of a type begin and end on a page that lost the server during a silence, and got the past later.
_SILENT = """const [done] = arguments;
    import("/timeline.js").then(({ Timeline }) => {
      const timeline = new Timeline(document.createElement("canvas"), { moved() {}, toggle() {} });
      const at = (time, grasp) => [time, grasp, "", "", null];
      for (const time of [0, 100_000]) timeline.follow([at(time, "Add")], time);
      timeline.follow([at(0, "Add"), at(100_000, ""), at(5_000_000, "Add")], 5_000_000);
      done(timeline.tracks[0].announced.map(({ from, to }) => [from, to === Infinity ? null : to]));
    });"""


def test_a_silence_that_a_page_missed_is_empty(page: Callable[..., Run], browser: Any) -> None:
    page()
    assert browser.driver.execute_async_script(_SILENT) == [[0, 100_000], [5_000_000, None]]


def test_the_past_that_a_page_keeps_is_bounded(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    *counts, seconds = browser.driver.execute_async_script(_KEPT, 60_000, 100_000)
    assert counts == pytest.approx([12_000, 6_000, 6_000], abs=3)
    assert seconds == pytest.approx(1200, abs=1)
    # However often it changes.
    *counts, seconds = browser.driver.execute_async_script(_KEPT, 60_000, 10_000)
    assert counts == [20_000, 20_000, 20_000]
    run.until(lambda: browser.text("grasp") == "Add")


# The frames in which three painters ran: one at any time, one once, and one every 50 ms.
_PACED = """const [done] = arguments;
    import("/wire.js").then(async ({ paced }) => {
      const seen = { often: [], once: [], again: [] }, frame = () => new Promise(requestAnimationFrame);
      const painter = (name) => () => seen[name].push(document.timeline.currentTime);
      const often = paced(painter("often")), once = paced(painter("once"), 1e9), again = paced(painter("again"), 50);
      for (let call = 0; call < 5; call++) {
        for (const ask of [often, once, again, often, once]) ask();
        await frame();
      }
      const [start] = seen.again, last = seen.again.length;
      again();
      while (seen.again.length === last) await frame();
      once(true);
      await frame();
      done([seen, start]);
    });"""


def test_what_is_painted_at_one_time_is_painted_in_one_frame(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    seen, start = browser.driver.execute_async_script(_PACED)
    assert len(set(seen["often"])) == len(seen["often"]) == 5
    assert seen["often"][0] == seen["once"][0] == start
    # The last call counts, however soon it came; and what is asked for at once is not put off.
    assert len(seen["once"]) == 2
    run.until(lambda: browser.text("grasp") == "Add")


# Whether the lanes are drawn in the next frame of the screen after each of two announced types.
_LANES = """const [done] = arguments;
    import("/timeline.js").then(async ({ Timeline }) => {
      const canvas = document.getElementById("timeline"), drawn = [];
      const lanes = new Timeline(canvas, {}), pen = canvas.getContext("2d");
      lanes.begin({ grasps: ["Add", "PoS"], silent_us: 500_000 });
      pen.fillText = () => { drawn[drawn.length - 1] = true; };
      for (const [us, name] of [[1_000_000, "Add"], [1_010_000, "PoS"]]) {
        drawn.push(false);
        lanes.follow([[us, name, "", "", null]], us);
        await new Promise(requestAnimationFrame);
      }
      done(drawn);
    });"""


def test_an_announced_type_is_on_its_lane_at_once(page: Callable[..., Run], browser: Any) -> None:
    run = page()
    run.until(lambda: browser.text("grasp") == "Add")
    assert browser.driver.execute_async_script(_LANES) == [True, True]


_WITHIN = """const [lane, spans, done] = arguments;
    import("/timeline.js").then(({ within }) => done(spans.map(([from, to]) => within(lane, from, to))));"""


def test_parts_of_a_lane_are_those_of_a_search_of_all_spans(page: Callable[..., Run], browser: Any) -> None:
    rng = np.random.default_rng(7)
    run = page()
    run.until(lambda: browser.text("grasp") == "Add")
    times = np.unique(rng.integers(0, 60, 30)).tolist()
    lane = [{"from": start, "to": end, "name": f"{start}"} for start, end in pairwise(times) if rng.random() < 0.7]
    spans = [
        [start, start + wide]
        for start, wide in zip(rng.integers(-5, 65, 300).tolist(), rng.integers(1, 30, 300).tolist(), strict=True)
    ]
    found = browser.driver.execute_async_script(_WITHIN, lane, spans)
    for (first, last), parts in zip(spans, found, strict=True):
        clipped = [{**one, "from": max(one["from"], first), "to": min(one["to"], last)} for one in lane]
        assert parts == [one for one in clipped if one["from"] < one["to"]]


def recording(predictions: list[Any], others: list[Any], truth: list[Any]) -> dict[str, Any]:
    """Return what an overview says of two builds."""
    changes = [[(time_us, grasp, "", "", None) for time_us, grasp in some] for some in (predictions, others)]
    more = {"first_us": 0, "last_us": 9_000_000, "share": 1.0, "faults": []}
    return {"have": [0, 0, 0], "changes": changes, "truth": truth, **more}


def test_a_wrong_prediction_is_wrong_in_all_places(browser: Any) -> None:
    first = [(0, "none"), (1_000_000, "Add"), (2_000_000, "unknown"), (2_500_000, "Add"), (5_000_000, "PoS")]
    second = [(0, "none"), (600_000, "Add"), (2_000_000, "PoS"), (2_200_000, "Add")]
    truth = [(1, 500_000, 3_000_000, "Add"), (2, 4_000_000, 8_000_000, "Add"), (3, 8_500_000, 9_000_000, "PoS")]
    overview = recording(first, second, [*truth, (4, 8_100_000, 8_200_000, "Add"), (4, 0, 0, "")])
    about = BUILD | {"builds": ["old", "new"], "silent_us": None}

    def reply(asked: Any) -> bytes:
        if asked["do"] == "overview":
            if asked["numbers"] == [0, 0, 0]:
                return message("overview", overview)
            return message("overview", overview | {"have": asked["numbers"], "changes": [[], []], "truth": []})
        (second,) = asked["numbers"]
        shown = [told(replace(GRASP, grasp=grasp, time_us=time_us)) for time_us, grasp in first]
        before = [one for one in shown if one["time_us"] < 10**6 * (second + 1)]
        return message("moments", second=second, frames=before)

    with Server("live", "127.0.0.1:0", token=None, on_message=reply) as server:
        server.publish("replay", message("replay", about))
        browser.open(server.url)
        for seconds, grasp, said, other in (
            (1.5, "Add", "Truth: Add", "new: Add"),
            (2.1, "unknown", "Truth: Add", "✗ new: PoS"),
            (3.5, "Add", "Truth: no label", "new: Add"),
            (6.0, "PoS", "✗ Truth: Add, announced: PoS", "new: Add"),
            (8.15, "PoS", "Truth: no label", "new: Add"),
        ):
            browser.script("location.hash = `t=${arguments[0]}`", seconds)
            texts = (grasp, said, other)
            browser.wait(lambda texts=texts: tuple(map(browser.text, ("grasp", "truth", "other"))) == texts)
            browser.wait(lambda told=other: told.replace(": ", " announced ") in browser.text("place").split(" · "))
            wrong = said.startswith("✗")
            sign = "return getComputedStyle(document.getElementById('grasp'), '::after').content"
            assert ("✗" in browser.script(sign)) == wrong
            place = f"0:0{seconds:.2f} of 0:09.0 · "
            browser.wait(lambda place=place: browser.text("place").startswith(place))
            assert ("✗ old announced" in browser.text("place")) == wrong
            assert browser.axe() == []
            if wrong:
                browser.picture("wrong")
        # The trial of which the label was revoked counts nowhere.
        rates = [f"{name} recognises 2 of 3 labelled trials, 67 %." for name in ("old", "new")]
        rates += [
            "Of them 1 by old alone, 1 by new alone.",
            "A trial is recognised if its type was announced for longest.",
        ]
        assert browser.text("rates") == " ".join(rates)
        # Errors follow each other; what comes before the first right one is none.
        press(browser, Keys.HOME)
        for at in ("2.00", "5.00", "8.50"):
            press(browser, "n")
            browser.wait(lambda at=at: browser.text("place").startswith(f"0:0{at} of 0:09.0"))
        browser.click("last-error")
        browser.wait(lambda: browser.text("place").startswith("0:05.00"))
        red = browser.script(_RED)
        assert [pytest.approx(share, abs=0.02) for share in red] == [(8.0 - 5.0) / 9, 0.2 / 9 + 0.5 / 9]
        browser.driver.get("about:blank")


# The share of each lane of errors that is red at its top.
_RED = """const canvas = document.getElementById('timeline');
    const pen = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d', { willReadFrequently: true });
    pen.drawImage(canvas, 0, 0);
    return [2, 4].map((lane) => {
      const data = pen.getImageData(0, lane * 44 + 21, canvas.width, 1).data;
      let red = 0;
      for (let at = 0; at < data.length; at += 4) red += data[at] > 150 && data[at + 1] < 80;
      return red / canvas.width;
    });"""


def press(browser: Any, *keys: str) -> None:
    ActionChains(browser.driver).send_keys(*keys).perform()

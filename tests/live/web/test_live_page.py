"""The live page in a real browser: what it shows is what was published, and what is pressed happens."""

from collections.abc import Callable
from typing import Any

import pytest
from selenium.webdriver.common.action_chains import ActionChains

from thenar.runtime.web.server import Server, message

pytestmark = pytest.mark.slow

_BARS = """return Object.fromEntries([...document.querySelectorAll('#types li')].map((row) =>
    [row.querySelector('.name').textContent, row.querySelector('.share').textContent]))"""
_CLOSED = "return document.querySelectorAll('#hand .spot.closed').length"
_LOST = "return document.querySelectorAll('#hand .spot.lost').length"


def shown(browser: Any, scene: Any, row: int) -> str:
    """Show a row on the devices, and wait until the page shows what was settled on, which is returned, and the switches
    of that row.
    """
    scene.show(row)
    answer: str = scene.settled(row).grasp
    closed = int(scene.truth.bits[row].sum())
    browser.wait(lambda: browser.text("grasp") == answer and browser.script(_CLOSED) == closed)
    browser.wait(lambda: browser.texts("#types li[aria-current] .name") == [answer])
    return answer


def test_the_page_shows_what_is_published(run: Callable[[], Any], browser: Any) -> None:
    running = run()
    scene, truth = running.scene, running.scene.truth
    browser.open(running.page.server.url)
    answers = set()
    for row in range(0, len(truth.performance), 3):
        answer = shown(browser, scene, row)
        answers.add(answer)
        names = [name for name, bit in zip(truth.switch_names, truth.bits[row], strict=True) if bit]
        said = f"{len(names)} of {len(truth.switch_names)} switches closed" + f": {', '.join(names[:8])}" * bool(names)
        browser.wait(lambda said=said: browser.text("hand-says").startswith(said))
        browser.wait(lambda: bars_are(browser, scene))
        browser.wait(lambda answer=answer: browser.driver.title == f"{answer} · thenar")
    assert len(answers) > 5
    assert browser.texts("#types .name") == list(truth.build.manifest.classes)
    browser.wait(lambda: browser.text("health") == "ok" and browser.text("age") == "")
    browser.wait(lambda: browser.text("glove-state") == "glove: connected")
    browser.wait(lambda: browser.texts("#devices td:nth-child(2)") == ["connected", "connected"])
    browser.wait(lambda: browser.texts("#wrong li") == ["nothing"])


def test_a_stopped_run_is_old_for_later_pages_too(run: Callable[[], Any], browser: Any) -> None:
    running = run()
    browser.open(running.page.server.url)
    answer = shown(browser, running.scene, 0)
    running.end()
    browser.wait(lambda: browser.text("age").startswith("this is "))
    assert browser.text("grasp") == answer
    age = float(browser.text("age").split()[2])
    browser.open(running.page.server.url)
    browser.wait(lambda: browser.text("grasp") == answer and browser.text("age").startswith("this is "))
    assert float(browser.text("age").split()[2]) >= age
    browser.wait(lambda: browser.text("glove-state").startswith("glove: silent since "))
    assert browser.text("link").startswith("page: connected since ")
    manifest = running.glove.system.build.manifest
    stated = browser.text("build-state")
    assert stated.startswith(f"build: both {manifest.checksum[:8]}, {100 * manifest.rates[0].rate:.1f}")
    assert stated.endswith(f" % {manifest.rates[0].title}")


def press(browser: Any, *keys: str) -> None:
    ActionChains(browser.driver).send_keys(*keys).perform()


def bars_are(browser: Any, scene: Any) -> bool:
    """Return whether the bars show the probabilities of the row that is on the devices now, by the build itself."""
    truth, row = scene.truth, scene.shown[-1].row
    found = truth.build.recognise(truth.bits[row], truth.codes[row])
    share: str = browser.script(_BARS)[found.grasp]
    # While too little is read, there is none.
    return share.endswith(" %") and abs(float(share.removesuffix(" %")) - 100 * found.probability) < 0.11


def test_the_posed_hand_follows_the_joints(run: Callable[[], Any], browser: Any) -> None:
    running = run()
    browser.open(running.page.server.url)
    bones = "return [...document.querySelectorAll('#hand .bone')].map((bone) => bone.getAttribute('points'))"
    shown(browser, running.scene, 0)
    before = browser.script(bones)
    assert len(before) == 5
    shown(browser, running.scene, 5)
    browser.wait(lambda: sum(one != other for one, other in zip(before, browser.script(bones), strict=True)) >= 3)


def test_what_is_lost_is_named_and_crossed_out(run: Callable[[], Any], browser: Any) -> None:
    running = run()
    names = running.scene.truth.switch_names
    browser.open(running.page.server.url)
    shown(browser, running.scene, 0)
    browser.wait(lambda: browser.script(_LOST) == 0)
    board = running.bench.lines[1]
    board.unplug()
    browser.wait(lambda: browser.text("health") == "degraded")
    browser.wait(lambda: browser.texts("#wrong li") == [f"{name}: lost" for name in names])
    browser.wait(lambda: browser.script(_LOST) == len(names))
    browser.wait(lambda: browser.text("hand-says") == f"0 of 0 readable switches closed; {len(names)} lost")
    browser.wait(lambda: " lost since " in browser.text("glove-state"))
    browser.wait(lambda: any("there is no such port" in text for text in browser.texts("#devices td:nth-child(2)")))
    board.replug()
    browser.wait(lambda: browser.text("health") == "ok" and browser.script(_LOST) == 0)
    browser.wait(
        lambda: browser.texts("#wrong li") == ["nothing"] and browser.text("glove-state") == "glove: connected"
    )


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1400, 400])
def test_the_page_fits_every_scheme_and_width_without_axe_faults(
    run: Callable[[], Any], browser: Any, scheme: str, width: int
) -> None:
    running = run()
    browser.open(running.page.server.url, width=width, scheme=scheme)
    shown(browser, running.scene, 0)
    browser.wait(lambda: browser.texts("#devices tr"))
    assert browser.script("return document.documentElement.scrollWidth") <= width
    background = browser.script("return getComputedStyle(document.body).backgroundColor")
    assert (background == "rgb(255, 255, 255)") == (scheme == "light")
    # Some 15 mm at 96 pixels an inch: what can be read from three metres.
    letters = browser.script("return parseFloat(getComputedStyle(document.getElementById('grasp')).fontSize)")
    assert letters >= 80
    assert browser.axe() == []


def test_a_screen_reader_is_told_what_stands_and_not_flooded(run: Callable[[], Any], browser: Any) -> None:
    running = run()
    browser.open(running.page.server.url)
    answer = shown(browser, running.scene, 0)
    browser.wait(lambda: browser.text("spoken") == answer)
    browser.script(
        "window.said = 0; new MutationObserver(() => window.said++)"
        ".observe(document.getElementById('spoken'), {childList: true, characterData: true, subtree: true})"
    )
    rows = [row for row in range(1, 25) if running.scene.truth.answer(row) != running.scene.truth.answer(row - 1)]
    for row in rows:
        answer = shown(browser, running.scene, row)
    said = browser.script("return window.said")
    assert said < len(rows) / 2
    browser.wait(lambda: browser.text("spoken") == answer)
    live = browser.script(
        "return [...document.querySelectorAll('[aria-live], [role=status], [role=log]')].map((e) => e.id)"
    )
    assert live == ["spoken"]


def test_a_page_that_comes_late_sees_what_was(run: Callable[[], Any], browser: Any) -> None:
    running = run()
    for row in (0, 5, 11):
        running.scene.show(row)
        running.scene.settled(row)
    browser.open(running.page.server.url)
    types = [running.scene.truth.answer(row) for row in (0, 5, 11)]
    browser.wait(lambda: f"announced {types[-1]}" in browser.text("place"))
    # It stops where it is dragged back to, and follows again.
    seen, now = list[str](), "return document.getElementById('timeline').getAttribute('aria-valuenow')"
    press(browser, ",")
    browser.wait(lambda: " ago · " in browser.text("place"))
    while (before := browser.script(now)) != "0.00":
        seen.append(browser.text("place"))
        press(browser, *",,,")
        browser.wait(lambda before=before: browser.script(now) != before)
    assert [kind for kind in types if any(f"announced {kind}" in words for words in seen)] == types
    assert browser.text("grasp") == types[-1]
    assert browser.axe() == []
    browser.click("now")
    browser.wait(lambda: browser.text("place").startswith("now · "))
    assert not browser.script("return document.getElementById('now').checkVisibility()")


def test_closing_all_pages_changes_nothing(run: Callable[[], Any], browser: Any) -> None:
    running = run()
    browser.open(running.page.server.url)
    shown(browser, running.scene, 0)
    browser.driver.get("about:blank")
    browser.wait(lambda: running.page.server.pages == 0)
    for row in (5, 11, 17):
        running.scene.show(row)
        running.scene.settled(row)
    assert running.scene.check() > 0


SCRIPT = "<script>alert(1)</script>"


def test_names_are_text_wherever_they_are_shown(browser: Any) -> None:
    """A grasp type, a switch, a device, a folder and a preshape that are called like scripts."""
    image = "<img src=x onerror=alert(1)>"
    hand = {
        **{"view": "", "placed": False, "radius_mm": 3.0, "outline": [], "strips": [], "creases": [], "labels": []},
        "switches": [{"name": image, "x_mm": 0.0, "y_mm": 0.0, "bit": 0}],
        **{"taxels": [], "joints": []},
    }
    build = {
        "name": image,
        "grasps": [SCRIPT, image],
        "switches": [image],
        "joints": [],
        "preshapes": True,
        "silent_us": 500_000,
        "hand": hand,
    }
    frame = {
        **{
            "time_us": 1_000_000,
            "unix_us": 10**15,
            "number": 1,
            "grasp": SCRIPT,
            "candidate": SCRIPT,
            "probability": 1.0,
            "margin": 1,
        },
        **{"health": "degraded", "switch_age_us": 1, "glove_age_us": None, "latency_us": 1, "lost": [image]},
        **{"state": "held", "segment": 1, "segment_type": SCRIPT, "segment_us": 0, "preshape": image},
        **{"closed": "1", "joints": [], "taxels": {}, "probabilities": [1.0, 0.0], "late_us": 0},
        "change": [10**15, SCRIPT, "degraded", SCRIPT, 10**15 - 1_000_000],
    }
    report = {
        **{
            "switch_hz": 1.0,
            "glove_hz": 0.0,
        },
        "devices": [{"name": image, "connected": False, "error": SCRIPT, "counts": [{"name": image, "value": 1}]}],
        "quarantined": [{"name": SCRIPT, "reason": image, "used": False}],
    }
    with Server("live", "127.0.0.1:0", token=None) as server:
        server.publish("shell", message("shell", project=image, build=SCRIPT, rate=image, wearer=SCRIPT, pages=()))
        server.publish("build", message("build", build))
        server.publish("frame", message("frame", frame))
        server.publish("health", message("health", report))
        browser.open(server.url)
        browser.wait(lambda: browser.text("grasp") == SCRIPT and browser.texts("#wrong li"))
        assert browser.texts("#types .name") == [SCRIPT, image]
        browser.wait(lambda: browser.text("segment") and f"announced {SCRIPT}" in browser.text("place"))
        assert browser.text("preshape") == f"Preshape: {image}"
        assert browser.texts("#devices th, #devices td") == [image, f"lost: {SCRIPT}", f"{image} 1"]
        assert browser.text("name") == image
        assert browser.script("return [document.scripts.length, document.images.length]") == [1, 0]
        assert browser.driver.title == f"{SCRIPT} · thenar"
        browser.driver.get("about:blank")

"""The page *Choose*, in Chromium as a person uses it, and through its WebSocket as an attacker does."""

import json
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from websockets.sync.client import connect
from websockets.typing import Origin

from thenar.compiler.artifact.sensor_study import study_sensors
from thenar.compiler.placement.constraints import Limits
from thenar.compiler.recordings.graspset import GraspSet
from thenar.runtime import Build
from thenar.runtime.recipe import Recipe
from thenar.studio import Studio

from ..browser import Browser
from ..sets import grasp_set_of

Start = Callable[..., Studio]
PATIENCE_S = 30
PRICES = '[[part]]\nname = "plain"\nprice = 2.5\nsensors = ["*"]\n'


def answers(opened: Studio, *asked: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what a page is told of its set and its sensors and, in this order, on what it asks for."""
    parts = urlsplit(opened.server.url)
    address, origin = f"ws://{parts.netloc}/live?topics=sensors,set", Origin(f"http://{parts.netloc}")
    with connect(address, origin=origin, compression=None, proxy=None) as live:
        found = [json.loads(live.recv(timeout=PATIENCE_S)) for _ in range(2)]
        for one in asked:
            live.send(json.dumps(one))
            # What was told on opening may come once more.
            while (told := json.loads(live.recv(timeout=PATIENCE_S)))["topic"] in ("sensors", "set"):
                pass
            found.append(told)
        return found


def until(
    opened: Studio, asked: dict[str, Any], topic: str, enough: Callable[[dict[str, Any]], bool]
) -> dict[str, Any]:
    """Return the first message of a topic after what is asked for that is enough."""
    answers(opened)
    parts = urlsplit(opened.server.url)
    with connect(f"ws://{parts.netloc}/live", origin=Origin(f"http://{parts.netloc}"), proxy=None) as live:
        live.send(json.dumps(asked))
        while True:
            told = json.loads(live.recv(timeout=PATIENCE_S))
            if told["topic"] == topic and enough(told):
                return dict(told)


def counts(browser: Browser, number: int) -> None:
    """Wait until so many sensors are chosen, and the page has its answer."""
    browser.wait(lambda: browser.text("count") == f"{number} of 10")


def heads(browser: Browser, mark: str) -> None:
    """Wait until the trial of a mark on the map is shown."""
    browser.wait(lambda: browser.text("trial-heading") == mark)


def test_sensors_are_chosen_on_the_hand_and_in_the_list(browser: Browser, studio: Start, tmp_path: Path) -> None:
    """By mouse and by keyboard; accuracy, count, command, list and hand follow each time."""
    folder = tmp_path / "recorded"
    page = studio(prices=PRICES)
    browser.open(page.server.url)
    counts(browser, 0)
    none = browser.text("rate")
    first = browser.driver.find_element(By.CSS_SELECTOR, "#hand [role=button]")
    name = first.get_attribute("aria-label")
    first.send_keys(Keys.ENTER)
    counts(browser, 1)
    assert first.get_attribute("aria-pressed") == "true"
    boxes = browser.driver.find_elements(By.CSS_SELECTOR, "#list input")
    assert [box.is_selected() for box in boxes].count(True) == 1
    assert browser.text("command") == (
        f"thenar compile {folder}/set.grasps -o {folder}/build --prices {folder}/prices.toml --sensors 1 --have {name}"
    )
    assert browser.text("price") == "2.50"
    assert browser.text("scan").endswith("µs on the wire")
    boxes[-1].send_keys(Keys.SPACE)
    counts(browser, 2)
    assert browser.text("rate") != none
    assert "quick: not nested" in browser.text("change")
    browser.click("clear")
    counts(browser, 0)
    assert not any(box.is_selected() for box in boxes)
    assert browser.text("rate") == none


def test_the_best_is_added_measured_and_compared_with_the_curve(
    browser: Browser, studio: Start, people: GraspSet
) -> None:
    page = studio()
    browser.open(page.server.url)
    counts(browser, 0)
    for number in (1, 2, 3):
        browser.click("add")
        counts(browser, number)
    browser.click("drop")
    counts(browser, 2)
    have = tuple(browser.text("command").rpartition(" ")[2].split(","))
    browser.click("measure")
    browser.wait(lambda: browser.text("measured"))
    recipe = Recipe(sensors=2, have=have)
    study = study_sensors(people, recipe, limits=Limits.of(recipe, people, {}), jobs=1)
    assert f"{100 * study.point.mean:.1f} % [" in browser.text("measured")
    assert study.of in browser.text("measured")
    browser.click("curve")
    browser.wait(lambda: browser.texts("#points tr"))
    curve = study_sensors(people, Recipe(), jobs=1)
    assert [row.split(" ")[0].rstrip(":") for row in browser.texts("#points th")] == [
        str(point.number) for point in curve.points
    ]
    assert browser.texts("#points [aria-current] th") == [f"{curve.enough}: more matter little"]
    browser.driver.find_elements(By.CSS_SELECTOR, "#points button")[4].click()
    counts(browser, 5)
    assert set(browser.text("command").rpartition(" ")[2].split(",")) == {*curve.points[4].sensors}


def test_a_double_click_adds_a_sensor_once(browser: Browser, studio: Start) -> None:
    """Both clicks are on their way before the first is answered."""
    browser.open(studio().server.url)
    counts(browser, 0)
    browser.script("const add = document.getElementById('add'); add.click(); add.click(); add.click();")
    # What is asked for later is answered later.
    browser.script("document.querySelector('#map g').dispatchEvent(new MouseEvent('click'))")
    browser.wait(lambda: browser.text("trial-heading"))
    counts(browser, 1)
    browser.click("drop")
    counts(browser, 0)


def test_a_choice_outlives_its_server_but_not_its_set(browser: Browser, studio: Start, people: GraspSet) -> None:
    first = studio()
    address = urlsplit(first.server.url).netloc
    browser.open(first.server.url)
    counts(browser, 0)
    browser.click("add")
    counts(browser, 1)
    first.close()
    browser.wait(lambda: "not connected" in browser.text("link"))
    again = studio(address=address)
    browser.wait(lambda: "page: connected" in browser.text("link"))
    browser.click("add")
    counts(browser, 2)
    again.close()
    browser.wait(lambda: "not connected" in browser.text("link"))
    studio(replace(people, switches=people.switches[:, 1:], switch_names=people.switch_names[1:]), address)
    browser.wait(lambda: browser.text("count") == "0 of 9")
    browser.log()  # connections that were refused meanwhile


def test_train_writes_the_build_of_the_chosen_sensors(
    browser: Browser, studio: Start, people: GraspSet, tmp_path: Path
) -> None:
    browser.open(studio(prices=PRICES).server.url)
    counts(browser, 0)
    browser.driver.find_element(By.CSS_SELECTOR, "#hand [role=button]").send_keys(Keys.ENTER)
    counts(browser, 1)
    browser.click("add")
    counts(browser, 2)
    have = set(browser.text("command").rpartition(" ")[2].split(","))
    browser.click("train")
    browser.wait(lambda: browser.texts("#facts li"))
    manifest = Build.load(tmp_path / "recorded" / "build").manifest
    assert {*(kept.name for kept in manifest.switches), *(joint.name for joint in manifest.joints)} == have
    assert any("accuracy, new subject: " in fact for fact in browser.texts("#facts li"))
    assert (tmp_path / "recorded" / "build" / "report.html").exists()
    assert "2,pcs,plain" in (tmp_path / "recorded" / "build" / "spec" / "bom.csv").read_text()


@pytest.mark.parametrize("fault", [BrokenExecutor("a worker ended"), OSError("the disk is full")])
def test_work_that_the_machine_fails_is_told_and_ends_nothing(
    studio: Start, monkeypatch: pytest.MonkeyPatch, fault: Exception
) -> None:
    def failing(*_arguments: object, **_options: object) -> None:
        raise fault

    page = studio()
    with monkeypatch.context() as patched:
        patched.setattr("thenar.studio.choose.study_sensors", failing)
        assert until(page, {"do": "curve"}, "work", lambda work: "why" in work)["why"] == str(fault)
    assert until(page, {"do": "measure", "sensors": [0]}, "measure", bool)["sensors"] == [0]


def test_a_number_of_the_matrix_shows_its_trials(browser: Browser, studio: Start) -> None:
    browser.open(studio().server.url)
    counts(browser, 0)
    browser.click("add")
    counts(browser, 1)
    cell = browser.driver.find_element(By.CSS_SELECTOR, "#confusion button")
    said, count = str(cell.get_attribute("aria-label")), int(cell.text)
    cell.click()
    trials = browser.driver.find_elements(By.CSS_SELECTOR, "#trials button")
    assert len(trials) == count
    trials[0].click()
    browser.wait(lambda: browser.driver.find_element(By.ID, "trial").is_displayed())
    truth, read = said.partition(" trials of ")[2].split(" read as ")
    assert browser.text("trial-heading").endswith(f": {truth}, read as {read}")
    captions = browser.texts("#hands figcaption")
    assert captions[1:] == [f"{truth}, typically", f"{read}, typically"]
    assert len(browser.texts("#hands li")) == 3 * 2
    assert browser.text("decisive").startswith("decided by ")
    browser.wait(lambda: len(browser.texts("#map title")) == 72)
    marks = browser.texts("#map title")
    misread = [mark for mark in marks if "read as" in mark]
    assert len(browser.texts("#map .ring")) == len(misread) == sum(map(int, browser.texts("#confusion button")))
    browser.script("document.querySelector('#map g').dispatchEvent(new MouseEvent('click'))")
    heads(browser, marks[0])
    for mark in misread[:2]:
        browser.driver.find_element(By.TAG_NAME, "body").send_keys("n")
        heads(browser, mark)


@pytest.mark.parametrize(("width", "scheme"), [(1400, "light"), (400, "dark")])
def test_nothing_keeps_people_out_and_a_phone_sees_all(
    browser: Browser, studio: Start, width: int, scheme: str
) -> None:
    browser.open(studio().server.url, width=width, scheme=scheme)
    counts(browser, 0)
    browser.click("add")
    counts(browser, 1)
    browser.driver.find_element(By.CSS_SELECTOR, "#confusion button").click()
    browser.driver.find_element(By.CSS_SELECTOR, "#trials button").click()
    browser.wait(lambda: browser.driver.find_element(By.ID, "trial").is_displayed())
    assert browser.axe() == []
    assert browser.script("return document.documentElement.scrollWidth <= innerWidth")


def test_two_browsers_do_not_move_each_other(studio: Start) -> None:
    page = studio()
    choices = [{"do": "choose", "sensors": sensors} for sensors in ([0, 1], [9])]
    assert [answers(page, one)[2]["sensors"] for one in choices] == [[0, 1], [9]]


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"do": "choose", "sensors": [10]}, "there are 10 sensors"),
        ({"do": "add", "sensors": [-1]}, "there are 10 sensors"),
        ({"do": "measure", "sensors": [99]}, "there are 10 sensors"),
        ({"do": "measure", "sensors": []}, "choose a sensor first"),
        ({"do": "train", "sensors": []}, "choose a sensor first"),
        ({"do": "choose", "sensors": ["../../etc/passwd"]}, "invalid message"),
        ({"do": "choose", "sensors": 1}, "invalid message"),
        ({"do": "trial", "trial": 72}, "there are 72 trials"),
        ({"do": "trial", "trial": 1e300}, "invalid message"),
        ({"do": "quit"}, "a page cannot 'quit'"),
    ],
)
def test_what_a_page_may_not_ask_for_is_refused_and_ends_nothing(
    studio: Start, asked: dict[str, Any], said: str
) -> None:
    *_, refused, then = answers(studio(), asked, {"do": "choose", "sensors": [1]})
    assert refused["topic"] == "refused"
    assert said in refused["why"]
    assert then["topic"] == "quick"


def test_a_sensor_that_is_named_twice_counts_once(studio: Start) -> None:
    page = studio(prices=PRICES)
    *_, twice, once = answers(page, {"do": "choose", "sensors": [3, 9, 3]}, {"do": "choose", "sensors": [3, 9]})
    assert twice == once | {"sensors": [3, 9, 3]}


def test_of_more_switches_than_a_bus_reads_only_the_scan_time_is_unknown(studio: Start) -> None:
    labels = np.arange(24) % 2
    closed = np.tile(labels[:, np.newaxis], 1200)
    many = grasp_set_of(["cup", "pen"], labels, switches=closed, subjects=np.repeat(["A", "B"], 12))
    choices = ({"do": "choose", "sensors": list(range(number))} for number in (2, 1200))
    _, _, few, all_of_them = answers(studio(many), *choices)
    assert few["scan_us"] > 0
    assert (all_of_them["scan_us"], all_of_them["mean"]) == (None, 1.0)


def test_without_positions_the_sensors_are_drawn_in_a_grid(studio: Start, people: GraspSet) -> None:
    names = tuple(f"pad {number}" for number in range(8))
    hand, _ = answers(studio(replace(people, switch_names=names)))
    assert not hand["placed"]
    assert [each["name"] for each in hand["switches"]] == list(names)
    assert [each["bit"] for each in hand["switches"]] == list(range(8))


def test_an_empty_project_says_what_to_do(browser: Browser, studio: Start) -> None:
    browser.open(studio(None).server.url)
    browser.wait(lambda: "record some" in browser.text("empty"))
    assert not browser.driver.find_element(By.ID, "with-set").is_displayed()
    assert browser.axe() == []

"""The page *Choose*, in Chromium as a person uses it, and through its WebSocket as an attacker does."""

import json
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from thenar.cli import run
from thenar.compiler.artifact.sensor_study import study_sensors
from thenar.compiler.placement.constraints import Limits
from thenar.compiler.recordings.edits import trials_of
from thenar.compiler.recordings.graspset import GraspSet
from thenar.runtime import Build
from thenar.runtime.recipe import Recipe
from thenar.studio.edits import change
from thenar.studio.project import Project
from thenar.studio.studio import Report, Studio

from ..browser import Browser
from ..sets import grasp_set_of
from .sockets import PATIENCE_S, page, reply, until

Start = Callable[..., Studio]
PRICES = '[[part]]\nname = "plain"\nprice = 2.5\nsensors = ["*"]\n'


def answers(opened: Studio, *asked: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what a page is told of its set and, in this order, on what it asks for."""
    with page(opened.server.url, "set") as live:
        found = [json.loads(live.recv(timeout=PATIENCE_S))]
        for one in asked:
            live.send(json.dumps(one))
            # What was told on opening may come once more.
            found.append(until(live, lambda told: told["topic"] != "set"))
        return found


def counts(browser: Browser, number: int) -> None:
    """Wait until so many sensors are chosen, and the page has its answer."""
    browser.wait(lambda: browser.text("count") == f"{number} of 10")


def add(browser: Browser) -> None:
    """Choose one more sensor."""
    browser.driver.find_element(By.CSS_SELECTOR, "#list input:not(:checked)").click()


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
    assert browser.text("train-command") == (
        f"thenar compile {folder}/set.grasps -o {folder}/build --prices {folder}/prices.toml --sensors 1 --have {name}"
    )
    options = f"--prices {folder}/prices.toml"
    assert browser.text("measure-command") == f"thenar place {folder}/set.grasps {options} --sensors 1 --have {name}"
    assert browser.text("curve-command") == f"thenar place {folder}/set.grasps {options}"
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


def test_a_choice_is_measured_and_compared_with_the_curve(browser: Browser, studio: Start, people: GraspSet) -> None:
    page = studio()
    browser.open(page.server.url)
    counts(browser, 0)
    for number in (1, 2, 3):
        add(browser)
        counts(browser, number)
    browser.driver.find_element(By.CSS_SELECTOR, "#list input:checked").click()
    counts(browser, 2)
    have = tuple(browser.text("train-command").rpartition(" ")[2].split(","))
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
    assert set(browser.text("train-command").rpartition(" ")[2].split(",")) == {*curve.points[4].sensors}


def test_the_weakest_pair_is_confused_most_often(studio: Start) -> None:
    opened = studio()
    request = {"do": "choose", "sensors": [2, 8]}
    quick, told = answers(opened, request, request | {"do": "errors"})[-2:]
    types, truth, read = told["types"], told["truth"], told["read"]
    counts = {(one, other): 0 for one in types for other in types if one != other}
    for trial, kind in enumerate(truth):
        if read[trial] != kind:
            counts[types[kind], types[read[trial]]] += 1
    most = max(counts.values())
    assert most > 0
    assert quick["weakest"] in {
        f"{one} recognised as {other}: {most} of {truth.count(types.index(one))} trials"
        for (one, other), count in counts.items()
        if count == most
    }


def test_a_choice_outlives_its_server_but_not_its_set(browser: Browser, studio: Start, people: GraspSet) -> None:
    first = studio()
    address = urlsplit(first.server.url).netloc
    browser.open(first.server.url)
    counts(browser, 0)
    add(browser)
    counts(browser, 1)
    first.close()
    browser.wait(lambda: "not connected" in browser.text("link"))
    again = studio(address=address)
    browser.wait(lambda: "page: connected" in browser.text("link"))
    add(browser)
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
    add(browser)
    counts(browser, 2)
    have = set(browser.text("train-command").rpartition(" ")[2].split(","))
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

    opened = studio()
    answers(opened)
    with monkeypatch.context() as patched:
        patched.setattr("thenar.studio.choose.study_sensors", failing)
        assert reply(opened, {"do": "curve"}, "work", "why")["why"] == str(fault)
    assert reply(opened, {"do": "measure", "sensors": [0]}, "measure")["sensors"] == [0]


@pytest.mark.parametrize(("width", "scheme"), [(1400, "light"), (400, "dark")])
def test_nothing_keeps_people_out_and_a_phone_sees_all(
    browser: Browser, studio: Start, width: int, scheme: str
) -> None:
    browser.open(studio().server.url, width=width, scheme=scheme)
    counts(browser, 0)
    add(browser)
    counts(browser, 1)
    assert browser.axe() == []
    browser.click("curve")
    browser.wait(lambda: browser.texts("#points tr"))
    assert browser.axe() == []
    assert browser.script("return document.documentElement.scrollWidth <= innerWidth")


def test_two_browsers_do_not_move_each_other(studio: Start) -> None:
    page = studio()
    choices = [{"do": "choose", "sensors": sensors} for sensors in ([0, 1], [9])]
    assert [answers(page, one)[1]["sensors"] for one in choices] == [[0, 1], [9]]


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"do": "choose", "sensors": [10]}, "there are 10 sensors"),
        ({"do": "choose", "sensors": [-1]}, "there are 10 sensors"),
        ({"do": "measure", "sensors": [99]}, "there are 10 sensors"),
        ({"do": "measure", "sensors": []}, "choose a sensor first"),
        ({"do": "train", "sensors": []}, "choose a sensor first"),
        ({"do": "choose", "sensors": ["../../etc/passwd"]}, "invalid message"),
        ({"do": "choose", "sensors": 1}, "invalid message"),
        ({"do": "use", "id": "../other"}, "the project has no set"),
        ({"do": "choose", "sensors": [1e300]}, "invalid message"),
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
    _, few, all_of_them = answers(studio(many), *choices)
    assert few["scan_us"] > 0
    assert (all_of_them["scan_us"], all_of_them["mean"], all_of_them["weakest"]) == (None, 1.0, "none")


def test_without_positions_the_sensors_are_drawn_in_a_grid(studio: Start, people: GraspSet) -> None:
    names = tuple(f"pad {number}" for number in range(8))
    hand = answers(studio(replace(people, switch_names=names)))[0]["hand"]
    assert not hand["placed"]
    assert [each["name"] for each in hand["switches"]] == list(names)
    assert [each["bit"] for each in hand["switches"]] == list(range(8))


def test_an_empty_project_says_what_to_do(browser: Browser, studio: Start) -> None:
    browser.open(studio(None).server.url)
    browser.wait(lambda: "record some" in browser.text("empty"))
    assert not browser.driver.find_element(By.ID, "with-set").is_displayed()
    assert browser.axe() == []


def test_sets_are_used_left_aside_and_said_not_to_fit(
    browser: Browser, studio: Start, people: GraspSet, tmp_path: Path
) -> None:
    folder = tmp_path / "recorded"
    folder.mkdir()
    replace(people, subjects=np.char.add(people.subjects, "2")).save(folder / "more.grasps")
    replace(people, joints=(), codes=np.zeros((72, 0), np.uint16)).save(folder / "another glove.grasps")
    (folder / "torn.grasps").write_bytes(b"THNR")
    opened = studio()
    browser.open(opened.server.url)
    counts(browser, 0)
    assert browser.texts("#sets label") == ["another glove.grasps", "more.grasps", "set.grasps", "torn.grasps"]
    left = browser.texts("#unused li")
    assert len(left) == 2
    assert left[0].startswith("torn.grasps is left aside: ")
    assert left[1].startswith("another glove.grasps is left aside: another glove.grasps lacks 2 joints")
    add(browser)
    counts(browser, 1)
    command = browser.text("train-command")
    merged = f"{tmp_path}/recorded-merged.grasps"
    sets = f"{folder}/more.grasps {folder}/set.grasps"
    assert command.startswith(f"thenar merge {sets} --overwrite -o {merged} && thenar compile {merged} -o ")
    boxes = browser.driver.find_elements(By.CSS_SELECTOR, "#sets input")
    for name in (0, 1, 3):
        boxes[name].send_keys(Keys.SPACE)
    browser.wait(lambda: not browser.texts("#unused li"))
    browser.wait(lambda: browser.text("train-command").startswith(f"thenar compile {folder}/set.grasps -o "))
    counts(browser, 1)
    assert Project(folder, opened.project.hand()).state.aside == ("another glove.grasps", "more.grasps", "torn.grasps")
    assert browser.axe() == []


def test_the_commands_apply_the_edits_and_measure_the_same(
    studio: Start, people: GraspSet, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The shell's words make the set that the page trains on."""
    opened, folder = studio(), tmp_path / "recorded"
    change(folder / "edits.jsonl", trials_of("set.grasps", people)[:5], "")
    opened.changed()
    answers(opened)
    commands = reply(opened, {"do": "choose", "sensors": [0, 8]}, "quick")["commands"]
    merge, compiled = commands["train"].split(" && ")
    sets = f"{folder}/set.grasps --edits {folder}/edits.jsonl"
    merged = tmp_path / "recorded-merged.grasps"
    assert merge == f"thenar merge {sets} --overwrite -o {merged}"
    assert compiled.startswith(f"thenar compile {merged} -o {folder}/build ")
    assert run(merge.split()[1:]) == 0
    clean = GraspSet.load(merged)
    assert (
        clean.fingerprint()
        == opened.project.recordings()[0].fingerprint()
        == people.rows(np.arange(5, 72)).fingerprint()
    )
    assert commands["curve"] == f"{merge} && thenar place {merged}"
    capsys.readouterr()
    assert run([*commands["measure"].split(" && ")[1].split()[1:], "--json"]) == 0
    (point,) = json.loads(capsys.readouterr().out)["points"]
    shown = reply(opened, {"do": "measure", "sensors": [0, 8]}, "measure")["points"][0]
    assert (point["mean"], point["low"]) == pytest.approx((shown["mean"], shown["low"]))


def test_a_point_of_the_front_says_what_it_is_and_is_chosen(browser: Browser, studio: Start, people: GraspSet) -> None:
    """By mouse and by keyboard, as by the button of its row."""
    browser.open(studio().server.url)
    counts(browser, 0)
    browser.click("curve")
    browser.wait(lambda: browser.texts("#points tr"))
    points = browser.driver.find_elements(By.CSS_SELECTOR, "#front .point")
    rows = browser.texts("#points td:nth-of-type(1)")
    assert len(points) == len(rows)
    mean, _, ends = rows[2].partition(" ")
    assert points[2].get_attribute("aria-label") == f"Choose these 3: {mean} % {ends}"
    points[2].click()
    counts(browser, 3)
    points[3].send_keys(Keys.ENTER)
    counts(browser, 4)
    assert [point.get_attribute("aria-pressed") for point in points[2:5]] == ["false", "true", "false"]
    browser.picture("front")
    names = study_sensors(people, Recipe(), jobs=1).points[3].sensors
    assert {*browser.text("train-command").rpartition(" ")[2].split(",")} == {*names}
    # Of another choice, no point is pressed.
    add(browser)
    counts(browser, 5)
    assert points[3].get_attribute("aria-pressed") == "false"


def test_what_was_measured_is_not_shown_of_recordings_that_changed(
    browser: Browser, studio: Start, people: GraspSet, tmp_path: Path
) -> None:
    opened = studio()
    browser.open(opened.server.url)
    counts(browser, 0)
    add(browser)
    counts(browser, 1)
    browser.click("measure")
    browser.wait(lambda: browser.text("measured"))
    browser.click("curve")
    browser.wait(lambda: browser.texts("#points tr"))
    browser.driver.refresh()
    browser.wait(lambda: browser.text("measured"))
    panel = browser.driver.find_element(By.ID, "curve-panel")
    browser.wait(panel.is_displayed)
    change(tmp_path / "recorded" / "edits.jsonl", trials_of("set.grasps", people)[:9], "")
    opened.changed()
    browser.wait(lambda: not panel.is_displayed())
    browser.wait(lambda: not browser.text("measured"))
    browser.driver.refresh()
    counts(browser, 1)
    assert not browser.driver.find_element(By.ID, "curve-panel").is_displayed()
    assert not browser.text("measured")


def test_work_says_how_long_it_takes_still_and_is_cancelled(browser: Browser, studio: Start, tmp_path: Path) -> None:
    """As long as the last time at first, which counts down, and then as its parts took so far."""
    opened = studio()
    browser.open(opened.server.url)
    counts(browser, 0)
    first, second = Event(), Event()

    def work(report: Report) -> None:
        assert first.wait(PATIENCE_S)
        report(1, 4)
        assert second.wait(PATIENCE_S)
        report(2, 4)
        raise AssertionError("it was cancelled")

    opened.project.remember(took={"measure": 1000.0, "curve": 40.0})
    opened.changed()
    opened.queue("curve", work)
    browser.wait(lambda: browser.text("work") == "measuring the curve: 0 %, about 40 s left")
    browser.wait(lambda: browser.text("work") == "measuring the curve: 0 %, about 35 s left")
    first.set()
    browser.wait(lambda: browser.text("work").startswith("measuring the curve: 25 %, about "))
    assert "about 35 s" not in browser.text("work")
    browser.click("cancel")
    # What is asked for later is answered later.
    add(browser)
    counts(browser, 1)
    second.set()
    browser.wait(lambda: browser.text("work") == "cancelled")
    assert not browser.driver.find_element(By.ID, "cancel").is_displayed()
    remembered = Project(tmp_path / "recorded", opened.project.hand())
    assert remembered.state.took == {"measure": 1000.0, "curve": 40.0}
    browser.click("curve")
    browser.wait(lambda: browser.texts("#points tr"))
    browser.wait(lambda: opened.project.state.took["curve"] != 40.0)

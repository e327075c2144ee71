"""The page *Record*, in Chromium as a person uses it, with an emulated glove, and through its WebSocket."""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.select import Select

from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.taxonomy import published
from thenar.drivers.emulated.lines import BoardSender, LineServer
from thenar.runtime.recording.guide import read_journal
from thenar.studio.project import Project
from thenar.studio.studio import Studio

from ..browser import Browser
from ..sets import grasp_set_of
from .sockets import reply

Start = Callable[..., Studio]
SWITCHES = ("s1", "s2", "s3")
OBJECTS = 'PoS = ["bottle"]\nTip = ["pin"]\nLat = ["key"]\n'
# What is held in each grasp.
HELD: dict[str, dict[str, float]] = {
    "Power": {"s1": 1, "s2": 1, "s3": 1},
    "Tip": {"s1": 1, "s2": 0, "s3": 0},
    "Lateral": {"s1": 0, "s2": 1, "s3": 0},
}


@pytest.fixture
def board(line: LineServer) -> Iterator[BoardSender]:
    with BoardSender(line.send, SWITCHES, ("j1", "p1"), 200) as board:
        board.show({"j1": 100, "p1": 300})
        yield board


@pytest.fixture
def folder(tmp_path: Path, line: LineServer) -> Path:
    """Return the folder of a project with a glove and objects of three types."""
    folder = tmp_path / "recorded"
    folder.mkdir()
    (folder / "glove.toml").write_text(
        f'name = "bench"\n[[stream]]\nport = "{line.port}"\nrate_hz = 200\nswitches = {json.dumps(SWITCHES)}\n'
        "joints = { j1 = [0, 254] }\ntaxels = { p1 = [0, 1023] }\n"
    )
    (folder / "objects.toml").write_text(OBJECTS)
    return folder


def begin(browser: Browser, *, repetitions: int = 2, none: bool = False, subject: str = "Anna") -> None:
    """Fill in the form, and start."""
    browser.wait(lambda: browser.texts("#taxonomy option"))
    name = browser.driver.find_element(By.ID, "subject")
    name.clear()
    name.send_keys(subject)
    Select(browser.driver.find_element(By.ID, "taxonomy")).select_by_visible_text("kamakura14")
    number = browser.driver.find_element(By.ID, "repetitions")
    number.clear()
    number.send_keys(str(repetitions))
    if not none:
        browser.click("none")
    browser.click("start")


def stage(browser: Browser, key: str) -> bool:
    """Return whether a key is offered."""
    return bool(browser.script("return document.querySelector(`#keys [data-key=${arguments[0]}]`)", key))


def captured(browser: Browser) -> bool:
    """Return whether the grasp is captured; on a busy machine, where frames were late, begin the countdown anew."""
    return bool(
        browser.script(
            "const said = document.getElementById('standing').textContent;"
            "if (said.startsWith('not captured')) document.querySelector('#keys [data-key=accept]')?.click();"
            "return said.startsWith('captured: ')"
        )
    )


def hold(browser: Browser, board: BoardSender) -> None:
    """Hold the grasp that the page asks for, until it is captured."""
    # No two trials are the same.
    angle = 50 + 7 * int(browser.text("place").split(" ")[0])
    board.show(HELD[browser.text("prompt").split(" ")[0]] | {"j1": angle})
    browser.wait(lambda: captured(browser))


def open_record(browser: Browser, studio: Studio, **how: int | str) -> None:
    browser.open(f"{studio.server.url}record.html", **how)  # type: ignore[arg-type]
    browser.wait(lambda: browser.text("link").startswith("page: connected"))


def test_more_trials_of_two_types_are_recorded(
    browser: Browser, studio: Start, folder: Path, board: BoardSender
) -> None:
    """As the page Errors asks for with a link: of the taxonomy of the recordings, without the empty hand."""
    kamakura, labels = published("kamakura14"), np.arange(12) % 3
    known = grasp_set_of(kamakura.types, labels, switches=np.eye(3)[labels], subjects=np.repeat(["A", "B"], 6))
    replace(known, taxonomy=kamakura).save(folder / "set.grasps")
    page = studio(None)
    browser.open(f"{page.server.url}record.html?type=Tip&type=Lat&repetitions=3")
    browser.wait(lambda: browser.script("return document.getElementById('taxonomy').value") == "kamakura14")
    assert browser.text("only") == "Only of Tip and Lat."
    browser.driver.find_element(By.ID, "subject").send_keys("Anna")
    browser.click("start")
    browser.wait(lambda: browser.text("place").startswith("1 of 6"))
    assert browser.text("prompt").split(" ")[0] in ("Tip", "Lateral")
    assert browser.axe() == []


def test_a_collection_by_clicks_and_by_keys_becomes_a_set_and_a_build(
    browser: Browser, studio: Start, folder: Path, board: BoardSender
) -> None:
    """Six trials; every second one is accepted with Enter, which the button has the focus for."""
    page = studio(None)
    open_record(browser, page)
    begin(browser)
    browser.wait(lambda: stage(browser, "accept"))
    assert browser.text("record-command").startswith(f"thenar record --glove {folder}/glove.toml --subject ")
    assert browser.script("return document.activeElement.dataset.key") == "accept"
    assert browser.axe() == []
    browser.driver.switch_to.active_element.send_keys(Keys.ENTER)
    for number in range(1, 7):
        browser.wait(lambda number=number: browser.text("place").startswith(f"{number} of 6"))  # type: ignore[misc]
        assert browser.script("return document.querySelector('#drawing .object') !== null")
        assert "two trials of every type" in browser.text("accuracy") or number == 1
        hold(browser, board)
        if number == 1:
            browser.driver.find_element(By.TAG_NAME, "body").send_keys("r")
            browser.wait(lambda: not browser.text("standing").startswith("captured"))
            hold(browser, board)
        accept = browser.driver.find_element(By.CSS_SELECTOR, "#keys [data-key=accept]")
        if number % 2:
            accept.click()
        else:
            assert browser.driver.switch_to.active_element == accept
            accept.send_keys(Keys.ENTER)
    browser.wait(lambda: browser.text("prompt") == "no trial is left")
    assert "All sensors tell these trials apart in 100.0 % [" in browser.text("accuracy")
    assert "quick" in browser.text("accuracy")
    assert len(browser.texts("#strip button")) == 6
    browser.driver.find_elements(By.CSS_SELECTOR, "#strip button")[0].click()
    browser.wait(lambda: browser.text("seen-heading").startswith("Trial 1: "))
    grasp = browser.text("seen-heading").split(": ")[1].split(",")[0]
    held = {"PoS": 3, "Tip": 1, "Lat": 1}[grasp]
    assert len(browser.driver.find_elements(By.CSS_SELECTOR, "#hand .closed")) == held
    name = browser.driver.find_element(By.ID, "hand").accessible_name
    assert name == f"The hand: {held} of 3 switches closed"
    browser.picture("record-trials")
    browser.driver.find_element(By.CSS_SELECTOR, "#keys [data-key=accept]").click()
    browser.wait(lambda: browser.text("end-heading") == "Recorded: Anna.grasps")
    recorded = GraspSet.load(folder / "Anna.grasps")
    assert sorted(recorded.grasps.tolist()) == ["Lat", "Lat", "PoS", "PoS", "Tip", "Tip"]
    assert {*recorded.subjects.tolist()} == {"Anna"}
    assert "6 of 6 trials are done" in browser.text("size")
    assert browser.texts("#warnings li")
    assert browser.axe() == []
    strip = browser.texts("#strip button")
    browser.wait(lambda: browser.driver.find_element(By.ID, "type").is_displayed())
    Select(browser.driver.find_element(By.ID, "type")).select_by_value("Tip" if grasp != "Tip" else "Lat")
    browser.driver.find_element(By.CSS_SELECTOR, "#relabel [type=submit]").click()
    browser.wait(lambda: " → " in browser.texts("#strip button")[0])
    browser.click("drop")
    browser.wait(lambda: "left out" in browser.texts("#strip button")[0])
    project = Project(folder, page.project.hand())
    assert len(project.recordings()[0].rows(project.recordings()[0].grasps == grasp)) == 1
    browser.picture("record-end")
    for _ in range(2):
        browser.click("undo")
    browser.wait(lambda: browser.texts("#strip button") == strip)
    assert len(project.recordings()[0]) == 6
    browser.wait(lambda: not browser.script("return document.getElementById('train').disabled"))
    browser.click("train")
    browser.wait(lambda: browser.text("build-heading") == "Trained: build")
    assert (folder / "build" / "build.json").exists()
    assert browser.axe() == []


def test_the_countdown_waits_while_the_glove_is_away_and_a_restart_continues(
    browser: Browser, studio: Start, folder: Path, line: LineServer
) -> None:
    first = studio(None)
    open_record(browser, first)
    port = int(line.port.rpartition(":")[2])
    with BoardSender(line.send, SWITCHES, ("j1", "p1"), 200) as board:
        begin(browser, repetitions=1)
        browser.wait(lambda: stage(browser, "accept"))
        browser.driver.switch_to.active_element.send_keys(Keys.ENTER)
        hold(browser, board)
        line.close()
        browser.driver.find_element(By.CSS_SELECTOR, "#keys [data-key=accept]").click()
        browser.wait(lambda: browser.text("standing").startswith("the countdown waits: "))
        assert not stage(browser, "accept")
        assert browser.script("return document.getElementById('glove-state').dataset.is") == "bad"
        assert browser.axe() == []
    with LineServer(port) as again, BoardSender(again.send, SWITCHES, ("j1", "p1"), 200) as board:
        browser.wait(lambda: stage(browser, "accept"))
        browser.driver.find_element(By.TAG_NAME, "body").send_keys("q")
        browser.wait(lambda: browser.text("end-heading") == "Recorded: Anna.grasps")
        assert "1 of 3 trials are done" in browser.text("size")
        first.close()
        second = studio(None)
        open_record(browser, second)
        browser.wait(lambda: browser.texts("#recordings button"))
        assert browser.texts("#recordings button") == ["Continue Anna.mcap of Anna: 1 of 3 trials are done"]
        wired = (folder / "glove.toml").read_text()
        (folder / "glove.toml").write_text(wired.replace("j1 = [0, 254]", "j1 = [0, 254], j2 = [0, 254]"))
        browser.driver.find_element(By.CSS_SELECTOR, "#recordings button").click()
        browser.wait(lambda: "was begun with different sensors" in browser.text("refused"))
        assert browser.texts("#strip button") == []
        (folder / "glove.toml").write_text(wired)
        browser.driver.find_element(By.CSS_SELECTOR, "#recordings button").click()
        browser.wait(lambda: stage(browser, "accept"))
        assert len(browser.texts("#strip button")) == 1
        browser.driver.switch_to.active_element.send_keys(Keys.ENTER)
        hold(browser, board)
        browser.driver.find_element(By.CSS_SELECTOR, "#keys [data-key=accept]").click()
        browser.wait(lambda: browser.text("place").startswith("3 of 3"))
        hold(browser, board)
        browser.driver.find_element(By.TAG_NAME, "body").send_keys("u")
        browser.wait(lambda: len(browser.texts("#strip button")) == 1)
        browser.driver.find_element(By.TAG_NAME, "body").send_keys("q")
        browser.wait(lambda: "1 of 3" in browser.text("size"))
    assert len(read_journal(folder / "Anna.mcap").accepted) == 1


def accept(browser: Browser, board: BoardSender, number: int) -> None:
    """Hold the grasp of this number, and accept it."""
    browser.wait(lambda: browser.text("place").startswith(f"{number} of 6"))
    hold(browser, board)
    browser.driver.find_element(By.CSS_SELECTOR, "#keys [data-key=accept]").click()


def strip(browser: Browser) -> list[str]:
    return browser.texts("#strip button")


def relabel(browser: Browser, new: str) -> None:
    """Make the trial that is shown another type, and wait until the strip says so."""
    Select(browser.driver.find_element(By.ID, "type")).select_by_value(new)
    browser.driver.find_element(By.CSS_SELECTOR, "#relabel [type=submit]").click()
    browser.wait(lambda: any(said.endswith(f" → {new}") for said in strip(browser)))


def test_trials_are_edited_while_the_recording_goes_on(
    browser: Browser, studio: Start, folder: Path, board: BoardSender
) -> None:
    """Their set does not exist yet. It has the edits, also if a recording is left and continued by another server."""
    first = studio(None)
    project = first.project
    open_record(browser, first)
    begin(browser)
    browser.wait(lambda: stage(browser, "accept"))
    browser.driver.switch_to.active_element.send_keys(Keys.ENTER)
    accept(browser, board, 1)
    browser.wait(lambda: len(strip(browser)) == 1)
    plain = strip(browser)
    browser.driver.find_element(By.CSS_SELECTOR, "#strip button").click()
    browser.wait(lambda: browser.text("seen-heading").startswith("Trial 1: "))
    was = browser.text("seen-heading").split(": ")[1].split(",")[0]
    new, other = sorted({"PoS", "Tip", "Lat"} - {was})
    # A letter chooses a type here, and skips no trial.
    browser.driver.find_element(By.ID, "type").send_keys("s")
    relabel(browser, new)
    browser.click("drop")
    browser.wait(lambda: strip(browser)[0].endswith("left out"))
    assert browser.axe() == []
    browser.picture("record-edit")
    browser.click("undo")
    browser.wait(lambda: strip(browser)[0].endswith(f" → {new}"))
    # Enter is the key of the recording again, and no second undo.
    assert browser.script("return document.activeElement === document.body")
    browser.click("undo")
    browser.wait(lambda: strip(browser) == plain)
    assert not browser.driver.find_element(By.ID, "undo").is_enabled()
    relabel(browser, new)
    accept(browser, board, 2)
    browser.wait(lambda: len(strip(browser)) == 2)
    assert strip(browser)[0].endswith(f" → {new}")
    browser.driver.find_elements(By.CSS_SELECTOR, "#strip button")[1].click()
    browser.wait(lambda: browser.text("seen-heading").startswith("Trial 2: "))
    browser.click("drop")
    browser.wait(lambda: strip(browser)[1].endswith("left out"))
    assert "skipped" not in browser.text("place")
    assert not (folder / "Anna.grasps").exists()
    for asked, why in (
        ({"do": "recorded", "trial": 99}, "trial 99 was not recorded"),
        ({"do": "relabel", "trial": 3, "name": "Tip"}, "trial 3 is not among those that were accepted"),
        ({"do": "relabel", "trial": 1, "name": "spoon"}, "spoon"),
        ({"do": "relabel", "trial": 1, "name": "none"}, "none"),
        ({"do": "relabel", "trial": 1, "name": new}, f"are {new} already"),
    ):
        assert why in reply(first, asked)["why"]
    browser.driver.find_element(By.TAG_NAME, "body").send_keys("q")
    browser.wait(lambda: browser.text("end-heading") == "Recorded: Anna.grasps")
    assert len(GraspSet.load(folder / "Anna.grasps")) == 2
    edited, trials, unused = project.recordings()
    assert (edited.grasps.tolist(), [trial[3] for trial in trials], unused) == ([new], [was], [])
    first.close()
    open_record(browser, studio(None))
    browser.wait(lambda: browser.texts("#recordings button"))
    browser.driver.find_element(By.CSS_SELECTOR, "#recordings button").click()
    browser.wait(lambda: stage(browser, "accept"))
    browser.wait(lambda: len(strip(browser)) == 2)
    assert (strip(browser)[0].endswith(f" → {new}"), strip(browser)[1].endswith("left out")) == (True, True)
    browser.driver.switch_to.active_element.send_keys(Keys.ENTER)
    accept(browser, board, 3)
    browser.wait(lambda: len(strip(browser)) == 3)
    browser.driver.find_elements(By.CSS_SELECTOR, "#strip button")[2].click()
    browser.wait(lambda: browser.text("seen-heading").startswith("Trial 3: "))
    relabel(browser, other if browser.text("seen-heading").split(": ")[1].split(",")[0] != other else new)
    # The set of the first sitting lacks the trial, whose edit waits.
    assert project.recordings()[2] == []
    # What was undone is recorded anew, and has its own type again; nothing is left to undo but what was before.
    browser.driver.find_element(By.TAG_NAME, "body").send_keys("u")
    browser.wait(lambda: len(strip(browser)) == 2)
    accept(browser, board, 3)
    browser.wait(lambda: len(strip(browser)) == 3)
    assert " → " not in strip(browser)[2]
    assert "trial 2 of Anna" in browser.text("edited")
    browser.driver.find_element(By.TAG_NAME, "body").send_keys("q")
    browser.wait(lambda: "3 of 6 trials are done" in browser.text("size"))
    edited, trials, unused = project.recordings()
    assert ([trial[5] for trial in trials], unused) == ([1, 3], [])
    assert edited.grasps.tolist() == [new, trials[1][3]]


@pytest.mark.parametrize(("width", "scheme"), [(400, "light"), (1400, "dark")])
def test_it_can_be_used_by_everybody(
    browser: Browser, studio: Start, folder: Path, board: BoardSender, width: int, scheme: str
) -> None:
    opened = studio(None)
    open_record(browser, opened, width=width, scheme=scheme)
    browser.wait(lambda: browser.texts("#taxonomy option"))
    assert browser.axe() == []
    begin(browser, none=True)
    browser.wait(lambda: stage(browser, "accept"))
    browser.picture(f"record-{width}")
    assert browser.axe() == []
    assert browser.script("return document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        ({"do": "record", "name": "a/b", "id": "kamakura14", "value": 2}, "is not possible"),
        ({"do": "record", "name": "", "id": "kamakura14", "value": 2}, "subject"),
        ({"do": "record", "name": "Anna", "id": "../kamakura14", "value": 2}, "no taxonomy is called"),
        ({"do": "record", "name": "Anna", "id": "kamakura14", "value": 0}, "whole number from 1"),
        ({"do": "record", "name": "Anna", "id": "kamakura14", "value": 1e9}, "whole number from 1"),
        ({"do": "record", "name": "Anna", "id": "kamakura14", "value": 2.5}, "whole number from 1"),
        ({"do": "record", "name": "Anna", "id": "kamakura14"}, "whole number from 1"),
        ({"do": "record", "name": "Anna", "id": "kamakura14", "value": 2, "ids": ["spoon"]}, "is not a grasp type of"),
        ({"do": "continue", "id": "../glove.toml"}, "the project has no recording"),
        ({"do": "key", "name": "explode"}, "there is no key 'explode' now"),
        ({"do": "key", "name": "accept"}, "there is no key 'accept' now"),
        ({"do": "recorded", "trial": 99}, "nothing was recorded here yet"),
        ({"do": "relabel", "trial": 1, "name": "Tip"}, "nothing was recorded here yet"),
    ],
)
def test_what_no_page_sends_is_refused(studio: Start, folder: Path, asked: dict[str, object], why: str) -> None:
    opened = studio(None)
    before = {*folder.iterdir()}
    assert why in reply(opened, asked)["why"]
    assert {*folder.iterdir()} == before
    assert opened.station.doing == ""


def test_without_a_glove_nothing_is_recorded(browser: Browser, studio: Start) -> None:
    open_record(browser, studio(None))
    browser.wait(lambda: browser.texts("#taxonomy option"))
    assert browser.script("return document.getElementById('start').disabled")
    link = browser.script("return document.querySelector('#no-glove a').href")
    assert urlsplit(link).path == "/glove.html"
    assert browser.axe() == []

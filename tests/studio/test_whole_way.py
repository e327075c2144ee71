"""The whole way in Chromium, from an empty folder with an emulated glove to an adapted, exported recogniser."""

from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event, Thread
from urllib.request import urlopen

import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select

from thenar.drivers.emulated.lines import BoardSender, LineServer
from thenar.runtime import Build
from thenar.studio.studio import Studio

from ..browser import Browser

pytestmark = pytest.mark.slow

Start = Callable[..., Studio]
SWITCHES = ("thumb", "index", "palm")
# What the switches and the flex sensor show in each grasp.
HELD: dict[str, dict[str, float]] = {
    "fist": {"thumb": 1, "index": 1, "palm": 1, "flex": 700},
    "pinch": {"thumb": 1, "index": 1, "palm": 0, "flex": 400},
    "point": {"thumb": 0, "index": 0, "palm": 1, "flex": 250},
}


@pytest.fixture
def board(line: LineServer) -> Iterator[BoardSender]:
    with BoardSender(line.send, SWITCHES, ("flex",), 100) as board:
        yield board


def go(browser: Browser, page: str) -> None:
    """Follow a link of the bar."""
    browser.wait(lambda: page in browser.texts("#pages a"))
    browser.driver.find_element(By.LINK_TEXT, page).click()
    browser.wait(lambda: browser.texts("#pages [aria-current=page]") == [page])


def fill(browser: Browser, name: str, text: str) -> None:
    field = browser.driver.find_element(By.ID, name)
    field.clear()
    field.send_keys(text)


def connect(browser: Browser, board: BoardSender, port: str) -> None:
    """Let the page find the glove, while every switch closes and the finger bends."""
    browser.wait(lambda: browser.driver.find_element(By.ID, "address").is_displayed())
    fill(browser, "address", port)
    stop = Event()

    def move() -> None:
        step = 0
        while not stop.wait(0.05):
            step += 1
            board.show({name: float(step >> bit & 1) for bit, name in enumerate(SWITCHES)})
            board.show({"flex": float(200 + 5 * (step % 100))})

    moving = Thread(target=move)
    moving.start()
    browser.click("find")
    browser.wait(lambda: browser.driver.find_element(By.ID, "connect").is_displayed())
    stop.set()
    moving.join()
    browser.click("connect")
    browser.wait(lambda: browser.driver.find_element(By.ID, "with-glove").is_displayed())


def captured(browser: Browser) -> bool:
    """Wait for the end of the countdown, and return whether the grasp was captured."""
    browser.wait(lambda: "captured: " in browser.text("standing"))
    return browser.text("standing").startswith("captured: ")


def record(browser: Browser, board: BoardSender, trials: int, lean: int) -> None:
    """Lead through all trials; a hand differs from others by how far its finger bends."""
    key = "#keys [data-key=accept]"
    browser.wait(lambda: browser.texts(key) and "start" in browser.texts(key)[0])
    browser.driver.find_element(By.CSS_SELECTOR, key).click()
    for number in range(1, trials + 1):
        browser.wait(lambda number=number: browser.text("place").startswith(f"{number} of {trials}"))  # type: ignore[misc]
        held = HELD[browser.text("prompt").split(" ")[0]]
        board.show(held | {"flex": held["flex"] + lean + 3 * number})
        while not captured(browser):  # a busy machine lost rows: do it again, as the page says
            browser.driver.find_element(By.CSS_SELECTOR, key).click()
            browser.wait(lambda: "captured" not in browser.text("standing"))
        browser.driver.find_element(By.CSS_SELECTOR, key).click()
    browser.wait(lambda: browser.text("prompt") == "no trial is left")
    browser.driver.find_element(By.CSS_SELECTOR, key).click()


def test_from_an_empty_folder_to_an_exported_recogniser(
    browser: Browser, studio: Start, line: LineServer, board: BoardSender, tmp_path: Path
) -> None:
    opened, project = studio(None), tmp_path / "recorded"
    browser.open(opened.server.url)
    go(browser, "Glove")
    connect(browser, board, line.port)
    assert (project / "glove.toml").exists()

    go(browser, "Record")
    browser.wait(lambda: browser.texts("#taxonomy option"))
    fill(browser, "subject", "Anna")
    Select(browser.driver.find_element(By.ID, "taxonomy")).select_by_visible_text("own")
    fill(browser, "types", "fist, pinch, point")
    fill(browser, "repetitions", "4")
    browser.click("none")
    browser.click("start")
    record(browser, board, 12, 0)
    browser.wait(lambda: browser.text("end-heading") == "Recorded: Anna.grasps")
    browser.wait(lambda: browser.driver.find_element(By.ID, "train").is_enabled())
    browser.click("train")
    browser.wait(lambda: browser.text("build-heading") == "Trained: build")
    browser.wait(lambda: browser.text("build-state").startswith("build: build "))
    assert "% within subject" in browser.text("build-state")

    go(browser, "Wearer")
    fill(browser, "subject", "Ben")
    browser.driver.find_element(By.CSS_SELECTOR, "#who button").click()
    browser.wait(lambda: browser.text("wearer") == "wearer: Ben")
    browser.driver.find_element(By.CSS_SELECTOR, "#record button").click()
    browser.wait(lambda: browser.texts("#pages [aria-current=page]") == ["Record"])
    record(browser, board, 6, 60)
    browser.wait(lambda: browser.texts("#pages [aria-current=page]") == ["Wearer"])
    browser.wait(lambda: browser.text("result-heading").startswith("Adapted: "))
    folder = browser.text("result-heading").removeprefix("Adapted: ").partition(",")[0]
    adapted = Build.load(project / folder)
    assert adapted.manifest.adapted is not None
    browser.wait(lambda: browser.text("build-state").startswith(f"build: {folder} "))

    go(browser, "Live")
    browser.wait(lambda: browser.texts("#steer-run") == ["Start"])
    browser.click("steer-run")
    for grasp, held in HELD.items():
        board.show(held | {"flex": held["flex"] + 60})
        browser.wait(lambda grasp=grasp: browser.text("grasp") == grasp)  # type: ignore[misc]

    go(browser, "Compare")
    browser.wait(lambda: len(browser.texts("#b option")) == 2)
    Select(browser.driver.find_element(By.ID, "b")).select_by_visible_text(folder)
    browser.click("report")
    browser.wait(lambda: browser.driver.find_element(By.ID, "download").is_displayed())
    link = browser.driver.find_element(By.CSS_SELECTOR, "#download a")
    address = str(link.get_attribute("href"))
    with urlopen(address) as answer:
        page = answer.read()
    assert answer.headers["Content-Disposition"].startswith("attachment")
    assert b'role="tab"' in page
    assert adapted.manifest.checksum[:8].encode() in page

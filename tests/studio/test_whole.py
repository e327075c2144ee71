"""From an empty folder to a recogniser that is trained, adapted and exported, in a browser alone."""

from collections.abc import Callable
from itertools import combinations, cycle
from pathlib import Path

import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.select import Select

from thenar.drivers.emulated.lines import BoardSender, LineServer
from thenar.runtime import Build
from thenar.studio import Studio

from ..browser import Browser

# Fifty-six trials, each with its countdown.
pytestmark = pytest.mark.slow

SWITCHES = tuple(f"s{number}" for number in range(1, 7))
# What is closed in the types, in the order in which the page first asks for them.
PATTERNS = [*combinations(SWITCHES, 2), *combinations(SWITCHES, 3)]


def go(browser: Browser, title: str) -> None:
    """Follow a link of the bar, and wait until the page is connected."""
    browser.wait(lambda: title in browser.texts("nav a"))
    browser.driver.find_element(By.LINK_TEXT, title).click()
    browser.wait(lambda: browser.texts("nav [aria-current]") == [title])
    browser.wait(lambda: browser.text("link").startswith("page: connected"))


def collect(browser: Browser, board: BoardSender, closed: dict[str, set[str]]) -> None:
    """Do what the page asks for, until no trial is left; `closed` grows by the types that it asks for first."""
    accept = "#keys [data-key=accept]"

    def press() -> None:
        browser.driver.find_element(By.CSS_SELECTOR, accept).send_keys(Keys.ENTER)

    browser.wait(lambda: browser.texts(accept))
    press()
    for number in range(1, 29):
        browser.wait(lambda number=number: browser.text("place").startswith(f"{number} of 28"))  # type: ignore[misc]
        held = closed.setdefault(browser.text("prompt"), {*PATTERNS[len(closed) % len(PATTERNS)]})
        board.show({name: float(name in held) for name in SWITCHES})
        browser.wait(lambda: "captured: " in browser.text("standing"))
        # A machine that is busy may not read the glove in time.
        while browser.text("standing").startswith("not captured"):
            press()
            browser.wait(lambda: browser.text("standing").startswith("captured: "))
        press()
    browser.wait(lambda: browser.text("prompt") == "no trial is left")
    press()


def test_without_a_terminal(browser: Browser, studio: Callable[..., Studio], tmp_path: Path) -> None:
    folder, saved, closed = tmp_path / "recorded", tmp_path / "saved", dict[str, set[str]]()
    browser.driver.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(saved)})
    with LineServer() as line, BoardSender(line.send, SWITCHES, (), 200) as board:
        browser.open(studio(None).server.url)
        go(browser, "Glove")
        browser.wait(lambda: browser.text("addresses"))
        browser.driver.find_element(By.ID, "address").send_keys(line.port, Keys.ENTER)
        pressed = cycle((0.0, 1.0))

        def found() -> bool:
            """Press and release all switches, while the page listens, until it has found them."""
            board.show(dict.fromkeys(SWITCHES, next(pressed)))
            return browser.driver.find_element(By.ID, "connect").is_displayed()

        browser.wait(found)
        browser.click("connect")
        browser.wait(lambda: browser.text("glove-state") == "glove: connected")

        go(browser, "Record")
        browser.wait(lambda: browser.texts("#taxonomy option"))
        name = browser.driver.find_element(By.ID, "subject")
        name.clear()
        name.send_keys("Anna")
        Select(browser.driver.find_element(By.ID, "taxonomy")).select_by_value("kamakura14")
        number = browser.driver.find_element(By.ID, "repetitions")
        number.clear()
        number.send_keys("2")
        browser.click("none")
        browser.click("start")
        collect(browser, board, closed)
        browser.wait(lambda: browser.text("end-heading") == "Recorded: Anna.grasps")
        browser.wait(lambda: not browser.script("return document.getElementById('train').disabled"))
        browser.click("train")
        browser.wait(lambda: browser.text("build-heading") == "Trained: build")

        go(browser, "Wearer")
        name = browser.driver.find_element(By.ID, "subject")
        name.clear()
        name.send_keys("Ben", Keys.ENTER)
        browser.wait(lambda: browser.text("wearer") == "wearer: Ben")
        # Ben does two types as Anna does each other's.
        one, other = list(closed)[:2]
        closed[one], closed[other] = closed[other], closed[one]
        browser.wait(lambda: "--subject Ben" in browser.text("record-command"))
        browser.driver.find_element(By.ID, "type").send_keys(Keys.ENTER)
        browser.wait(lambda: browser.script("return location.pathname") == "/record.html")
        collect(browser, board, closed)
        browser.wait(lambda: browser.script("return location.pathname") == "/wearer.html")
        browser.wait(lambda: browser.text("result-heading") == "Adapted: Ben, from 28 trials")
        assert browser.text("before").startswith("24 of 28: ")
        after = int(browser.text("after").split(" ")[0])

    go(browser, "Compare")
    browser.wait(lambda: browser.text("report-command").endswith("Ben.html"))
    browser.click("report")
    browser.wait(lambda: browser.driver.find_element(By.ID, "download").is_displayed())
    browser.driver.find_element(By.CSS_SELECTOR, "#download a").click()
    browser.wait(lambda: (saved / "Ben.html").exists())
    page = (saved / "Ben.html").read_text()
    assert page == (folder / "Ben.html").read_text()
    build = Build.load(folder / "Ben")
    assert build.manifest.checksum in page
    assert build.manifest.adapted is not None
    assert set(build.manifest.adapted.counts) == {2}
    assert (build.manifest.rates[1].correct, build.manifest.rates[1].total) == (after, 28)

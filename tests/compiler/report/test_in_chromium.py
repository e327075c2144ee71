"""The report as a reader has it: opened from a file in a real browser, clicked, typed at, printed."""

import base64
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from thenar.compiler.report.content import ReportContent
from thenar.compiler.report.page import report_html

from ...browser import Browser

pytestmark = pytest.mark.slow


class Reader(Browser):
    """A browser with one report open."""


@pytest.fixture(scope="module")
def reader(new_chromium: Callable[..., webdriver.Chrome]) -> Iterator[Reader]:
    driver = new_chromium("--window-size=1300,1000", logs=("browser", "performance"))
    yield Reader(driver)
    driver.quit()


@pytest.fixture(scope="module")
def path(whole: ReportContent, write: Callable[[bytes], Path]) -> Path:
    return write(report_html(whole))


@pytest.fixture
def opened(reader: Reader, path: Path) -> Iterator[Reader]:
    """Return the reader with the report open; nothing may have been complained of or asked for when the test ends."""
    reader.open_file(path)
    yield reader
    assert reader.log() == []
    assert reader.requests() == [path.as_uri()]


def test_the_report_opens_with_its_drawings(opened: Reader) -> None:
    drawn = opened.driver.find_elements(By.CSS_SELECTOR, "figure:has(svg)")
    assert all(chart.find_element(By.TAG_NAME, "svg").size["height"] > 100 for chart in drawn)
    assert [chart.get_attribute("id") for chart in drawn] == ["", "terms"]


def test_colours_follow_the_readers_system_in_page_and_hand(opened: Reader) -> None:
    look = (
        "return [getComputedStyle(document.body).backgroundColor,"
        " getComputedStyle(document.querySelector('#kept-hand .skin')).fill,"
        " getComputedStyle(document.querySelector('#terms text')).fill]"
    )
    light = opened.script(look)
    assert isinstance(light, list)
    opened.scheme("dark")
    opened.wait(lambda: all(one != other for one, other in zip(light, opened.script(look), strict=True)))
    opened.scheme("light")
    opened.wait(lambda: opened.script(look) == light)


# Tables that go beyond the page or cannot be seen, and letters of drawings smaller than 8 pixels.
_BROAD = """return [...document.querySelectorAll('table')].filter((table) => {
        const box = table.getBoundingClientRect();
        return box.right > document.documentElement.clientWidth + 0.5 || box.width === 0; })
    .map((table) => table.caption.textContent)"""
_SMALL = """return [...document.querySelectorAll('svg text')].filter((text) => text.textContent.trim())
    .filter((text) => { const at = text.getScreenCTM();
        return parseFloat(getComputedStyle(text).fontSize) * Math.hypot(at.a, at.b) < 8; })
    .map((text) => text.textContent)"""


def test_a_narrow_screen_shows_all_tables_and_letters_that_can_be_read(opened: Reader) -> None:
    metrics = {"width": 400, "height": 800, "deviceScaleFactor": 1, "mobile": True}
    opened.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    try:
        opened.wait(lambda: opened.script("return document.documentElement.clientWidth") == 400)
        assert opened.script("return document.documentElement.scrollWidth") == 400
        assert opened.script(_BROAD) == []
        assert opened.script(_SMALL) == []
    finally:
        opened.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_on_paper_the_report_is_light(opened: Reader) -> None:
    features = [{"name": "prefers-color-scheme", "value": "dark"}]
    opened.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print", "features": features})
    try:
        colours = opened.script(
            "return [getComputedStyle(document.body).backgroundColor, getComputedStyle(document.documentElement)"
            ".colorScheme, getComputedStyle(document.querySelector('#terms text')).fill]"
        )
        assert colours == ["rgb(255, 255, 255)", "light", "rgb(27, 31, 36)"]
        assert base64.b64decode(opened.driver.print_page()).startswith(b"%PDF")
    finally:
        opened.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})


def test_the_first_stop_of_the_keyboard_leads_past_the_contents(opened: Reader) -> None:
    ActionChains(opened.driver).send_keys(Keys.TAB).perform()
    assert opened.driver.switch_to.active_element.text == "Skip to the content"
    ActionChains(opened.driver).send_keys(Keys.ENTER).perform()
    opened.wait(lambda: opened.driver.switch_to.active_element.get_attribute("id") == "content")


def test_a_screen_reader_finds_landmarks_and_names(opened: Reader) -> None:
    nodes = opened.driver.execute_cdp_cmd("Accessibility.getFullAXTree", {})["nodes"]
    told = [(node["role"]["value"], node.get("name", {}).get("value", "")) for node in nodes if not node["ignored"]]
    roles = [role for role, _ in told]
    assert {"banner", "navigation", "main"} <= set(roles)
    assert roles.count("main") == 1
    named = [(role, name) for role, name in told if role in {"image", "table", "region", "link"}]
    assert len(named) > 36
    assert [role for role, name in named if not name] == []


def test_names_that_hold_scripts_run_nothing(
    reader: Reader, nasty: ReportContent, write: Callable[[bytes], Path]
) -> None:
    path = write(report_html(nasty))
    reader.open_file(path)
    assert reader.driver.title == "thenar: report of a build"
    assert reader.driver.find_elements(By.TAG_NAME, "img") == []
    assert "<img src=x onerror=" in reader.driver.find_element(By.TAG_NAME, "body").text
    assert reader.log() == []
    assert reader.requests() == [path.as_uri()]

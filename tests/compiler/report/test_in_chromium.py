"""The report as a reader has it: opened from a file in a real browser, clicked, typed at, printed."""

import base64
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement

from thenar.compiler.frontier.points import Frontier
from thenar.compiler.report.content import ReportContent
from thenar.compiler.report.page import report_html

from ...browser import Browser

pytestmark = pytest.mark.slow


class Reader(Browser):
    """A browser with one report open."""

    def kept_on_hand(self) -> list[str]:
        """Return the names of the switches marked on the frontier's hand, in their order."""
        dots = self.script(
            "return [...document.querySelectorAll('#picked-hand .dot.kept')].map((dot) =>"
            " [Number(dot.querySelector('text').textContent), dot.querySelector('title').textContent])"
        )
        assert isinstance(dots, list)
        return [name for _, name in sorted(dots)]

    def said(self) -> str:
        return self.driver.find_element(By.ID, "picked-said").text

    def marker(self, chart: str, number: int) -> WebElement:
        """Return the marker of a point in a chart, where it can be seen."""
        element = self.driver.find_element(By.CSS_SELECTOR, f"#{chart} .point[data-point='{number}']")
        self.script("arguments[0].scrollIntoView({block: 'center'})", element)
        return element

    def picked(self) -> set[str]:
        """Return the numbers of the points whose markers and rows are picked, in the charts and in the table."""
        numbers = self.script("return [...document.querySelectorAll('.picked')].map((one) => one.dataset.point)")
        assert isinstance(numbers, list)
        return set(numbers)


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


def switches(frontier: Frontier, number: int) -> list[str]:
    return list(frontier.point(number).switches)


def test_the_report_opens_with_all_its_charts_and_the_picked_point(opened: Reader, frontier: Frontier) -> None:
    drawn = opened.driver.find_elements(By.CSS_SELECTOR, "figure:has(.scroll > svg)")
    charts = ["terms", "by-frontier", "by-switches"]
    assert [chart.get_attribute("id") for chart in drawn] == charts
    assert all(chart.find_element(By.TAG_NAME, "svg").size["height"] > 100 for chart in drawn)
    assert frontier.picked is not None
    assert opened.picked() == {str(frontier.picked)}
    assert opened.kept_on_hand() == switches(frontier, frontier.picked)


@pytest.mark.parametrize("chart", ["by-frontier", "by-switches"])
def test_a_click_on_a_point_shows_its_switches_on_the_hand(opened: Reader, frontier: Frontier, chart: str) -> None:
    opened.marker(chart, 2).find_element(By.CSS_SELECTOR, ".target").click()
    opened.wait(lambda: opened.said().startswith("Point 2:"))
    assert opened.kept_on_hand() == switches(frontier, 2)
    checked = opened.driver.find_element(By.CSS_SELECTOR, "#points input:checked")
    assert checked.get_attribute("value") == "2"
    assert opened.picked() == {"2"}
    command = opened.driver.find_element(By.ID, "picked-command").text
    assert command == "thenar compile kamakura.grasps -o build/ --from frontier/frontier.json --point 2"


def test_hovering_over_a_point_describes_it_and_marks_its_row(opened: Reader) -> None:
    marker = opened.marker("by-frontier", 2)
    assert opened.script("return arguments[0].querySelector('title').textContent", marker).startswith("Point 2: 10 of ")
    ActionChains(opened.driver).move_to_element(marker.find_element(By.CSS_SELECTOR, ".target")).perform()
    opened.wait(lambda: opened.driver.find_elements(By.CSS_SELECTOR, "#points tr.near[data-point='2']"))
    ActionChains(opened.driver).move_to_element(opened.driver.find_element(By.ID, "picked-heading")).perform()
    opened.wait(lambda: not opened.driver.find_elements(By.CSS_SELECTOR, ".near"))


def test_arrow_keys_go_from_point_to_point(opened: Reader, frontier: Frontier) -> None:
    assert frontier.picked is not None
    following = frontier.picked + 1
    radio = opened.driver.find_element(By.CSS_SELECTOR, "#points input:checked")
    radio.send_keys(Keys.ARROW_DOWN)
    opened.wait(lambda: opened.said().startswith(f"Point {following}:"))
    assert opened.kept_on_hand() == switches(frontier, following)
    assert opened.picked() == {str(following)}


def test_what_is_picked_is_told_in_words_and_numbers(opened: Reader, frontier: Frontier) -> None:
    opened.driver.find_element(By.CSS_SELECTOR, "#points input[value='10']").click()
    opened.wait(lambda: opened.said().startswith("Point 10:"))
    names = [item.text for item in opened.driver.find_elements(By.CSS_SELECTOR, "#picked-switches li")]
    assert names == switches(frontier, 10)
    facts = opened.driver.find_element(By.ID, "picked-facts").text
    assert "board 1 Mbaud" in facts
    assert "99.2 [98.9, 99.4]" in facts
    summary = opened.driver.find_element(By.ID, "picked-hand-summary").get_attribute("textContent")
    assert summary == opened.said()


def test_colours_follow_the_readers_system_in_page_hand_and_charts(opened: Reader) -> None:
    look = (
        "return [getComputedStyle(document.body).backgroundColor,"
        " getComputedStyle(document.querySelector('#kept-hand .skin')).fill,"
        " getComputedStyle(document.querySelector('#by-frontier .point use')).fill,"
        " getComputedStyle(document.querySelector('#by-frontier text')).fill]"
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
        opened.script("for (const each of document.querySelectorAll('details')) each.open = true")
        assert opened.script("return document.documentElement.scrollWidth") == 400
        assert opened.script(_BROAD) == []
        assert opened.script(_SMALL) == []
    finally:
        opened.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_on_paper_the_report_is_light_and_charts_fit(opened: Reader) -> None:
    features = [{"name": "prefers-color-scheme", "value": "dark"}]
    opened.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print", "features": features})
    try:
        colours = opened.script(
            "return [getComputedStyle(document.body).backgroundColor, getComputedStyle(document.documentElement)"
            ".colorScheme, getComputedStyle(document.querySelector('#by-frontier .point use')).fill]"
        )
        assert colours == ["rgb(255, 255, 255)", "light", "rgb(0, 114, 178)"]
        assert opened.script("return getComputedStyle(document.querySelector('#by-frontier svg')).minWidth") == "0px"
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
    assert {"banner", "navigation", "main", "status"} <= set(roles)
    assert roles.count("main") == 1
    named = [(role, name) for role, name in told if role in {"image", "radio", "table", "region", "link"}]
    assert len(named) > 40
    assert [role for role, name in named if not name] == []


def test_names_that_hold_scripts_run_nothing(
    reader: Reader, nasty: ReportContent, write: Callable[[bytes], Path]
) -> None:
    path = write(report_html(nasty))
    reader.open_file(path)
    reader.driver.find_element(By.CSS_SELECTOR, "#points input[value='1']").click()
    reader.wait(lambda: reader.said().startswith("Point 1:"))
    assert reader.driver.title == "thenar: report of a build"
    assert reader.driver.find_elements(By.TAG_NAME, "img") == []
    names = [item.text for item in reader.driver.find_elements(By.CSS_SELECTOR, "#picked-switches li")]
    assert nasty.frontier is not None
    assert [" ".join(name.split()) for name in switches(nasty.frontier, 1)] == [
        " ".join(name.split()) for name in names
    ]
    charted = reader.driver.find_element(By.ID, "by-frontier").text
    assert "<img src=x onerror=" in charted
    assert reader.log() == []
    assert reader.requests() == [path.as_uri()]

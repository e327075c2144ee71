"""The page of a build as a reader has it: opened from a file in a real browser, clicked, typed at, printed."""

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
    """Return the reader with the tab Report open; at the end nothing may have been complained of or asked for."""
    reader.open_file(path, "#report")
    yield reader
    assert reader.log() == []
    assert reader.requests() == [path.as_uri()]


TABS = ("summary", "report", "try")
# What is shown: tabs that are selected, panels that can be seen, which must agree.
_SHOWN = """return [...document.querySelectorAll("[role=tab][aria-selected=true]")].map((tab) =>
    tab.getAttribute("aria-controls")).concat([...document.querySelectorAll("[role=tabpanel]")]
    .filter((panel) => panel.checkVisibility()).map((panel) => panel.id))"""


def shown(reader: Reader) -> str:
    selected, seen = reader.script(_SHOWN)
    assert selected == seen
    return str(seen)


def test_the_address_chooses_the_tab_and_a_place_in_it(reader: Reader, path: Path) -> None:
    for fragment, tab in {"": "summary", "#try": "try", "#nowhere": "summary", "#faults": "report"}.items():
        reader.open_file(path, fragment)
        assert shown(reader) == tab
    top = "return document.getElementById('faults').getBoundingClientRect().top / innerHeight"
    reader.wait(lambda: 0 <= reader.script(top) < 1)
    reader.driver.find_element(By.ID, "try-tab").click()
    reader.wait(lambda: shown(reader) == "try")
    assert reader.script("return location.hash") == "#try"
    reader.driver.back()
    reader.wait(lambda: shown(reader) == "report")


def test_arrows_home_and_end_move_among_the_tabs_of_which_one_is_a_stop(reader: Reader, path: Path) -> None:
    reader.open_file(path)
    ActionChains(reader.driver).send_keys(Keys.TAB).perform()
    for key, tab in (
        (Keys.ARROW_LEFT, "try"),
        (Keys.ARROW_RIGHT, "summary"),
        (Keys.END, "try"),
        (Keys.HOME, "summary"),
        (Keys.ARROW_RIGHT, "report"),
    ):
        ActionChains(reader.driver).send_keys(key).perform()
        assert shown(reader) == tab
        assert reader.driver.switch_to.active_element.get_attribute("id") == f"{tab}-tab"
    ActionChains(reader.driver).send_keys(Keys.TAB).perform()
    assert reader.driver.switch_to.active_element.text == "Accuracy"


def test_the_summary_is_one_screen_and_marks_the_kept_switches_on_the_hand(
    reader: Reader, path: Path, whole: ReportContent
) -> None:
    reader.open_file(path)
    assert reader.script("return document.documentElement.scrollHeight - innerHeight") <= 0
    names = reader.script(
        "return [...document.querySelectorAll('#kept-hand .closed')].map((one) => one.firstElementChild.parentNode"
        ".querySelector('title').textContent)"
    )
    assert set(names) == set(whole.switch_names)
    hand = reader.driver.find_element(By.ID, "kept-hand")
    said = f"The hand: {len(names)} of 160 switches and 2 of 2 joints are kept"
    assert (hand.get_attribute("role"), hand.get_attribute("aria-label")) == ("img", said)
    assert hand.size["height"] > 100


@pytest.mark.parametrize("tab", TABS)
@pytest.mark.parametrize("width", [1400, 400])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_and_nothing_is_cut(reader: Reader, path: Path, tab: str, width: int, scheme: str) -> None:
    reader.open_file(path, f"#{tab}")
    reader.scheme(scheme)
    metrics = {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": width < 600}
    reader.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    try:
        reader.wait(lambda: reader.script("return document.documentElement.clientWidth") in {width, width - 15})
        reader.script("for (const one of document.querySelectorAll('details')) one.open = true")
        assert reader.axe() == []
        assert reader.script("return document.documentElement.scrollWidth") <= width
        cut = """return [...document.querySelectorAll('.scroll')].filter((one) => one.checkVisibility() && one
            .scrollWidth > one.clientWidth).map((one) => one.ariaLabel)"""
        assert width == 400 or reader.script(cut) == []
    finally:
        reader.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


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
        if (!table.checkVisibility()) return false;
        const box = table.getBoundingClientRect();
        return box.right > document.documentElement.clientWidth + 0.5 || box.width === 0; })
    .map((table) => table.caption.textContent)"""
_SMALL = """return [...document.querySelectorAll('svg text')].filter((text) =>
    text.textContent.trim() && text.checkVisibility())
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
        seen = "return [...document.querySelectorAll('[role=tabpanel]')].map((one) => one.checkVisibility())"
        assert opened.script(seen) == [True, True, False]
        assert colours == ["rgb(255, 255, 255)", "light", "rgb(27, 31, 36)"]
        assert base64.b64decode(opened.driver.print_page()).startswith(b"%PDF")
    finally:
        opened.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})


def test_a_screen_reader_finds_landmarks_and_names(reader: Reader, path: Path) -> None:
    named = []
    for tab in TABS:
        reader.open_file(path, f"#{tab}")
        nodes = reader.driver.execute_cdp_cmd("Accessibility.getFullAXTree", {})["nodes"]
        told = [(node["role"]["value"], node.get("name", {}).get("value", "")) for node in nodes if not node["ignored"]]
        roles = [role for role, _ in told]
        assert {"banner", "main", "tablist", "tab"} <= set(roles)
        assert roles.count("main") == roles.count("tabpanel") == 1
        assert ("navigation" in roles) == (tab == "report")
        named += [(role, name) for role, name in told if role in {"image", "table", "region", "link", "tabpanel"}]
    assert len(named) > 36
    assert [role for role, name in named if not name] == []


def test_names_that_hold_scripts_run_nothing(
    reader: Reader, nasty: ReportContent, write: Callable[[bytes], Path]
) -> None:
    path = write(report_html(nasty))
    reader.open_file(path)
    assert reader.driver.title == "thenar: a build"
    assert reader.driver.find_elements(By.TAG_NAME, "img") == []
    assert "<img src=x onerror=" in reader.driver.find_element(By.TAG_NAME, "body").text
    assert reader.log() == []
    assert reader.requests() == [path.as_uri()]

"""The figures of the documentation as a reader has them: 688 px wide, in a real browser, on light and dark pages."""

import io
import re
import runpy
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from selenium import webdriver

from .test_imports import ALLOWED, PACKAGES

DOCS = Path(__file__).resolve().parents[1] / "docs"
FIGURES = DOCS / "figures"
DRAWINGS = sorted(FIGURES.glob("*.svg"))
EACH = pytest.mark.parametrize("path", DRAWINGS, ids=lambda path: path.stem)
WIDTH_PX, LEAST_PX, OF_DIAGRAMS_PX, LEAST_CONTRAST = 688, 8, 12, 4.5
TOUCH_PX = 0.5  # rectangles that share less than this do not overlap

# Shows the root at a width, and returns its height.
SHOW = """const root = document.documentElement, box = root.viewBox.baseVal;
    const height = arguments[0] * box.height / box.width;
    root.setAttribute('width', arguments[0]); root.setAttribute('height', height); return Math.ceil(height);"""
# Letters are text, or outlines in matplotlib's groups, in hundredths of the font size.
TEXTS = """return [...document.querySelectorAll("text, g[id^='text_'], g[id^='mark-']")].map((one) => {
    const box = one.getBoundingClientRect(), path = one.tagName === 'text' ? null : one.querySelector('use');
    const style = getComputedStyle(path ?? one), scale = (path?.parentNode ?? one).getScreenCTM();
    const size = Math.hypot(scale.a, scale.b) * (path ? 100 : parseFloat(style.fontSize));
    const comment = [...one.childNodes].find((node) => node.nodeType === Node.COMMENT_NODE);
    const words = ((path ? comment : one)?.textContent ?? '').trim();
    return { words, fill: style.fill, size, box: [box.left, box.top, box.right, box.bottom] };
}).filter((one) => one.words)"""
HIDE = """const style = document.createElementNS('http://www.w3.org/2000/svg', 'style');
    style.textContent = "text, g[id^='text_'], g[id^='mark-'] { visibility: hidden }";
    document.documentElement.append(style);"""


@pytest.fixture(scope="module")
def driver(new_chromium: Callable[..., webdriver.Chrome]) -> Iterator[webdriver.Chrome]:
    driver = new_chromium("--hide-scrollbars")
    yield driver
    driver.quit()


def shown(driver: webdriver.Chrome, path: Path, scheme: str) -> int:
    """Open a drawing in a scheme, and return its height in pixels."""
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    driver.get(path.as_uri())
    height = driver.execute_script(SHOW, WIDTH_PX)
    metrics = {"width": WIDTH_PX, "height": height, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    assert isinstance(height, int)
    return height


def texts(driver: webdriver.Chrome) -> list[dict[str, Any]]:
    found = driver.execute_script(TEXTS)
    assert isinstance(found, list)
    return found


def luminance(colour: tuple[int, ...]) -> float:
    """Return the relative luminance of WCAG 2."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (part / 255 for part in colour)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: tuple[int, ...], other: tuple[int, ...]) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def overlap(one: list[float], other: list[float]) -> bool:
    return all(min(one[n + 2], other[n + 2]) - max(one[n], other[n]) > TOUCH_PX for n in (0, 1))


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return the names of docs/figures/diagrams.py."""
    monkeypatch.syspath_prepend(str(FIGURES))
    return runpy.run_path(str(FIGURES / "diagrams.py"))


@pytest.mark.slow
@EACH
def test_labels_are_large_enough_and_neither_overlap_nor_leave_the_picture(
    driver: webdriver.Chrome, path: Path, script: dict[str, Any]
) -> None:
    height, found = shown(driver, path, "light"), texts(driver)
    assert found
    least = OF_DIAGRAMS_PX if path.stem in script["DIAGRAMS"] else LEAST_PX
    assert not [one for one in found if one["size"] < least]
    edges = (WIDTH_PX, height)
    assert not [one for one in found if min(one["box"][:2]) < 0 or one["box"][2] > edges[0] or one["box"][3] > edges[1]]
    assert not [(a["words"], b["words"]) for a, b in combinations(found, 2) if overlap(a["box"], b["box"])]


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
@EACH
def test_letters_contrast_with_what_is_behind_them(driver: webdriver.Chrome, path: Path, scheme: str) -> None:
    shown(driver, path, scheme)
    found = texts(driver)
    driver.execute_script(HIDE)
    with Image.open(io.BytesIO(driver.get_screenshot_as_png())) as screen:
        behind = screen.convert("RGB")
    low = {}
    for one in found:
        colour = tuple(map(int, re.findall(r"\d+", one["fill"])))
        assert len(colour) == 3, f"{one['words']} is transparent: {one['fill']}"
        pixels: list[Any] = list(behind.crop(tuple(map(round, one["box"]))).get_flattened_data())
        ratio = contrast(colour, Counter(pixels).most_common(1)[0][0])
        if ratio < LEAST_CONTRAST:
            low[one["words"]] = round(ratio, 2)
    assert not low


def test_every_figure_has_both_schemes() -> None:
    adapted = runpy.run_path(str(FIGURES / "adapt.py"))["adapted"]
    drawings = {path.name: path.read_text(encoding="utf-8") for path in DRAWINGS}
    differing = [name for name, drawing in drawings.items() if adapted(drawing) != drawing]
    assert not differing, "run: python docs/figures/adapt.py docs/figures/*.svg"


def test_the_diagrams_are_what_their_script_draws() -> None:
    subprocess.run([sys.executable, str(FIGURES / "diagrams.py"), "--check"], check=True)


def test_the_diagram_of_folders_shows_the_imports_that_are_allowed(script: dict[str, Any]) -> None:
    allowed: dict[str, set[str]] = {folder: set() for folder in PACKAGES}
    for room, imported in ALLOWED.items():
        folder = room.split(".")[0]
        allowed[folder] |= {name.split(".")[0] for name in imported} - {folder}
    assert {folder: set(script["IMPORTS"].get(folder, ())) for folder in script["FOLDERS"]} == allowed


def test_every_figure_is_on_a_page() -> None:
    pages = [DOCS.parent / "README.md", *DOCS.rglob("*.md")]
    named = {name for page in pages for name in re.findall(r"figures/([\w-]+\.(?:svg|png))", page.read_text("utf-8"))}
    assert named == {path.name for path in FIGURES.iterdir() if path.suffix in (".svg", ".png")}

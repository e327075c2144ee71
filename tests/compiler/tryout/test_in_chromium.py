"""The tab Try as a visitor has it: opened from its file in a real browser, clicked, typed at."""

import csv
import io
import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement

from thenar.compiler import GraspSet, compile_build
from thenar.compiler.artifact.documents import Documents
from thenar.compiler.recordings.export import to_csv
from thenar.compiler.recordings.graspset import Joint
from thenar.compiler.recordings.taxonomy import own
from thenar.compiler.report import tryout
from thenar.runtime import Build
from thenar.runtime.manifest import Calibration
from thenar.runtime.model.integers import PAIRED, PLAIN, SLOPED
from thenar.simulator.handmaps.handmap import hand_map

from ...browser import Browser
from ..conftest import make_set, with_none

pytestmark = pytest.mark.slow


class Trier(Browser):
    """A browser with one page to try open."""

    def one(self, selector: str) -> WebElement:
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def text(self, ident: str) -> str:
        return self.driver.find_element(By.ID, ident).text


@pytest.fixture(scope="module")
def trier(new_chromium: Callable[..., webdriver.Chrome]) -> Iterator[Trier]:
    driver = new_chromium("--window-size=1400,1000", logs=("browser", "performance"))
    yield Trier(driver)
    driver.quit()


ASK = "return arguments[0].map(([bits, codes, lost, lost_joints]) => thenar.recognise(bits, codes, lost, lost_joints))"


def rows_of(build: Build, grasp_set: GraspSet) -> tuple[np.ndarray, np.ndarray]:
    """Return the bits and the codes of all rows of a set, as the build reads them."""
    columns = [
        grasp_set.switches[:, switch.column]
        if switch.threshold is None
        else grasp_set.taxels[:, switch.threshold.taxel.column] > switch.threshold.code
        for switch in build.manifest.switches
    ]
    bits = np.stack(columns, axis=1)
    return bits, grasp_set.codes[:, [joint.column for joint in build.manifest.joints]]


def frames_of(build: Build, grasp_set: GraspSet, lossy: bool) -> list[list[list[int]]]:
    """Return frames: bits, codes, and what is lost of both; of losses, each input in every seventh row."""
    bits, codes = rows_of(build, grasp_set)
    random = np.random.default_rng(11)
    lost, lost_joints = (lossy & (random.random(shape) < 1 / 7) for shape in (bits.shape, codes.shape))
    parts = (bits.astype(int), codes.astype(int), lost.astype(int), lost_joints.astype(int))
    return [[part.tolist() for part in row] for row in zip(*parts, strict=True)]


def differing(build: Build, frames: list[list[list[int]]], answers: list[dict[str, Any]]) -> list[int]:
    """Return the numbers of the frames of which the page says something else than Python."""
    found = []
    for number, ((bits, codes, lost, lost_joints), told) in enumerate(zip(frames, answers, strict=True)):
        flags = [np.array(each, bool) for each in (bits, lost, lost_joints)]
        said = build.recognise(flags[0], np.array(codes, np.uint16), flags[1], flags[2])
        lanes = build.scorer.biased_scores(flags[0], np.array(codes, np.uint16), flags[1], flags[2])
        scores = [lane - 32768 for lane in lanes]
        whole = (said.grasp, said.margin, said.degraded) == (told["grasp"], told["margin"], told["degraded"])
        probable = abs(said.probability - told["probabilities"][told["number"]]) < 1e-12
        if not (whole and probable and told["scores"][: len(scores)] == scores):
            found.append(number)
    return found


@pytest.fixture(scope="module")
def with_none_too() -> GraspSet:
    return with_none(make_set(rows=60))


KINDS: dict[str, tuple[int, dict[str, Any]]] = {
    "plain": (PLAIN, {"trainer": "logitboost", "rounds": 8}),
    "slopes": (SLOPED, {"trainer": "linear"}),
    "pairs": (PAIRED, {"trainer": "pairs"}),
}


def compiled(grasp_set: GraspSet, folder: Path, **options: Any) -> Build:
    compile_build(grasp_set, folder, folds=0, documents=Documents(), **options)
    return Build.load(folder)


@pytest.mark.parametrize("kind", KINDS)
def test_all_rows_have_pythons_scores_and_answers(trier: Trier, tmp_path: Path, kind: str) -> None:
    version, options = KINDS[kind]
    grasp_set = make_set()
    build = compiled(grasp_set, tmp_path / "build", **options)
    assert (tmp_path / "build" / "tables.bin").read_bytes()[8] == version
    trier.open_file(tmp_path / "build" / "report.html", "#try")
    for lossy in (False, True):
        frames = frames_of(build, grasp_set, lossy)
        assert differing(build, frames, trier.script(ASK, frames)) == []
    assert trier.log() == []


def test_the_page_predicts_none_as_python_does(trier: Trier, with_none_too: GraspSet, tmp_path: Path) -> None:
    for name, grasp_set in (("class", with_none_too), ("refusing", make_set())):
        build = compiled(grasp_set, tmp_path / name, rounds=8)
        assert (build.scorer.rejector is None) == (name == "class")
        trier.open_file(tmp_path / name / "report.html", "#try")
        warned = trier.script("return document.getElementById('empty-hand')?.checkVisibility() ?? false")
        assert warned == (name == "refusing")
        frames = frames_of(build, grasp_set, lossy=True)
        # Nothing closed, everything closed: unlike all grasps.
        s, j = build.tables.n_switches, build.tables.n_joints
        frames += [[[bit] * s, [code] * j, [0] * s, [0] * j] for bit in (0, 1) for code in (0, 65535)]
        # Of grasps, more and more switches lost, down to none that is known to be closed.
        frames += [
            [bits, codes, [1] * lost + [0] * (s - lost), lost_joints]
            for lost in range(s + 1)
            for bits, codes, _, lost_joints in frames[:9]
        ]
        answers = trier.script(ASK, frames)
        assert differing(build, frames, answers) == []
        assert "none" in {answer["grasp"] for answer in answers}


# ---- Of the page ----


@pytest.fixture(scope="module")
def gloved() -> GraspSet:
    """Return a set that switches of the shipped glove, and joints of a CyberGlove, have recorded."""
    made = make_set()
    names = ("index_mpj", "index_pij", "thumb_abduction")
    joints = tuple(replace(joint, name=name) for joint, name in zip(made.joints, names, strict=True))
    return replace(made, switch_names=hand_map().names[::11][: len(made.switch_names)], joints=joints)


@pytest.fixture(scope="module")
def folder(gloved: GraspSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    where = tmp_path_factory.mktemp("gloved") / "build"
    compile_build(gloved, where, hand=hand_map(), folds=0, rounds=8, documents=Documents())
    return where


@pytest.fixture
def opened(trier: Trier, folder: Path) -> Iterator[Trier]:
    """Return the browser with the page open; nothing may have been complained of or asked for when the test ends."""
    trier.open_file(folder / "report.html", "#try")
    yield trier
    assert trier.log() == []
    assert trier.requests() == [(folder / "report.html").as_uri()]


def said_of(build: Build, bits: list[int], codes: list[int]) -> tuple[str, str]:
    """Return what Python recognises in the page's words."""
    found = build.recognise(np.array(bits, bool), np.array(codes, np.uint16))
    return found.grasp, f"{100 * found.probability:.1f} %, ahead by {found.margin} steps"


def codes_now(trier: Trier) -> list[int]:
    return [
        int(value)
        for value in trier.script(
            "return [...document.querySelectorAll('#joints [type=range]')].map((one) => one.value)"
        )
    ]


def pressed(trier: Trier) -> list[int]:
    flags = trier.script(
        "return [...document.querySelectorAll('#hand [role=button]')].map((one) => one.getAttribute('aria-pressed'))"
    )
    return [int(flag == "true") for flag in flags]


def bits_now(trier: Trier, build: Build) -> list[int]:
    names = trier.script(
        "return [...document.querySelectorAll('#hand [role=button]')].map((one) => one.getAttribute('aria-label'))"
    )
    closed = dict(zip(names, pressed(trier), strict=True))
    return [closed[switch.name] for switch in build.manifest.switches]


def test_a_click_on_a_switch_closes_it_and_the_answer_is_pythons(opened: Trier, folder: Path) -> None:
    build = Build.load(folder)
    buttons = opened.driver.find_elements(By.CSS_SELECTOR, "#hand [role=button]")
    assert len(buttons) == build.tables.n_switches
    for button in (buttons[0], buttons[-1]):
        button.find_element(By.CSS_SELECTOR, ".area").click()
        assert (opened.text("grasp"), opened.text("margin")) == said_of(
            build, bits_now(opened, build), codes_now(opened)
        )
    assert sum(pressed(opened)) == 2
    opened.one("#open-all").click()
    assert sum(pressed(opened)) == 0


def test_the_keyboard_alone_reaches_and_works_everything(opened: Trier, folder: Path) -> None:
    build, body = Build.load(folder), opened.one("body")
    body.send_keys(Keys.TAB)
    reached = []
    for _ in range(200):
        focused = opened.driver.switch_to.active_element
        if focused.tag_name == "body":
            break
        reached.append(focused)
        if focused.get_attribute("role") == "button" and len(reached) % 2:
            focused.send_keys(Keys.SPACE if len(reached) % 3 else Keys.ENTER)
        elif (focused.get_attribute("id") or "").startswith("joint-"):
            focused.send_keys(Keys.ARROW_RIGHT)
        ActionChains(opened.driver).send_keys(Keys.TAB).perform()
    identities = {one.get_attribute("id") for one in reached}
    assert {"lose", "open-all", "joint-0", "row", "play", "file"} <= identities
    assert sum(one.get_attribute("role") == "button" for one in reached) == build.tables.n_switches
    assert sum(pressed(opened)) > 0
    assert (opened.text("grasp"), opened.text("margin")) == said_of(build, bits_now(opened, build), codes_now(opened))


def test_rows_are_replayed_and_the_bars_show_all_answers(opened: Trier, folder: Path, gloved: GraspSet) -> None:
    build = Build.load(folder)
    assert re.match(
        r"Recorded rows in this page: 96 rows, of 96 with a known grasp \d+ are recognised\.", opened.text("rows-said")
    )
    opened.script("const row = document.getElementById('row'); row.value = 9; row.dispatchEvent(new Event('input'))")
    assert opened.text("truth").startswith("Row 10 of 96: was ")
    bits, codes = bits_now(opened, build), codes_now(opened)
    kept, joints = rows_of(build, gloved)
    at = [row for row in range(len(gloved)) if kept[row].astype(int).tolist() == bits and joints[row].tolist() == codes]
    assert gloved.grasps[at[0]] in opened.text("truth")
    assert (opened.text("grasp"), opened.text("margin")) == said_of(build, bits, codes)
    rows = [row.text for row in opened.driver.find_elements(By.CSS_SELECTOR, "#bars tr")]
    assert [row.removeprefix("▶ ").split()[0] for row in rows] == list(build.manifest.classes)
    (best,) = [row for row in rows if row.startswith("▶")]
    assert best.split()[1] == opened.text("grasp")
    opened.one("#play").click()
    opened.wait(lambda: not opened.text("truth").startswith("Row 10 of"))
    opened.one("#play").click()


def test_a_table_that_the_visitor_opens_is_recognised_as_python_does(
    opened: Trier, folder: Path, gloved: GraspSet, tmp_path: Path
) -> None:
    build, path = Build.load(folder), tmp_path / "rows.csv"
    path.write_text(to_csv(gloved))
    opened.one("#file").send_keys(str(path))
    bits, codes = rows_of(build, gloved)
    right = sum(build.classify(*row) == truth for *row, truth in zip(bits, codes, gloved.grasps, strict=True))
    opened.wait(
        lambda: opened.text("rows-said") == f"rows.csv: 96 rows, of 96 with a known grasp {right} are recognised."
    )
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    opened.one("#file").send_keys(str(tmp_path / "other.csv"))
    opened.wait(lambda: "other.csv has none of the build's columns, such as" in opened.text("rows-said"))


def test_a_lost_switch_counts_by_its_mean(opened: Trier, folder: Path) -> None:
    build = Build.load(folder)
    opened.one("#lose").click()
    name = opened.one("#hand [role=button]").get_attribute("aria-label")
    opened.one("#hand [role=button] .area").click()
    lost = np.array([switch.name == name for switch in build.manifest.switches])
    found = build.recognise(np.zeros(len(lost), bool), np.array(codes_now(opened), np.uint16), lost, None)
    assert opened.text("margin").startswith(
        f"{100 * found.probability:.1f} %, ahead by {found.margin} steps; degraded: 1 input is lost"
    )


def test_a_taxel_goes_from_level_to_level_and_recorded_values_are_levels(trier: Trier, tmp_path: Path) -> None:
    made = make_set()
    held = np.where(made.switches[:, 2:4], 2500, 300) + np.random.default_rng(3).integers(0, 1200, (len(made), 2))
    padded = replace(
        made,
        switches=made.switches[:, :2],
        switch_names=("a", "b"),
        taxels=held.astype(np.uint16),
        taxel_columns=(Joint("pad", "N", 0, 0.0, 4095, 20.0), Joint("pull-up", "V", 0, 5.0, 4095, 0.0)),
    )
    build = compiled(padded, tmp_path / "build", rounds=8, levels=4)
    taxels = Counter(switch.source for switch in build.manifest.switches if switch.threshold is not None)
    name, levels = max(taxels.items(), key=lambda each: each[1])
    assert levels > 1
    trier.open_file(tmp_path / "build" / "report.html", "#try")
    button = trier.one(f"#hand [role=button][aria-label^='{name}']")
    rising = sorted(
        (switch.threshold.code, bit)
        for bit, switch in enumerate(build.manifest.switches)
        if switch.threshold is not None and switch.source == name
    )
    for press in range(1, levels + 2):
        button.find_element(By.CSS_SELECTOR, ".area").click()
        closed = press % (levels + 1)
        assert button.get_attribute("aria-label") == f"{name}, {closed} of {levels} levels closed"
        bits = np.zeros(build.tables.n_switches, np.intp)
        bits[[bit for _, bit in rising[:closed]]] = 1
        assert (trier.text("grasp"), trier.text("margin")) == said_of(build, bits.tolist(), codes_now(trier))
    (tmp_path / "rows.csv").write_text(to_csv(padded))
    trier.one("#file").send_keys(str(tmp_path / "rows.csv"))
    right = sum(
        build.classify(*row) == truth for *row, truth in zip(*rows_of(build, padded), padded.grasps, strict=True)
    )
    said = f"rows.csv: 96 rows, of 96 with a known grasp {right} are recognised."
    trier.wait(lambda: trier.text("rows-said") == said)
    assert trier.log() == []


def test_the_next_misread_row_is_a_button_and_a_key_away(opened: Trier, gloved: GraspSet, tmp_path: Path) -> None:
    wrong = gloved.grasps.copy()
    wrong[[4, 7]] = np.roll(gloved.grasps, 1)[[4, 7]]
    path = tmp_path / "rows.csv"
    path.write_text(to_csv(replace(gloved, grasps=wrong)))
    opened.one("#file").send_keys(str(path))
    opened.wait(lambda: opened.text("rows-said").startswith("rows.csv: 96 rows"))
    misread = opened.script(
        "return [...Array(96).keys()].filter((at) => { const row = document.getElementById('row'); row.value = at;"
        " row.dispatchEvent(new Event('input')); return document.getElementById('truth').textContent.endsWith('✗.') })"
    )
    assert {4, 7} <= set(misread)
    opened.script("const row = document.getElementById('row'); row.value = 4; row.dispatchEvent(new Event('input'))")
    after = [number for number in misread if number > 4]
    seen = []
    for step in range(len(misread)):
        if step % 2:
            opened.one("#misread").click()
        else:
            ActionChains(opened.driver).send_keys("n").perform()
        seen.append(int(re.findall(r"Row (\d+) of 96: was .* mistaken", opened.text("truth"))[0]) - 1)
    assert seen == [*after, *(number for number in misread if number <= 4)]


def test_bars_and_the_best_of_them_are_seen_in_forced_colours(opened: Trier) -> None:
    features = [{"name": "forced-colors", "value": "active"}]
    opened.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    look = """return ['.best .bar', 'tr:not(.best) .bar', 'body'].map((one) => document.querySelector(one))
        .map((one) => getComputedStyle(one)).map((style) => [style.backgroundColor, style.borderTopColor])"""
    (best, best_edge), (other, edge), (page, _) = opened.script(look)
    assert best == best_edge == edge != page
    assert other == page


@pytest.mark.parametrize("width", [1400, 400])
def test_the_page_fits_light_and_dark_screens_with_readable_letters(opened: Trier, width: int) -> None:
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600}
    opened.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    try:
        opened.wait(lambda: opened.script("return innerWidth") == width)
        opened.wait(lambda: opened.script("return document.documentElement.scrollWidth <= innerWidth"))
        small = """return [...document.querySelectorAll('svg text')].filter((text) => {
            const at = text.getScreenCTM();
            return text.checkVisibility() &&
                parseFloat(getComputedStyle(text).fontSize) * Math.hypot(at.a, at.b) < 8; }).length"""
        opened.wait(lambda: opened.script(small) == 0)
        look = """return ['body', '.shut', '.skin'].map((one) => document.querySelector(one))
            .map((one) => getComputedStyle(one).color + getComputedStyle(one).fill)"""
        light = opened.script(look)
        opened.scheme("dark")
        opened.wait(lambda: all(one != other for one, other in zip(light, opened.script(look), strict=True)))
        assert opened.axe() == []
        opened.scheme("light")
        opened.wait(lambda: opened.script(look) == light)
        assert opened.axe() == []
    finally:
        opened.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_names_that_hold_scripts_run_nothing(trier: Trier, tmp_path: Path) -> None:
    made = make_set()
    types = (
        "<script>alert(1)</script>",
        "<img src=x onerror=\"document.title='owned'\">",
        "</script><b>",
        "a & b ${x}",
    )
    nasty = replace(
        made,
        grasps=np.array(types)[made.labels],
        taxonomy=own(types),
        switch_names=tuple(f"{types[number % 4]} {number}" for number in range(len(made.switch_names))),
        joints=tuple(replace(joint, name=f"joint {types[at]}") for at, joint in enumerate(made.joints)),
    )
    compile_build(nasty, tmp_path / "build", folds=0, rounds=8, documents=Documents())
    trier.open_file(tmp_path / "build" / "report.html", "#try")
    assert trier.driver.title == "thenar: a build"
    assert trier.driver.find_elements(By.CSS_SELECTOR, "img, b, main script") == []
    heads = [row.text.removeprefix("▶ ") for row in trier.driver.find_elements(By.CSS_SELECTOR, "#bars th")]
    assert set(types) <= set(heads)
    trier.one("#hand [role=button] .area").click()
    assert trier.log() == []
    assert trier.requests() == [(tmp_path / "build" / "report.html").as_uri()]


# ---- The parts that are Python's, in JavaScript ----

PARTS = ("codeOf", "parseCsv")


@pytest.fixture(scope="module")
def parts(trier: Trier, tmp_path_factory: pytest.TempPathFactory) -> Trier:
    """Return a browser in which `parts` holds functions of the page's modules."""
    modules = [Path(tryout.__file__).with_name("templates") / name for name in ("tables.js", "rows.js")]
    script = "".join(tryout.scoped(module.read_text()) for module in modules)
    page = tmp_path_factory.mktemp("parts") / "parts.html"
    page.write_text(f"<script type=module>{script}globalThis.parts = {{ {', '.join(PARTS)} }};</script>")
    trier.open_file(page)
    return trier


def test_values_become_the_codes_that_python_makes_of_them(parts: Trier) -> None:
    random = np.random.default_rng(6)
    for joint in (
        Calibration(0, "a", "deg", 0, -250.0, 1000, 250.0),
        Calibration(0, "a", "deg", 200, 3.1, 7, 90.7),
        Calibration(0, "a", "raw", 1, 1.0, 255, 255.0),
    ):
        coded = {name: getattr(joint, name) for name in ("name", "unit", "code_a", "value_a", "code_b", "value_b")}
        values = [*random.uniform(-400, 400, 200).tolist(), *np.arange(-30, 30, 0.25).tolist()]
        told = parts.script("return arguments[1].map((value) => parts.codeOf(arguments[0], value))", coded, values)
        recorded = Joint(joint.name, joint.unit, joint.code_a, joint.value_a, joint.code_b, joint.value_b)
        assert told == np.clip(recorded.code(np.array(values)), 0, 65535).astype(int).tolist()


def test_a_table_in_csv_is_split_as_python_splits_it(parts: Trier) -> None:
    text = '\ufeffa,"b ""c"", d",\r\n1,"two\nlines",3\n\n4,,\n'
    assert parts.script("return parts.parseCsv(arguments[0])", text) == [
        row for row in csv.reader(io.StringIO(text.removeprefix("\ufeff"), newline="")) if row
    ]

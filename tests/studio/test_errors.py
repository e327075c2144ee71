"""The page *Errors*, in Chromium as a person uses it, and through its WebSocket as an attacker does."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from thenar.compiler.artifact.compile import compile_build
from thenar.compiler.hand import HandShape
from thenar.compiler.recordings.edits import read_edits, trials_of
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import select_inputs
from thenar.runtime import Build
from thenar.runtime.recipe import Recipe
from thenar.studio.edits import change
from thenar.studio.errors import BuildReading
from thenar.studio.project import Project
from thenar.studio.quick import QuickAccuracy
from thenar.studio.studio import Report, Studio

from ..browser import PATIENCE_S, Browser
from ..sets import grasp_set_of, single_settings
from .test_choose import answers

Start = Callable[..., Studio]
ALL = {"do": "errors", "sensors": list(range(10))}
MARGIN = 14  # of the map, in pixels


def open_errors(browser: Browser, opened: Studio, **options: Any) -> None:
    """Open the page, with all sensors."""
    browser.open(f"{opened.server.url}errors.html", **options)
    browser.wait(lambda: "trials misread" in browser.text("about"))
    use(browser, "all", "10 sensors")


def choose_two(browser: Browser, opened: Studio) -> None:
    """Choose sensors 2 and 8 on the page Choose."""
    browser.open(opened.server.url)
    browser.wait(lambda: browser.text("count") == "0 of 10")
    for sensor in (2, 8):
        browser.driver.find_elements(By.CSS_SELECTOR, "#list input")[sensor].click()
    browser.wait(lambda: browser.text("count") == "2 of 10")


def use(browser: Browser, what: str, said: str) -> None:
    """Choose what recognises, and wait until the page says that it does."""
    browser.driver.find_element(By.CSS_SELECTOR, f"#of option[value={what}]").click()
    browser.wait(lambda: said in browser.text("about"))


def said(browser: Browser, selector: str) -> list[str]:
    """Return what a screen reader says of elements: their texts without the codes of types."""
    script = """return [...document.querySelectorAll(arguments[0])].map((element) => {
        const copy = element.cloneNode(true);
        copy.querySelectorAll("[aria-hidden]").forEach((hidden) => hidden.remove());
        return copy.textContent.replace(/\\s+/g, " ").trim();
    })"""
    return list(browser.script(script, selector))


def cards(browser: Browser, number: int) -> None:
    """Wait until so many trials are shown."""
    browser.wait(lambda: len(browser.texts("#trials article")) == number)


def errors_of(opened: Studio, asked: dict[str, Any] = ALL) -> dict[str, Any]:
    """Return what is recognised as what."""
    return answers(opened, asked)[-1]


def misread(reply: dict[str, Any]) -> list[int]:
    """Return the numbers of misread trials."""
    return np.flatnonzero(np.array(reply["truth"]) != np.array(reply["read"])).tolist()


def on_map(browser: Browser, reply: dict[str, Any]) -> NDArray[np.int64]:
    """Return where trials (T, 2) are on the map, in pixels from its middle, as the driver counts."""
    browser.script("document.getElementById('map').scrollIntoView({block: 'center'})")
    size = np.array(browser.script("const m = document.getElementById('map'); return [m.clientWidth, m.clientHeight]"))
    places = np.array(reply["places"])
    shares = (places - places.min(axis=0)) / np.ptp(places, axis=0)
    shares[:, 1] = 1 - shares[:, 1]
    found: NDArray[np.int64] = np.round(MARGIN + shares * (size - 2 * MARGIN) - size / 2).astype(np.int64)
    return found


def loop(browser: Browser, corners: list[tuple[int, int]]) -> None:
    """Draw a line around a part of the map by mouse."""
    canvas = browser.driver.find_element(By.ID, "map")
    drawn = ActionChains(browser.driver, duration=20).move_to_element_with_offset(canvas, *corners[0]).click_and_hold()
    for corner in corners[1:]:
        drawn.move_to_element_with_offset(canvas, *corner)
    drawn.release().perform()


def test_a_number_of_the_matrix_shows_its_trials_as_hands(browser: Browser, studio: Start) -> None:
    opened = studio()
    open_errors(browser, opened)
    wrong = misread(errors_of(opened))
    counts = {
        tuple(str(made.get_attribute("aria-label")).partition(" trials of ")[2].split(" recognised as ")): int(
            made.text
        )
        for made in browser.driver.find_elements(By.CSS_SELECTOR, "#confusion td button")
    }
    assert sum(counts.values()) == 72
    assert sum(count for (truth, read), count in counts.items() if truth != read) == len(wrong)
    (truth, read), count = next((pair, count) for pair, count in counts.items() if len({*pair}) == 2)
    cell = f"[aria-label='{count} trials of {truth} recognised as {read}']"
    browser.driver.find_element(By.CSS_SELECTOR, cell).send_keys(Keys.ENTER)
    cards(browser, count)
    assert said(browser, "#trials article > p") == [f"{truth} recognised as {read}"] * count
    assert said(browser, "#trials figcaption") == [f"{truth}, typically", f"{read}, typically"]
    for number in range(1, count + 1):
        decided = said(browser, f"#trials article:nth-of-type({number}) li")
        assert 1 <= len(decided) <= 3
        assert all(f" ({truth} " in one and f", {read} " in one for one in decided)
    browser.wait(lambda: len(browser.texts("#trials .skin")) >= 2)
    more = str(browser.driver.find_element(By.ID, "more").get_attribute("href"))
    assert more.endswith(f"record.html?type={truth}&type={read}&repetitions=5")


def test_the_name_of_a_row_selects_its_errors(browser: Browser, studio: Start) -> None:
    opened = studio()
    open_errors(browser, opened)
    reply = errors_of(opened)
    heads = browser.driver.find_elements(By.CSS_SELECTOR, "#confusion th button")
    for kind, head in enumerate(heads):
        wrong = [trial for trial in misread(reply) if reply["truth"][trial] == kind]
        assert head.is_enabled() == bool(wrong)
        if wrong:
            head.send_keys(Keys.ENTER)
            cards(browser, len(wrong))
            assert {text.split(" ")[0] for text in said(browser, "#trials article > p")} == {reply["types"][kind]}


def test_errors_follow_each_other_by_key_and_by_button(browser: Browser, studio: Start) -> None:
    opened = studio()
    open_errors(browser, opened)
    wrong, trials = misread(errors_of(opened)), answers(opened)[0]["trials"]
    body = browser.driver.find_element(By.TAG_NAME, "body")

    def heads(trial: int) -> None:
        browser.wait(lambda: browser.text("selection-heading").startswith(f"{trials[trial]}: "))
        cards(browser, 1)

    body.send_keys("n")
    heads(wrong[0])
    browser.click("next")
    heads(wrong[1])
    body.send_keys("p")
    heads(wrong[0])
    browser.click("previous")
    heads(wrong[-1])
    browser.click("all-errors")
    cards(browser, min(len(wrong), 24))
    assert browser.text("selection-heading") == f"{len(wrong)} trials selected"


def test_the_map_is_pointed_at_clicked_and_encircled(browser: Browser, studio: Start) -> None:
    """By mouse, by a finger, and by keyboard."""
    opened = studio()
    open_errors(browser, opened)
    reply, trials = errors_of(opened), answers(opened)[0]["trials"]
    canvas, places = browser.driver.find_element(By.ID, "map"), on_map(browser, reply)
    # The loneliest trial, which nobody can confuse with another.
    apart = np.hypot(*(places[:, np.newaxis] - places).transpose(2, 0, 1)) + 1e6 * np.eye(len(places))
    lone = int(apart.min(axis=1).argmax())
    ActionChains(browser.driver).move_to_element_with_offset(canvas, *places[lone].tolist()).perform()
    browser.wait(lambda: browser.text("pointed").startswith(f"{trials[lone]}: "))
    ActionChains(browser.driver).click().perform()
    cards(browser, 1)
    assert browser.text("selection-heading").startswith(f"{trials[lone]}: ")
    right = int(places[:, 0].max()) + 5
    low, high = int(places[:, 1].min()) - 5, int(places[:, 1].max()) + 5
    inside = np.count_nonzero(places[:, 0] > 0)
    assert 0 < inside < 72
    line = [(0, low), (right, low), (right, high), (0, high)]
    loop(browser, line)
    browser.wait(lambda: browser.text("selection-heading") == f"{inside} trials selected")
    # A line that begins on selected text would drag this.
    assert browser.script("return String(getSelection())") == ""
    browser.driver.find_element(By.TAG_NAME, "body").send_keys("n")
    cards(browser, 1)
    on_map(browser, reply)
    finger(browser, line)
    browser.wait(lambda: browser.text("selection-heading") == f"{inside} trials selected")
    # Up or down, it scrolls.
    on_map(browser, reply)
    at = scrolled(browser)
    finger(browser, [(0, -100), (0, 100)])
    browser.wait(lambda: scrolled(browser) < at - 50)
    assert browser.text("selection-heading") == f"{inside} trials selected"
    canvas.send_keys(Keys.ARROW_RIGHT)
    for key in (Keys.ARROW_LEFT, Keys.ARROW_RIGHT, Keys.ARROW_UP, Keys.ARROW_DOWN):
        canvas.send_keys(key)
        browser.wait(lambda: browser.text("pointed").strip())
    named, large = browser.text("pointed"), radius(browser, ".pointed")
    assert large > radius(browser, ".selected:not(.pointed)")
    canvas.send_keys(Keys.ENTER)
    browser.wait(lambda: browser.text("selection-heading") == named)
    assert radius(browser, ".pointed.selected") == large


def radius(browser: Browser, mark: str) -> float:
    """Return the radius of the first mark on the map that a selector finds, in pixels."""
    script = "return parseFloat(getComputedStyle(document.querySelector(`#map ${arguments[0]}`)).r)"
    return float(browser.script(script, mark))


def test_two_fingers_enlarge_the_map(browser: Browser, studio: Start) -> None:
    opened = studio()
    open_errors(browser, opened, width=400)
    on_map(browser, errors_of(opened))
    finger(browser, [(-10, 0), (-120, -80)], [(10, 0), (120, 80)])
    browser.wait(lambda: browser.script("return visualViewport.scale") > 1.5)
    assert browser.text("selection-heading") == "No trial selected"


def finger(browser: Browser, *lines: list[tuple[int, int]]) -> None:
    """Draw a line on the map with a finger, or several lines of as many corners with several."""
    script = """const { x, y, width, height } = document.getElementById("map").getBoundingClientRect();
        return [x + width / 2, y + height / 2]"""
    x, y = browser.script(script)
    corners = np.array(lines)
    for share in np.arange(0, len(lines[0]) - 1, 0.1):
        corner, rest = int(share), share % 1
        places = corners[:, corner] + rest * (corners[:, corner + 1] - corners[:, corner])
        points = [{"x": x + float(place[0]), "y": y + float(place[1]), "id": at} for at, place in enumerate(places)]
        touch = {"type": "touchMove" if share else "touchStart", "touchPoints": points}
        browser.driver.execute_cdp_cmd("Input.dispatchTouchEvent", touch)
    browser.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def scrolled(browser: Browser) -> float:
    """Return how far the page is scrolled, in pixels."""
    return float(browser.script("return scrollY"))


def test_trials_are_relabelled_left_out_and_taken_back(browser: Browser, studio: Start, tmp_path: Path) -> None:
    """The recording stays, and the log says what was done; a server that starts again knows it."""
    opened, folder = studio(), tmp_path / "recorded"
    recording, two = (folder / "set.grasps").read_bytes(), {"do": "errors", "sensors": [2, 8]}
    choose_two(browser, opened)
    browser.driver.get(f"{opened.server.url}errors.html")
    browser.wait(lambda: "2 sensors" in browser.text("about"))
    reply = errors_of(opened, two)
    browser.driver.find_element(By.TAG_NAME, "body").send_keys("n")
    cards(browser, 1)
    heading, trial = browser.text("selection-heading"), misread(reply)[0]
    truth, read = (reply["types"][reply[what][trial]] for what in ("truth", "read"))
    assert browser.script("return document.getElementById('type').value") == read
    browser.click("relabel")
    browser.wait(lambda: f"of set.grasps made {read}." in browser.text("edited"))
    total = {name: reply["truth"].count(kind) for kind, name in enumerate(reply["types"])}
    browser.wait(lambda: errors_of(opened, two)["truth"].count(reply["types"].index(read)) == total[read] + 1)
    browser.wait(lambda: browser.text("selection-heading") == "No trial selected")
    # All misread trials, but for the one whose box is cleared.
    several = len(misread(errors_of(opened, two)))
    assert 1 < several <= 24
    browser.wait(lambda: f"{several} of 72 trials misread" in browser.text("about"))
    browser.click("all-errors")
    cards(browser, several)
    browser.driver.find_element(By.CSS_SELECTOR, "#trials input").send_keys(Keys.SPACE)
    assert browser.text("drop") == f"Leave out {several - 1} trial{'s' * (several > 2)}"
    browser.click("drop")
    browser.wait(lambda: "left out." in browser.text("edited"))
    browser.wait(lambda: len(errors_of(opened, two)["truth"]) == 72 - several + 1)
    edits = read_edits(folder / "edits.jsonl")[0]
    assert [edit.action for edit in edits] == [1] + [2] * (several - 1)
    assert (edits[0].old, edits[0].new, {edit.new for edit in edits[1:]}) == (truth, read, {""})
    assert len(Project(folder, opened.project.hand()).recordings()[0]) == 72 - several + 1
    browser.click("undo")
    browser.wait(lambda: browser.text("edited").endswith(f"made {read}."))
    browser.click("undo")
    browser.wait(lambda: not browser.driver.find_element(By.ID, "undo").is_enabled())
    browser.wait(lambda: errors_of(opened, two) == reply)
    browser.driver.find_element(By.TAG_NAME, "body").send_keys("n")
    browser.wait(lambda: browser.text("selection-heading") == heading)
    assert (folder / "set.grasps").read_bytes() == recording


def test_an_edit_waits_for_work_that_goes_on(browser: Browser, studio: Start) -> None:
    opened, ended = studio(), Event()
    open_errors(browser, opened)

    def work(_: Report) -> None:
        assert ended.wait(PATIENCE_S)

    opened.queue("train", work)
    browser.wait(lambda: browser.text("busy").startswith("Edits are shown here when"))
    browser.click("all-errors")
    browser.wait(lambda: browser.texts("#trials article"))
    browser.click("drop")
    browser.wait(lambda: "left out." in browser.text("edited"))
    assert "of 72 trials misread" in browser.text("about")
    ended.set()
    browser.wait(lambda: "of 72 trials misread" not in browser.text("about"))
    browser.wait(lambda: not browser.text("busy"))


@pytest.mark.parametrize("width", [400, 1000, 1920])
def test_a_refusal_is_seen_wherever_the_page_is_scrolled(browser: Browser, studio: Start, width: int) -> None:
    """It is read out, and hides nothing that has the focus."""
    open_errors(browser, studio(), width=width)
    browser.driver.find_element(By.TAG_NAME, "body").send_keys("n")
    cards(browser, 1)
    truth = said(browser, "#trials article > p")[0].split(" ")[0]
    browser.driver.find_element(By.CSS_SELECTOR, f"#type option[value={truth}]").click()
    browser.driver.find_element(By.ID, "relabel").send_keys(Keys.ENTER)
    browser.wait(lambda: browser.text("refused") == f"these trials are {truth} already")
    script = """const [id, share] = arguments, element = document.getElementById(id);
        const height = document.documentElement.scrollHeight - innerHeight;
        scrollTo(0, share * height);
        if (id !== "refused") element.focus();
        const { x, y, width, height: high, bottom } = element.getBoundingClientRect();
        const seen = document.elementFromPoint(x + width / 2, y + high / 2);
        return height > 200 && y >= 0 && bottom <= innerHeight && element.contains(seen)"""
    for share in (0, 0.3, 0.7, 1):
        assert browser.script(script, "refused", share)
        assert browser.axe() == []
    for name in ("of", "next", "map", "relabel"):
        assert browser.script(script, name, 1), name
    assert browser.script("return document.getElementById('refused').role") == "alert"
    assert browser.script("return document.documentElement.scrollWidth <= innerWidth")
    browser.picture(f"refused-{width}")
    browser.driver.find_element(By.TAG_NAME, "body").send_keys("n")
    browser.wait(lambda: not browser.text("refused"))


def test_the_next_error_follows_the_one_that_was_left_out(browser: Browser, studio: Start) -> None:
    opened = studio()
    choose_two(browser, opened)
    browser.driver.get(f"{opened.server.url}errors.html")
    browser.wait(lambda: "2 sensors" in browser.text("about"))
    trials = answers(opened)[0]["trials"]
    wrong = misread(errors_of(opened, {"do": "errors", "sensors": [2, 8]}))
    body = browser.driver.find_element(By.TAG_NAME, "body")
    body.send_keys("nn")
    browser.wait(lambda: browser.text("selection-heading").startswith(f"{trials[wrong[1]]}: "))
    cards(browser, 1)
    browser.click("drop")
    browser.wait(lambda: "of 71 trials misread" in browser.text("about"))
    # Without the trial, others may be recognised otherwise.
    again = misread(errors_of(opened, {"do": "errors", "sensors": [2, 8]}))
    following = next(trial for trial in again if trial >= wrong[1])
    body.send_keys("n")
    browser.wait(lambda: browser.text("selection-heading").startswith(f"{trials[following + 1]}: "))


def test_a_damaged_log_is_said(browser: Browser, studio: Start, people: GraspSet, tmp_path: Path) -> None:
    """A last line that a kill left is ignored; another one has to be corrected."""
    opened, log = studio(), tmp_path / "recorded" / "edits.jsonl"
    change(log, [trials_of("set.grasps", people)[0]], "")
    whole = log.read_text()
    log.write_text(whole + whole[:30])
    opened.changed()
    open_errors(browser, opened)
    browser.wait(lambda: browser.texts("#unused li") == [f"{log}: line 2, the last, is damaged, and was ignored"])
    assert browser.text("about").endswith("of 71 trials misread")
    log.write_text(whole[:30] + "\n" + whole)
    opened.changed()
    browser.wait(lambda: browser.text("empty").startswith(f"{log}: line 1 is no edit: "))
    assert browser.axe() == []
    # Nothing is appended to it.
    *_, refused = answers(opened, {"do": "undo"})
    assert f"{log}: line 1 is no edit" in refused["why"]


def test_the_sensors_of_choose_are_used_also_after_a_reload(browser: Browser, studio: Start) -> None:
    opened = studio()
    choose_two(browser, opened)
    rate = browser.text("rate")
    browser.driver.refresh()
    browser.wait(lambda: browser.text("rate") == rate)
    browser.driver.find_element(By.CSS_SELECTOR, "a[href='errors.html']").click()
    browser.wait(lambda: "2 sensors" in browser.text("about"))
    assert browser.text("rate") == rate


def test_an_address_names_a_trial(browser: Browser, studio: Start) -> None:
    """As the page Compare links to it; a reload does not come back to it."""
    opened = studio()
    browser.open(f"{opened.server.url}errors.html#trial%2017%20of%20A%2C%20thing%3A%20rod")
    cards(browser, 1)
    assert browser.text("selection-heading").startswith("trial 17 of A, thing: rod")
    assert str(browser.driver.current_url).endswith("errors.html")
    browser.open(f"{opened.server.url}errors.html#%3Cimg%20src%3Dx%3E")
    browser.driver.refresh()
    browser.wait(lambda: str(browser.driver.current_url).endswith("errors.html"))
    browser.wait(lambda: "trials misread" in browser.text("about"))
    assert browser.text("selection-heading") == "No trial selected"


@pytest.fixture(scope="module")
def trained(people: GraspSet, hand: HandShape, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a build of the first three people."""
    folder = tmp_path_factory.mktemp("trained") / "build"
    with single_settings():
        compile_build(people.rows(people.subjects != "D"), folder, Recipe(trainer="logit", sensors=5), jobs=1)
    return folder


def test_a_build_recognises_trials_as_it_does_frames(people: GraspSet, trained: Path) -> None:
    """And a sensor's share in an error is what the scores lose if it shows what it does in trials of the true type."""
    build, quick = Build.load(trained), QuickAccuracy(people)
    reading = BuildReading("build", build, quick)
    bits, codes = select_inputs(people, build.manifest)
    read = [build.classify(*row) for row in zip(bits, codes, strict=True)]
    assert [reading.types[one] for one in reading.found.read] == read
    assert reading.found.mean == np.mean(np.array(read) == people.grasps)
    assert "54 of these 72 trials trained it" in reading.found.of
    wrong = [trial for trial in np.flatnonzero(np.array(read) != people.grasps).tolist() if read[trial] != "none"]
    refused = read.index("none")
    assert wrong
    names = [switch.source for switch in build.manifest.switches] + [joint.name for joint in build.manifest.joints]
    for trial in wrong:
        pair = [build.grasps.index(one) for one in (read[trial], people.grasps[trial])]
        alike = people.grasps == people.grasps[trial]

        def lead(rows: NDArray[np.bool_], values: NDArray[np.uint16], pair: list[int] = pair) -> float:
            scores = build.tables.scores(rows, values)[:, pair].astype(float)
            return float((scores[:, 0] - scores[:, 1]).mean())

        shares = {}
        for place, name in enumerate(names):
            rows, values = np.tile(bits[trial], (alike.sum(), 1)), np.tile(codes[trial], (alike.sum(), 1))
            whole = lead(rows, values)
            if place < len(build.manifest.switches):
                rows[:, place] = bits[alike, place]
            else:
                values[:, place - bits.shape[1]] = codes[alike, place - bits.shape[1]]
            shares[quick.names.index(name)] = whole - lead(rows, values)
        expected = sorted((one for one in shares if shares[one] > 1e-9), key=lambda one: -shares[one])[:3]
        assert reading.decisive(trial) == expected
    right = int(np.flatnonzero(np.array(read) == people.grasps)[0])
    assert reading.decisive(right) == reading.decisive(refused) == []


def test_a_build_says_what_it_was_trained_on(
    browser: Browser, studio: Start, people: GraspSet, trained: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "recorded"
    folder.mkdir()
    (folder / "build").symlink_to(trained)
    opened = studio()
    (build,) = opened.project.members("build")
    open_errors(browser, opened)
    use(browser, f"'{build}'", "build build; 54 of these 72 trials trained it; 5 sensors")
    reply = errors_of(opened, {"do": "errors", "id": build})
    assert browser.text("rate").startswith(f"{100 * reply['mean']:.1f} % [")
    assert "none" in said(browser, "#confusion-table th")
    browser.click("all-errors")
    cards(browser, len(misread(reply)))
    assert said(browser, "#trials article li")
    # A build that cannot read these recordings says so.
    browser.driver.get("about:blank")
    opened.close()
    others = replace(people, switch_names=tuple(f"pad {number}" for number in range(8)))
    opened = studio(others)
    open_errors(browser, opened)
    browser.driver.find_element(By.CSS_SELECTOR, f"#of option[value='{build}']").click()
    browser.wait(lambda: browser.text("refused").startswith("the recordings lack"))
    assert browser.script("return document.getElementById('of').value") == "all"


def test_every_build_of_the_project_can_be_looked_at(
    browser: Browser, studio: Start, two_builds: Path, people: GraspSet, tmp_path: Path
) -> None:
    """Also one that is not in use; what a damaged one lacks is said, and the page goes on as it was."""
    folder = tmp_path / "recorded"
    shutil.copytree(two_builds, folder)
    opened = studio()
    ids = {path.name: member for member, path in opened.project.members("build").items()}
    open_errors(browser, opened)
    browser.wait(lambda: browser.texts("#of option")[2:] == ["build few", "build more"])
    for name, count in (("few", 3), ("more", 4)):
        use(browser, f"'{ids[name]}'", f"build {name}; 36 of these 72 trials trained it; {count} sensors")
        build = Build.load(folder / name)
        rows = zip(*select_inputs(people, build.manifest), strict=True)
        reply = errors_of(opened, {"do": "errors", "id": ids[name]})
        assert [reply["types"][one] for one in reply["read"]] == [build.classify(*row) for row in rows]
    browser.click("all-errors")
    cards(browser, min(len(misread(reply)), 24))
    # Joints are marked, too, whose places nobody knows.
    assert 0 < len(said(browser, "#trials article li")) == len(said(browser, "#trials .decisive title"))
    assert browser.axe() == []
    # What the build recognised before cannot be edited once other recordings are in use, which it cannot read.
    replace(people, switches=people.switches[:, :1], switch_names=people.switch_names[:1]).save(folder / "set.grasps")
    opened.changed()
    browser.wait(lambda: browser.script("return document.getElementById('of').value") == "chosen")
    browser.wait(lambda: browser.text("selection-heading") == "No trial selected")
    people.save(folder / "set.grasps")
    opened.changed()
    use(browser, f"'{ids['more']}'", "build more")
    (folder / "few" / "tables.bin").write_bytes(b"")
    opened.changed()
    browser.wait(lambda: errors_of(opened, {"do": "errors", "id": ids["few"]})["topic"] == "refused")
    browser.driver.find_element(By.CSS_SELECTOR, f"#of option[value='{ids['few']}']").click()
    browser.wait(lambda: "tables.bin" in browser.text("refused"))
    assert "build more" in browser.text("about")
    browser.wait(lambda: browser.script("return document.getElementById('of').value") == ids["more"])


@pytest.mark.parametrize(("width", "scheme"), [(1400, "light"), (1400, "dark"), (400, "light"), (400, "dark")])
def test_nothing_keeps_people_out_of_any_state(browser: Browser, studio: Start, width: int, scheme: str) -> None:
    open_errors(browser, studio(), width=width, scheme=scheme)
    assert browser.axe() == []
    browser.click("all-errors")
    browser.wait(lambda: browser.texts("#trials article"))
    assert browser.axe() == []
    browser.click("drop")
    browser.wait(lambda: "left out." in browser.text("edited"))
    use(browser, "chosen", "no sensor: choose some")
    assert browser.axe() == []
    assert browser.script("return document.documentElement.scrollWidth <= innerWidth")
    browser.picture(f"errors-{width}-{scheme}")


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        ({"do": "errors", "sensors": [10]}, "there are 10 sensors"),
        ({"do": "errors", "id": "../build"}, "the project has no build '../build'"),
        ({"do": "trials", "trials": [72]}, "there are 72 trials"),
        ({"do": "trials", "trials": [-1], "sensors": [1]}, "there are 72 trials"),
        ({"do": "trials", "trials": [0], "id": "0123456789ab"}, "the project has no build '0123456789ab'"),
        ({"do": "edit", "trials": [0], "name": "cup"}, "the recordings have changed"),
        ({"do": "edit", "trials": [0], "name": "spoon", "id": "it"}, "'spoon' is not a grasp type"),
        ({"do": "edit", "trials": [0], "name": "none", "id": "it"}, "'none' is not a grasp type"),
        ({"do": "edit", "trials": [99], "name": "cup", "id": "it"}, "there are 72 trials"),
        ({"do": "edit", "trials": [], "name": "cup", "id": "it"}, "these trials are cup already"),
        ({"do": "edit", "trials": ["../set.grasps"], "id": "it"}, "invalid message"),
        ({"do": "undo"}, "there is nothing to undo"),
    ],
)
def test_what_a_page_may_not_ask_for_is_refused(studio: Start, tmp_path: Path, asked: dict[str, Any], why: str) -> None:
    opened = studio()
    numbering = answers(opened)[0]["numbering"]
    *_, refused = answers(opened, {**asked, "id": numbering} if asked.get("id") == "it" else asked)
    assert refused["topic"] == "refused"
    assert why in refused["why"]
    assert not (tmp_path / "recorded" / "edits.jsonl").exists()


def busy_ms(browser: Browser) -> float:
    """Return the processor time of the page's main thread so far, which other programs do not change."""
    metrics = browser.driver.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    return 1000 * next(float(metric["value"]) for metric in metrics if metric["name"] == "TaskDuration")


@pytest.mark.slow
def test_a_page_of_four_thousand_trials_scrolls(browser: Browser, studio: Start) -> None:
    """From a choice to the screen it takes less than half a second, and a frame of a scroll less than its 1 / 60 s."""
    random, n = np.random.default_rng(1), 4000
    labels, types = np.arange(n) % 14, [f"type {number}" for number in range(14)]
    closed = (random.random((14, 40)) < 0.4)[labels] ^ (random.random((n, 40)) < 0.35)
    opened = studio(grasp_set_of(types, labels, switches=closed, subjects=np.repeat(["A", "B"], n // 2)))
    browser.driver.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})
    browser.open(f"{opened.server.url}errors.html")
    browser.wait(lambda: "of 4000 trials misread" in browser.text("about"))
    began = busy_ms(browser)
    use(browser, "all", "40 sensors")
    frames_later(browser, 3, 0)
    assert busy_ms(browser) - began < 500
    browser.click("all-errors")
    cards(browser, 24)
    for shown in (48, 72, 96):
        browser.driver.find_element(By.ID, "show-more").send_keys(Keys.ENTER)
        cards(browser, shown)
    began = busy_ms(browser)
    frames_later(browser, 120, 60)
    assert (busy_ms(browser) - began) / 120 < 1000 / 60


def frames_later(browser: Browser, frames: int, pixels: int) -> None:
    """Wait for frames, and scroll so far before each."""
    script = """const [frames, pixels, done] = arguments, panel = document.getElementById("selection");
        let count = 0;
        const step = () => {
            scrollBy(0, pixels);
            panel.scrollBy(0, pixels);
            count += 1;
            if (count < frames) requestAnimationFrame(step);
            else done();
        };
        requestAnimationFrame(step);"""
    browser.driver.execute_async_script(script, frames, pixels)

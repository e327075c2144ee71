"""The page *Live*, in Chromium as a person uses it, with an emulated glove, and through its WebSocket."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from shutil import copytree
from typing import Any

import numpy as np
import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select

from thenar.compiler.artifact.compile import compile_build
from thenar.compiler.artifact.documents import Documents
from thenar.compiler.hand import HandShape
from thenar.compiler.recordings.graspset import GraspSet
from thenar.drivers.emulated.lines import BoardSender, LineServer
from thenar.runtime.build import Build
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.recipe import Recipe
from thenar.runtime.recording.session import Label, Session
from thenar.runtime.recording.writer import Recorder
from thenar.studio.studio import Studio

from ..browser import Browser
from ..sets import single_settings
from .sockets import PATIENCE_S, page

pytestmark = pytest.mark.slow
Start = Callable[..., Studio]
# Their sensors; the glove has no joints.
BUILDS = {"few": (0, 1, 2), "more": (1, 2, 3, 4), "bent": (0, 8)}


@pytest.fixture(scope="module")
def builds(people: GraspSet, hand: HandShape, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with three builds."""
    folder, names = tmp_path_factory.mktemp("builds"), (*people.switch_names, *people.joint_names)
    with single_settings():
        for name, sensors in BUILDS.items():
            recipe = Recipe(sensors=len(sensors), have=tuple(names[one] for one in sensors))
            compile_build(people, folder / name, recipe, documents=Documents(hand), jobs=1)
    return folder


@pytest.fixture
def board(people: GraspSet) -> Iterator[tuple[LineServer, BoardSender]]:
    with LineServer() as line, BoardSender(line.send, people.switch_names, (), 100) as board:
        yield line, board


@pytest.fixture
def project(people: GraspSet, builds: Path, board: tuple[LineServer, BoardSender], tmp_path: Path) -> Path:
    """Return the folder of a project with a glove, builds of which "few" is in use, and a labelled recording."""
    folder, names = tmp_path / "recorded", json.dumps(people.switch_names)
    folder.mkdir()
    for name in BUILDS:
        copytree(builds / name, folder / name)
    glove = f'name = "bench"\n[[stream]]\nport = "{board[0].port}"\nrate_hz = 100\nswitches = {names}\n'
    (folder / "glove.toml").write_text(glove)
    (folder / "studio.json").write_text('{"build": "few"}')
    session = Session(thenar="1", switches=people.switch_names, sensors=(), harness=glove)
    with Recorder(folder / "rec.mcap", session) as recorder:
        for trial, row in enumerate(range(0, 72, 12), 1):
            start, kind = trial * 1_000_000, str(people.grasps[row])
            recorder.label(Label(start, "begun", trial, kind, "A", "cup"))
            for time_us in range(start, start + 1_000_000, 10_000):
                recorder.frame(SwitchFrame(time_us, mask(people.switches[row])))
            recorder.label(Label(start + 999_999, "accepted", trial, kind, "A", "cup"))
    return folder


def mask(bits: Any) -> int:
    return sum(1 << number for number, bit in enumerate(bits) if bit)


def hold(board: BoardSender, people: GraspSet, row: int) -> None:
    """Let the glove's switches be those of a row."""
    board.show({name: int(bit) for name, bit in zip(people.switch_names, people.switches[row], strict=True)})


def recognised(build: Path, people: GraspSet, row: int) -> str:
    """Return what a build recognises in a row."""
    loaded = Build.load(build)
    columns = [people.switch_names.index(switch.name) for switch in loaded.manifest.switches]
    return loaded.recognise(people.switches[row, columns], np.zeros(0, int)).grasp


def open_live(browser: Browser, studio: Studio, query: str = "", **how: Any) -> None:
    browser.open(f"{studio.server.url}live.html{query}", **how)
    browser.wait(lambda: browser.texts("#steer-recording option") == ["rec.mcap"])


def test_the_build_in_use_runs_and_another_takes_its_place(
    browser: Browser, studio: Start, project: Path, people: GraspSet, board: tuple[LineServer, BoardSender]
) -> None:
    opened = studio()
    open_live(browser, opened)
    command = f"thenar run {project}/few --glove {project}/glove.toml --web"
    browser.wait(lambda: browser.text("run-command") == command)
    browser.wait(lambda: browser.text("glove-state") == "glove: not in use")
    assert browser.axe() == []
    # Two rows that the builds read differently.
    rows = [
        row
        for row in range(72)
        if recognised(project / "few", people, row) != recognised(project / "more", people, row)
    ]
    hold(board[1], people, rows[0])
    browser.click("steer-run")
    few, more = (recognised(project / name, people, rows[0]) for name in ("few", "more"))
    browser.wait(lambda: browser.text("grasp") == few and browser.text("glove-state") == "glove: connected")
    browser.wait(lambda: browser.text("steer-run") == "Stop" and browser.text("build-state").startswith("build: few "))
    # The bar of other pages says it, too.
    first = browser.driver.current_window_handle
    browser.driver.switch_to.new_window("window")
    browser.open(f"{opened.server.url}choose.html")
    browser.wait(lambda: browser.text("glove-state") == "glove: connected")
    browser.driver.close()
    browser.driver.switch_to.window(first)
    Select(browser.driver.find_element(By.ID, "steer-build")).select_by_visible_text("more")
    browser.wait(lambda: browser.text("news") == "The run goes on with more, before it was few.")
    browser.wait(lambda: browser.text("grasp") == more and browser.text("build-state").startswith("build: more "))
    browser.wait(lambda: browser.text("hand-says").startswith(f"{int(people.switches[rows[0], 1:5].sum())} of 4"))
    # What the first build announced is still there.
    browser.wait(lambda: "announced" in browser.text("place"))
    assert json.loads((project / "studio.json").read_text())["build"] == "more"
    assert browser.axe() == []
    browser.picture("live")
    board[0].close()
    browser.wait(lambda: " lost since " in browser.text("glove-state"))
    browser.click("steer-run")
    browser.wait(lambda: browser.text("steer-run") == "Start" and browser.text("glove-state") == "glove: not in use")
    browser.wait(lambda: browser.text("age").startswith("this is "))
    assert browser.axe() == []


@pytest.mark.parametrize(("width", "scheme"), [(1400, "light"), (400, "dark")])
def test_a_recording_is_shown_on_the_same_page_with_one_build_or_two(
    browser: Browser, studio: Start, project: Path, width: int, scheme: str
) -> None:
    open_live(browser, studio(), width=width, scheme=scheme)
    command = f"thenar monitor {project}/rec.mcap --build {project}/few"
    browser.wait(lambda: browser.text("open-command") == command)
    Select(browser.driver.find_element(By.ID, "steer-second")).select_by_visible_text("more")
    assert browser.text("open-command") == f"{command} --build {project}/more"
    browser.click("steer-open")
    browser.wait(lambda: "of 6 labelled trials" in browser.text("rates"))
    assert browser.text("rates").startswith("few recognises ")
    browser.wait(lambda: browser.text("other").lstrip("✗ ").startswith("more: "))
    assert browser.script("return document.documentElement.scrollWidth") <= width
    assert browser.axe() == []
    # The link with its time leads here again.
    browser.script("location.hash = 't=2.5'")
    browser.wait(lambda: browser.text("place").startswith("0:02.50"))
    browser.wait(lambda: browser.text("steer-second") and browser.script("return location.hash") == "#t=2.50")
    link = browser.driver.current_url
    browser.open(link, width=width, scheme=scheme)
    browser.wait(lambda: browser.text("place").startswith("0:02.50") and "more" in browser.text("rates"))
    browser.wait(
        lambda: Select(browser.driver.find_element(By.ID, "steer-second")).first_selected_option.text == "more"
    )
    browser.driver.find_element(By.LINK_TEXT, "Back to the run").click()
    browser.wait(lambda: browser.texts("#steer-run") == ["Start"])
    assert browser.axe() == []


def test_a_run_and_a_recording_are_shown_side_by_side(
    browser: Browser, studio: Start, project: Path, people: GraspSet, board: tuple[LineServer, BoardSender]
) -> None:
    """What one page shows, or where it stands, moves no other."""
    hold(board[1], people, 0)
    opened = studio()
    open_live(browser, opened)
    browser.click("steer-run")
    browser.wait(lambda: browser.text("grasp") == recognised(project / "few", people, 0))
    first = browser.driver.current_window_handle
    browser.driver.switch_to.new_window("window")
    members = opened.project.members("recording") | opened.project.members("build")
    ids = {path.name: member for member, path in members.items()}
    open_live(browser, opened, f"?id={ids['rec.mcap']}&id={ids['more']}#t=1.5")
    browser.wait(lambda: browser.text("place").startswith("0:01.50 of 0:06.0"))
    browser.wait(lambda: browser.text("grasp") != "no frame yet")
    browser.driver.close()
    browser.driver.switch_to.window(first)
    assert browser.text("place").startswith("now · ")
    assert browser.text("grasp") == recognised(project / "few", people, 0)


def test_what_a_run_lacks_is_said_in_a_sentence(browser: Browser, studio: Start, project: Path) -> None:
    (project / "studio.json").write_text('{"build": "gone"}')
    opened = studio()
    open_live(browser, opened)
    browser.wait(
        lambda: browser.text("doing") == "the project has no build in use: train one on the page Choose, or choose one"
    )
    assert browser.script("return document.getElementById('steer-run').disabled")
    glove = (project / "glove.toml").read_text()
    (project / "glove.toml").unlink()
    Select(browser.driver.find_element(By.ID, "steer-build")).select_by_visible_text("few")
    browser.wait(lambda: browser.text("doing").startswith(f"{project}/glove.toml is missing"))
    (project / "glove.toml").write_text('name = "other"\n[[stream]]\nport = "tcp://127.0.0.1:1"\nswitches = ["x"]\n')
    Select(browser.driver.find_element(By.ID, "steer-build")).select_by_visible_text("more")
    browser.wait(lambda: browser.script("return !document.getElementById('steer-run').disabled"))
    browser.click("steer-run")
    browser.wait(lambda: "other" in browser.text("doing") and browser.text("steer-run") == "Start")
    (project / "glove.toml").write_text("stream = 3\n")
    browser.click("steer-run")
    browser.wait(lambda: "glove.toml" in browser.text("doing") and browser.text("steer-run") == "Start")
    assert browser.axe() == []
    (project / "glove.toml").write_text(glove)
    Select(browser.driver.find_element(By.ID, "steer-build")).select_by_visible_text("bent")
    browser.wait(lambda: browser.text("build-state").startswith("build: bent"))
    browser.click("steer-run")
    browser.wait(lambda: browser.text("doing").startswith("nothing in 'bench' reads the build's joints"))
    assert browser.text("steer-run") == "Stop"


def test_without_builds_and_a_run_nothing_empty_is_shown(browser: Browser, studio: Start) -> None:
    """Menus without members and parts without data are not there, and a sentence says what to do."""
    server = studio().server
    browser.open(f"{server.url}live.html")
    browser.wait(lambda: "The project has no build yet: train one on " in "".join(browser.texts("#lacking")))
    for name in (
        "health",
        "timeline",
        "hand",
        "types",
        "devices-table",
        "steer-build",
        "steer-recording",
        "steer-first",
    ):
        assert not browser.driver.find_element(By.ID, name).is_displayed(), name
    letters = "return parseFloat(getComputedStyle(document.getElementById('grasp')).fontSize)"
    assert browser.text("grasp") == "no frame yet"
    assert browser.script(letters) < 40
    assert browser.axe() == []
    browser.open(f"{server.url}compare.html")
    browser.wait(lambda: browser.driver.find_element(By.ID, "no-build").is_displayed())
    for name in ("a", "b"):
        assert not browser.driver.find_element(By.ID, name).is_displayed(), name
    assert browser.axe() == []


def test_a_page_names_members_by_id_alone_and_its_requests_are_bounded(studio: Start, project: Path) -> None:
    opened = studio()
    members = opened.project.members("recording") | opened.project.members("build")
    ids = {path.name: member for member, path in members.items()}
    recording, few, more = ids["rec.mcap"], ids["few"], ids["more"]
    with page(opened.server.url) as live:

        def reply(**asked: object) -> dict[str, Any]:
            live.send(json.dumps(asked))
            found: dict[str, Any] = json.loads(live.recv(timeout=PATIENCE_S))
            return found

        for member in ("../recorded/rec.mcap", "rec.mcap", "/etc/passwd", "", "x" * 1000, few):
            said = reply(do="replay", ids=[member, few])["why"]
            assert said.startswith("the project has no recording ")
            assert len(said) < 150
        for builds in ([recording], ["few"], [f"../recorded/{more}"]):
            assert reply(do="replay", ids=[recording, *builds])["why"].startswith("the project has no build ")
        for some in ([], [recording, few, more, few], [few] * 100):
            assert reply(do="overview", ids=some, numbers=[0, 0])["why"] == "choose a recording, and one build or two"
        assert reply(do="replay", ids=[recording])["builds"] == ["few"]
        assert reply(do="replay", ids=[recording, few, more])["builds"] == ["few", "more"]
        asked = {"do": "moments", "ids": [recording, few]}
        for numbers in ([], [2**62], [0, 1], [1, 2, 3, 4]):
            assert "a page must send 1 of `numbers`" in reply(**asked, numbers=numbers)["why"]
        for wrong in ("x", [0.5], [None], {"from": 1}):
            assert reply(**asked, numbers=wrong)["why"].startswith("the page sent an invalid message")
        assert reply(do="use-build", id="../few")["why"].startswith("the project has no build ")
        assert reply(do="moments", ids=[recording, few], numbers=[2**62 - 1])["topic"] == "moments"
    with page(opened.server.url) as live:
        # However many recordings pages ask for, a few stay open.
        for name in range(6):
            (project / f"rec{name}.mcap").write_bytes((project / "rec.mcap").read_bytes())
        for one, path in opened.project.members("recording").items():
            assert reply(do="replay", ids=[one, few])["name"] == path.name
    assert json.loads((project / "studio.json").read_text())["build"] == "few"

"""The page *Wearer*, in Chromium as a person uses it, and through its WebSocket as an attacker does."""

import json
import shlex
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from thenar.cli import run
from thenar.compiler import adapt, compile_build
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.taxonomy import own
from thenar.drivers.emulated.lines import BoardSender, LineServer
from thenar.runtime import Build
from thenar.studio.project import Project
from thenar.studio.studio import Report, Studio

from ..browser import Browser
from ..sets import grasp_set_of
from .sockets import PATIENCE_S, page, reply, until
from .test_compare import rows

Start = Callable[..., Studio]


@pytest.fixture
def folder(two_builds: Path, people: GraspSet, tmp_path: Path, hand: Any) -> Path:
    """Return a project whose build in use knows two people, with a set of a third one, its wearer, and of a fourth."""
    folder = tmp_path / "recorded"
    shutil.copytree(two_builds, folder)
    for name in "CD":
        people.rows(people.subjects == name).save(folder / f"{name}.grasps")
    Project(folder, hand).remember(build="more", wearer="C")
    return folder


def begun(browser: Browser, opened: Studio, **how: Any) -> None:
    """Open the page, and wait until it knows the project."""
    browser.open(f"{opened.server.url}wearer.html", **how)
    browser.wait(lambda: browser.text("adapt-command"))


def adapted(browser: Browser) -> None:
    browser.driver.find_element(By.ID, "adapt").send_keys(Keys.ENTER)
    browser.wait(lambda: browser.text("result-heading"))
    browser.wait(lambda: "adapted from" in browser.text("use"))


def test_a_build_is_adapted_to_its_wearer_and_back(
    browser: Browser, studio: Start, folder: Path, people: GraspSet, tmp_path: Path
) -> None:
    opened = studio(None)
    begun(browser, opened)
    assert browser.texts("#sets li") == ["C.grasps: 18 trials of 18 frames"]
    assert browser.text("wearer") == "wearer: C"
    assert browser.text("counts") == "Trials: cup 6, pen 6, rod 6"
    command = shlex.split(browser.text("adapt-command"))
    adapted(browser)
    assert browser.text("use") == "C: adapted from more"
    # As by its command, and as the library counts.
    assert run([*command[1:-1], str(tmp_path / "again")]) == 0
    for name in ("build.json", "tables.bin"):
        assert (tmp_path / "again" / name).read_bytes() == (folder / "C" / name).read_bytes()
    mine = people.rows(people.subjects == "C")
    made = adapt(folder / "more", mine, output=tmp_path / "library")
    assert browser.text("before").startswith(f"{made.before} of 18: {100 * made.before / 18:.1f} [")
    assert browser.text("after").startswith(f"{made.after} of 18: {100 * made.after / 18:.1f} [")
    build = Build.load(folder / "more")
    kept = [mine.switch_names.index(switch.name) for switch in build.manifest.switches]
    joints = [mine.joint_names.index(joint.name) for joint in build.manifest.joints]
    read = [build.classify(*one) for one in zip(mine.switches[:, kept], mine.codes[:, joints], strict=True)]
    by_type = {row[0]: [int(number) for number in row[1:]] for row in rows(browser, "types")}
    for name in ("cup", "pen", "rod"):
        truth = mine.grasps == name
        assert by_type[name][:2] == [truth.sum(), (truth & (np.array(read) == name)).sum()]
    assert sum(counts[2] for counts in by_type.values()) == made.after
    worst = rows(browser, "types")[0]
    assert int(worst[3]) / int(worst[1]) == min(after / count for count, _, after in by_type.values())
    assert browser.script("return document.activeElement.id") == "result-heading"
    ends = browser.text("after").partition(": ")[2].removesuffix(" %")
    assert browser.text("build-state").endswith(f", {ends} % within subject")
    browser.driver.find_element(By.ID, "undo").send_keys(Keys.ENTER)
    browser.wait(lambda: browser.text("use") == "more: that of everybody")
    assert (folder / "C" / "build.json").exists()
    assert not browser.driver.find_element(By.ID, "undo").is_displayed()
    assert json.loads((folder / "studio.json").read_bytes())["build"] == "more"


def test_an_adaptation_of_an_adapted_build_is_one_of_everybodys(browser: Browser, studio: Start, folder: Path) -> None:
    """And that is what is used again after it is undone."""
    begun(browser, studio(None))
    adapted(browser)
    browser.wait(lambda: browser.text("adapt-command").endswith("C-2"))
    browser.click("adapt")
    browser.wait(lambda: browser.text("use") == "C-2: adapted from more")
    assert (folder / "C" / "tables.bin").read_bytes() == (folder / "C-2" / "tables.bin").read_bytes()
    assert browser.text("undo") == "Undo: use more again"
    browser.click("undo")
    browser.wait(lambda: browser.text("use") == "more: that of everybody")


def test_another_wearer_has_other_recordings_and_is_remembered(
    browser: Browser, studio: Start, folder: Path, hand: Any
) -> None:
    begun(browser, studio(None))
    name = browser.driver.find_element(By.ID, "subject")
    name.clear()
    name.send_keys("D", Keys.ENTER)
    browser.wait(lambda: browser.texts("#sets li") == ["D.grasps: 18 trials of 18 frames"])
    browser.wait(lambda: browser.text("wearer") == "wearer: D")
    assert Project(folder, hand).state.wearer == "D"
    name.clear()
    name.send_keys("../D", Keys.ENTER)
    browser.wait(lambda: "is not possible" in browser.text("refused"))
    assert Project(folder, hand).state.wearer == "D"


def test_a_type_that_nobody_else_has_is_added_and_contradictions_are_named(
    browser: Browser, studio: Start, folder: Path, people: GraspSet
) -> None:
    mine = people.rows(people.subjects == "C")
    grasps = mine.grasps.copy()
    grasps[[0, 3, 6]] = "vase"
    # A copy of the first trial has another type.
    taught = replace(
        mine.rows(np.array([*range(18), 0])),
        grasps=np.append(grasps, "pen"),
        taxonomy=own(["cup", "pen", "rod", "vase"]),
        trials=np.append(mine.trials, 900),
    )
    taught.save(folder / "C.grasps")
    begun(browser, studio(None))
    assert browser.texts("#notes li") == ["new types are added: vase"]
    assert "--add-type vase" in browser.text("adapt-command")
    adapted(browser)
    assert Build.load(folder / "C").grasps == ("cup", "pen", "rod", "vase")
    assert [text for text in browser.texts("#warnings li") if f"{mine.trials[0]}, 900" in text]


def test_trials_that_the_build_was_trained_on_are_said(
    browser: Browser, studio: Start, folder: Path, people: GraspSet, hand: Any
) -> None:
    people.rows(people.subjects == "A").save(folder / "A.grasps")
    Project(folder, hand).remember(wearer="A")
    begun(browser, studio(None))
    assert browser.texts("#notes li") == ["18 of these trials are of the build's training: before is too good"]


def test_without_a_build_the_page_says_what_to_do(browser: Browser, studio: Start) -> None:
    browser.open(f"{studio().server.url}wearer.html")
    browser.wait(lambda: "train one on the page Choose" in browser.text("empty"))
    assert not browser.driver.find_element(By.ID, "with-build").is_displayed()
    assert browser.axe() == []


@pytest.mark.parametrize("width", [400, 1400])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing(browser: Browser, studio: Start, folder: Path, width: int, scheme: str) -> None:
    begun(browser, studio(None), width=width, scheme=scheme)
    assert browser.axe() == []
    adapted(browser)
    assert browser.axe() == []
    assert browser.script("return document.documentElement.scrollWidth <= innerWidth")
    browser.picture(f"wearer-{width}-{scheme}")


@pytest.mark.parametrize(
    ("request_", "said"),
    [
        ({"do": "wearer", "name": "a/b"}, "is not possible"),
        ({"do": "wearer", "name": ".."}, "is not possible"),
        ({"do": "wearer", "name": ""}, "is empty"),
        ({"do": "wearer", "name": "x" * 5000}, "characters"),
        ({"do": "wearer", "name": "ä" * 130}, "is not possible"),
        ({"do": "wearer", "name": "a\nb"}, "control character"),
        ({"do": "wear"}, "the project has no glove.toml"),
        ({"do": "use-build", "id": "more"}, "the project has no build"),
    ],
)
def test_what_a_page_may_not_ask_for_is_refused(
    studio: Start, folder: Path, request_: dict[str, Any], said: str
) -> None:
    opened, before = studio(None), sorted(folder.iterdir())
    refused = reply(opened, request_)
    assert said in refused["why"]
    assert sorted(folder.iterdir()) == before


def test_another_persons_trials_are_not_adapted_to(studio: Start, folder: Path) -> None:
    """Also if the wearer becomes another one while work that was asked for before goes on."""
    opened, ended = studio(None), Event()
    with page(opened.server.url, "wearing,shell,work") as live:
        until(live, lambda told: bool(told.get("sets")))

        def work(_: Report) -> None:
            assert ended.wait(PATIENCE_S)

        opened.queue("train", work)
        live.send(json.dumps({"do": "adapt"}))
        live.send(json.dumps({"do": "wearer", "name": "E"}))
        until(live, lambda told: told["topic"] == "shell" and told["wearer"] == "E")
        ended.set()
        told = until(live, lambda told: told["topic"] == "wearing" and told["wearer"] == "E")
        assert told["sets"] == []
        live.send(json.dumps({"do": "adapt"}))
        until(live, lambda told: told.get("why") == "no set holds only trials of E: record some")
    assert opened.project.state.build == "more"
    assert not (folder / "C").exists()


# With an emulated glove.

TYPES, SWITCHES = ("cup", "pen", "rod"), ("s1", "s2", "s3", "s4")
CLOSED = {"cup": ("s1",), "pen": ("s2",), "rod": ("s1", "s2", "s3"), "vase": ("s4",)}


@pytest.fixture
def board() -> Iterator[BoardSender]:
    with LineServer() as line, BoardSender(line.send, SWITCHES, (), 200) as board:
        board.port = line.port  # type: ignore[attr-defined]
        yield board


@pytest.fixture
def worn(tmp_path: Path, board: Any, hand: Any) -> Path:
    """Return a project with a glove, and a build of people who close a switch more than the wearer for a rod."""
    folder = tmp_path / "recorded"
    folder.mkdir()
    labels = np.arange(60) % 3
    closed = np.array([[name in CLOSED[grasp] for name in SWITCHES] for grasp in TYPES])[labels]
    closed[:, 3] = labels == 2
    closed ^= np.random.default_rng(3).random(closed.shape) < 0.1
    people = np.repeat(["P", "Q"], 30)
    crowd = grasp_set_of(TYPES, labels, switches=closed, switch_names=SWITCHES, subjects=people)
    compile_build(crowd, folder / "build", trainer="linear", folds=0, jobs=1)
    stream = f'port = "{board.port}"\nrate_hz = 200\nswitches = {json.dumps(SWITCHES)}\n'
    (folder / "glove.toml").write_text(f'name = "bench"\n[[stream]]\n{stream}')
    Project(folder, hand).remember(build="build")
    return folder


def record(browser: Browser, board: BoardSender, *, until: int, new: str = "") -> None:
    """Record on the page Wearer, and on the page Record that it leads to, until so many trials are done, or all."""
    browser.wait(lambda: browser.text("record-command"))
    browser.driver.find_element(By.ID, "type").send_keys(new, Keys.ENTER)
    browser.wait(lambda: browser.script("return location.pathname") == "/record.html")
    key = "#keys [data-key=accept]"
    browser.wait(lambda: browser.texts(key))
    browser.driver.find_element(By.CSS_SELECTOR, key).send_keys(Keys.ENTER)
    while True:
        browser.wait(lambda: "; " in browser.text("place"))
        number, total = (int(word) for word in browser.text("place").split(";")[0].split(" of "))
        held = CLOSED[browser.text("prompt")]
        board.show({name: float(name in held) for name in SWITCHES})
        browser.wait(lambda: "captured: " in browser.text("standing"))
        # A machine that is busy may not read the glove in time.
        while browser.text("standing").startswith("not captured"):
            browser.driver.find_element(By.CSS_SELECTOR, key).send_keys(Keys.ENTER)
            browser.wait(lambda: browser.text("standing").startswith("captured: "))
        browser.driver.find_element(By.CSS_SELECTOR, key).send_keys(Keys.ENTER)
        if number == min(until, total):
            break
        browser.wait(lambda number=number: browser.text("place").startswith(f"{number + 1} of"))  # type: ignore[misc]
    if until < total:
        browser.wait(lambda: browser.text("place").startswith(f"{until + 1} of"))
        browser.driver.find_element(By.TAG_NAME, "body").send_keys("q")
    else:
        browser.wait(lambda: browser.text("prompt") == "no trial is left")
        browser.driver.find_element(By.CSS_SELECTOR, key).send_keys(Keys.ENTER)
    browser.wait(lambda: browser.script("return location.pathname") == "/wearer.html")


def test_two_minutes_adapt_a_build_and_what_was_left_goes_on(
    browser: Browser, studio: Start, worn: Path, board: BoardSender
) -> None:
    browser.open(f"{studio(None).server.url}wearer.html")
    record(browser, board, until=2)
    browser.wait(lambda: browser.texts("#sets li") == ["me.grasps: 2 trials of 2 frames"])
    record(browser, board, until=6)
    browser.wait(lambda: browser.text("result-heading") == "Adapted: me, from 6 trials")
    mine = GraspSet.load(worn / "me.grasps")
    assert sorted(mine.grasps.tolist()) == sorted(2 * TYPES)
    build = Build.load(worn / "me")
    assert build.manifest.adapted is not None
    assert build.manifest.adapted.counts == (2, 2, 2)
    browser.wait(lambda: browser.text("build-state").startswith("build: me "))
    assert not list(worn.glob("me-2*"))


@pytest.mark.slow
def test_a_new_type_is_recorded_and_taught(browser: Browser, studio: Start, worn: Path, board: BoardSender) -> None:
    browser.open(f"{studio(None).server.url}wearer.html")
    record(browser, board, until=99, new="vase")
    browser.wait(lambda: browser.text("result-heading") == "Adapted: me, from 12 trials")
    build = Build.load(worn / "me")
    assert build.grasps == (*TYPES, "vase")
    assert build.classify([name == "s4" for name in SWITCHES][: len(build.manifest.switches)], []) in build.grasps
    browser.wait(lambda: "me: adapted from build" in browser.text("use"))


def test_a_type_that_the_build_knows_is_no_new_one(studio: Start, worn: Path) -> None:
    assert "cup" in reply(studio(None), {"do": "wear", "name": "cup"})["why"]
    assert not list(worn.glob("*.mcap"))

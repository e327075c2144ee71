"""The page *Compare*, in Chromium as a person uses it, and through its WebSocket as an attacker does."""

import json
import re
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.select import Select

from thenar.cli import run
from thenar.compiler.artifact.comparing import compare_builds
from thenar.compiler.artifact.documents import report_of_build
from thenar.compiler.recordings.graspset import GraspSet
from thenar.runtime import Build
from thenar.studio.studio import Studio

from ..browser import Browser
from .sockets import reply

Start = Callable[..., Studio]


@pytest.fixture
def project(studio: Start, two_builds: Path, tmp_path: Path) -> Studio:
    """Return the studio of a project with two builds."""
    shutil.copytree(two_builds, tmp_path / "recorded")
    return studio()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "recorded"


def page(opened: Studio) -> str:
    return f"{opened.server.url}compare.html"


def begun(browser: Browser, opened: Studio, **how: Any) -> None:
    """Open the page, and wait until it knows the project."""
    browser.open(page(opened), **how)
    browser.wait(lambda: browser.text("report-command") or browser.text("compare-command"))


def compared(browser: Browser, opened: Studio, **how: Any) -> None:
    begun(browser, opened, **how)
    browser.driver.find_element(By.ID, "compare").send_keys(Keys.ENTER)
    browser.wait(lambda: browser.text("said"))


def rows(browser: Browser, table: str) -> list[list[str]]:
    """Return the texts of a table's cells, without its head and without the codes of types."""
    found = browser.script(
        """return [...document.querySelectorAll(arguments[0])].map((row) => [...row.cells].map((cell) => {
          const copy = cell.cloneNode(true);
          for (const chip of copy.querySelectorAll(".chip")) chip.remove();
          return copy.textContent.trim();
        }))""",
        f"#{table} tr:has(td:not(:empty))",
    )
    return [list(row) for row in found]


def ids(opened: Studio, kind: str) -> dict[str, str]:
    return {path.name: member for member, path in opened.project.members(kind).items()}


def test_two_builds_are_compared_on_trials_that_neither_was_trained_on(
    browser: Browser, project: Studio, folder: Path, people: GraspSet
) -> None:
    compared(browser, project)
    names = [Select(browser.driver.find_element(By.ID, one)).first_selected_option.text for one in "ab"]
    assert sorted(names) == ["few", "more"]
    others = people.rows(np.isin(people.subjects, ["C", "D"]))
    found = compare_builds(folder / names[0], folder / names[1], people)
    hits = []
    for name in names:
        build = Build.load(folder / name)
        kept = [others.switch_names.index(switch.name) for switch in build.manifest.switches]
        joints = [others.joint_names.index(joint.name) for joint in build.manifest.joints]
        read = [build.classify(*one) for one in zip(others.switches[:, kept], others.codes[:, joints], strict=True)]
        hits.append(np.array(read) == others.grasps)
    gained = 100 * (hits[1].mean() - hits[0].mean())
    said = re.fullmatch(
        r"(\w+) is (\d+\.\d) points better \[.*\], on 36 trials that neither build was trained on", browser.text("said")
    )
    assert said is not None
    assert (said[1], said[2]) == (names[int(gained > 0)], f"{abs(gained):.1f}")
    both = {row[0]: row[1:] for row in rows(browser, "both")}
    assert [text.split(" ")[0] for text in both["Recognised of these trials"]] == [
        f"{100 * one.mean():.1f}" for one in hits
    ]
    assert all("[" in text for text in both["Recognised of these trials"])
    types = rows(browser, "types")
    assert [[int(number) for number in row[1:4]] for row in types] == [
        [int((others.grasps == name).sum()), *(int(one[others.grasps == name].sum()) for one in hits)]
        for name in ("cup", "pen", "rod")
    ]
    changed = rows(browser, "changed")
    assert len(changed) == len(found.changed) >= np.count_nonzero(hits[0] != hits[1]) > 0


def test_without_recordings_nothing_is_compared(project: Studio, folder: Path) -> None:
    (folder / "set.grasps").unlink()
    builds = [*ids(project, "build").values()]
    assert "recordings on which to compare" in reply(project, {"do": "compare", "ids": builds})["why"]
    told = reply(project, {"do": "commands", "id": builds[0], "ids": builds}, "commands")
    assert told["compare"] == ""
    assert told["report"]


def test_a_single_build_is_compared_with_none(browser: Browser, project: Studio, folder: Path) -> None:
    shutil.rmtree(folder / "more")
    project.changed()
    begun(browser, project)
    assert not browser.driver.find_element(By.ID, "compare").is_enabled()
    assert browser.text("refused") == ""


def test_the_hand_shows_which_build_reads_a_sensor(browser: Browser, project: Studio, people: GraspSet) -> None:
    """A sign for both, one for only a, one for only b, and the same in words; a joint is in the words alone."""
    begun(browser, project)
    Select(browser.driver.find_element(By.ID, "a")).select_by_visible_text("few")
    Select(browser.driver.find_element(By.ID, "b")).select_by_visible_text("more")
    browser.click("compare")
    browser.wait(lambda: browser.text("said"))
    signs = browser.script(
        "return [...document.querySelectorAll('#hand .sign')].map((sign) =>"
        " [sign.classList[1], sign.parentNode.querySelector('title').textContent])"
    )
    names = people.switch_names
    assert sorted(map(tuple, signs)) == sorted(
        [("both", names[1]), ("both", names[2]), ("a", names[0]), ("b", names[3])]
    )
    # No line of a sensor crosses its letters.
    assert not [one for one in browser.driver.find_elements(By.CSS_SELECTOR, "#hand .open") if one.is_displayed()]
    assert browser.texts("#legend li") == [
        f"both: 2, {names[1]}, {names[2]}",
        f"only a (few): 1, {names[0]}",
        f"only b (more): 2, {names[3]}, {people.joint_names[0]}",
    ]


def test_trials_that_a_build_was_trained_on_are_called_so(
    browser: Browser, project: Studio, folder: Path, people: GraspSet
) -> None:
    people.rows(np.isin(people.subjects, ["A", "B"])).save(folder / "known.grasps")
    project.changed()
    begun(browser, project)
    browser.wait(lambda: len(browser.driver.find_elements(By.CSS_SELECTOR, "#sets input")) == 2)
    assert "thenar merge" in browser.text("compare-command")
    browser.driver.find_elements(By.CSS_SELECTOR, "#sets input")[1].send_keys(Keys.SPACE)
    browser.wait(lambda: browser.text("compare-command").endswith(f"{folder}/known.grasps"))
    browser.click("compare")
    browser.wait(lambda: browser.text("said").endswith("on 36 trials that both builds were trained on"))


def test_a_trial_that_changed_leads_to_it(browser: Browser, project: Studio, people: GraspSet) -> None:
    compared(browser, project)
    name, recorded, *_ = rows(browser, "changed")[-1]
    browser.driver.find_elements(By.CSS_SELECTOR, "#changed a")[-1].send_keys(Keys.ENTER)
    browser.wait(lambda: browser.script("return location.pathname") == "/errors.html")
    browser.wait(lambda: browser.text("selection-heading").startswith(f"{name}: {recorded}"))


def test_the_command_says_what_the_page_says(
    browser: Browser, project: Studio, capsys: pytest.CaptureFixture[str]
) -> None:
    compared(browser, project)
    assert run([*shlex.split(browser.text("compare-command"))[1:], "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    points = [100 * found[name] for name in ("difference", "low", "high")]
    if points[0] < 0:
        points = [-points[0], -points[2], -points[1]]
    assert "{:.1f} points better [{:.1f}, {:.1f}]".format(*points) in browser.text("said")
    assert len(found["changed"]) == len(rows(browser, "changed"))


def test_a_report_is_exported_and_saved_by_the_browser(
    browser: Browser, project: Studio, folder: Path, tmp_path: Path
) -> None:
    saved = tmp_path / "saved"
    browser.driver.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(saved)})
    begun(browser, project)
    command = browser.text("report-command")
    name = Select(browser.driver.find_element(By.ID, "b")).first_selected_option.text
    assert command == f"cp {folder}/{name}/report.html {folder}/{name}.html"
    browser.click("report")
    browser.wait(lambda: browser.driver.find_element(By.ID, "download").is_displayed())
    written = (folder / f"{name}.html").read_bytes()
    assert written == (folder / name / "report.html").read_bytes()
    browser.wait(lambda: browser.text("report-command").endswith(f"{name}-2.html"))
    browser.driver.find_element(By.CSS_SELECTOR, "#download a").send_keys(Keys.ENTER)
    browser.wait(lambda: (saved / f"{name}.html").exists())
    assert (saved / f"{name}.html").read_bytes() == written
    # The page is still there.
    assert browser.text("exported").startswith(f"{folder}/{name}.html works offline")


def test_two_browsers_do_not_move_each_other(browser: Browser, project: Studio) -> None:
    """What another one compares is not shown: here, the same builds in the other order."""
    begun(browser, project)
    chosen = [str(browser.script("return document.getElementById(arguments[0]).value", one)) for one in "ba"]
    request = {"do": "compare", "ids": [*chosen, *ids(project, "set").values()]}
    assert reply(project, request, "compare")["ids"] == request["ids"]
    browser.click("report")
    browser.wait(lambda: browser.text("exported"))
    assert not browser.driver.find_element(By.ID, "result").is_displayed()


@pytest.mark.parametrize("width", [400, 1400])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing(browser: Browser, project: Studio, width: int, scheme: str) -> None:
    compared(browser, project, width=width, scheme=scheme)
    assert browser.axe() == []
    assert browser.script("return document.documentElement.scrollWidth <= innerWidth")
    browser.picture(f"compare-{width}-{scheme}")


@pytest.mark.parametrize(
    ("request_", "said"),
    [
        ({"do": "compare"}, "choose two builds"),
        ({"do": "compare", "ids": ["few", "few"]}, "choose two builds"),
        ({"do": "compare", "ids": ["few", "set", "set"]}, "the project has no build"),
        ({"do": "compare", "ids": ["few", "more", "more"]}, "the project has no set"),
        ({"do": "compare", "ids": ["../few", "../../etc", "set"]}, "the project has no build"),
        ({"do": "compare", "ids": "few"}, "invalid message"),
        ({"do": "report", "id": "set"}, "the project has no build"),
        ({"do": "report", "id": "../few"}, "the project has no build"),
        ({"do": "firmware", "id": "few"}, "a page cannot 'firmware'"),
        ({"do": "commands", "id": "../few", "ids": ["few", "more"]}, "the project has no build"),
    ],
)
def test_what_a_page_may_not_ask_for_is_refused(
    project: Studio, folder: Path, request_: dict[str, Any], said: str
) -> None:
    known = {name.partition(".")[0]: one for kind in ("set", "build") for name, one in ids(project, kind).items()}
    before = sorted(folder.iterdir())
    for key in ("id", "ids"):
        value = request_.get(key, "")
        new = known.get(value, value) if isinstance(value, str) else [known.get(one, one) for one in value]
        request_ = request_ | {key: new} if key in request_ else request_
    refused = reply(project, request_, "compare")
    assert refused["topic"] == "refused"
    assert said in refused["why"]
    assert sorted(folder.iterdir()) == before


def test_a_build_without_a_report_gets_one_of_what_it_states(browser: Browser, project: Studio, folder: Path) -> None:
    (folder / "more" / "report.html").unlink()
    begun(browser, project)
    Select(browser.driver.find_element(By.ID, "b")).select_by_visible_text("more")
    browser.wait(lambda: browser.text("report-command") == "")
    browser.click("report")
    browser.wait(lambda: browser.text("exported"))
    assert (folder / "more.html").read_bytes() == report_of_build(folder / "more")

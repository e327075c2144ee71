"""The studio of a small set, whose work is done, and a browser."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Event, Thread

import numpy as np
import pytest
from selenium import webdriver

from thenar.compiler.artifact.compile import compile_build
from thenar.compiler.artifact.documents import Documents
from thenar.compiler.hand import HandShape
from thenar.compiler.recordings.graspset import GraspSet
from thenar.drivers.emulated.lines import LineServer
from thenar.runtime.recipe import Recipe
from thenar.simulator.handmaps.handmap import hand_map
from thenar.studio.opening import open_studio
from thenar.studio.project import Project
from thenar.studio.studio import Studio

from ..browser import Browser
from ..sets import grasp_set_of, single_settings


@pytest.fixture(scope="session")
def hand() -> HandShape:
    return hand_map()


@pytest.fixture(scope="session")
def people(hand: HandShape) -> GraspSet:
    """Return 3 types of 4 people, 6 trials of each: switches of the drawn glove, of which some tell the types, and two
    joints.
    """
    random, n = np.random.default_rng(6), 72
    labels, subjects = np.arange(n) % 3, np.repeat(np.array(list("ABCD")), n // 4)
    told = (random.random((3, 8)) < 0.5)[labels] ^ (random.random((n, 8)) < 0.15)
    codes = np.array([[60, 90], [120, 70], [100, 160]])[labels] + random.integers(-30, 30, (n, 2))
    names = hand.names[:8]
    return grasp_set_of(
        ["cup", "pen", "rod"], labels, switches=told, switch_names=names, codes=codes, subjects=subjects
    )


@pytest.fixture(scope="session")
def two_builds(people: GraspSet, hand: HandShape, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two builds of the recordings of the first two people: "few" reads three sensors, "more"
    four, and they share two.
    """
    folder, names = tmp_path_factory.mktemp("builds"), (*people.switch_names, *people.joint_names)
    known = people.rows(np.isin(people.subjects, ["A", "B"]))
    with single_settings():
        for name, sensors in (("few", (0, 1, 2)), ("more", (1, 2, 3, 8))):
            recipe = Recipe(sensors=len(sensors), have=tuple(names[one] for one in sensors), trainer="logit")
            compile_build(known, folder / name, recipe, documents=Documents(hand), jobs=1)
    return folder


@pytest.fixture
def studio(people: GraspSet, hand: HandShape, tmp_path: Path) -> Iterator[Callable[..., Studio]]:
    """Return what opens the studio of a project with a set, or with none; `prices` is the text of its prices.toml."""
    with ExitStack() as stack:

        def start(
            grasp_set: GraspSet | None = people, address: str = "127.0.0.1:0", hand: HandShape = hand, prices: str = ""
        ) -> Studio:
            folder = tmp_path / "recorded"
            folder.mkdir(exist_ok=True)
            if grasp_set is not None:
                grasp_set.save(folder / "set.grasps")
            if prices:
                (folder / "prices.toml").write_text(prices)
            opened = stack.enter_context(open_studio(Project(folder, hand), address, token=None, jobs=1))
            stop = Event()
            working = Thread(target=opened.run, args=(stop,))
            working.start()
            stack.callback(working.join)
            stack.callback(stop.set)
            return opened

        yield start


@pytest.fixture
def line() -> Iterator[LineServer]:
    """Return a server of lines on TCP, to which an emulated board can send."""
    with LineServer() as line:
        yield line


@pytest.fixture(scope="module")
def chromium(new_chromium: Callable[..., webdriver.Chrome]) -> Iterator[Browser]:
    driver = new_chromium("--window-size=1400,1000")
    yield Browser(driver)
    driver.quit()


@pytest.fixture
def browser(chromium: Browser, studio: Callable[..., Studio]) -> Iterator[Browser]:
    """Return the browser, which leaves a page before its server ends; the page may not have complained of anything."""
    yield chromium
    complaints = chromium.log()
    chromium.driver.get("about:blank")
    assert complaints == []

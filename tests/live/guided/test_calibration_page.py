"""`thenar calibrate --web` in a real browser, on an emulated CyberGlove, by keyboard alone."""

from collections.abc import Callable
from pathlib import Path

import pytest

from thenar.drivers.calibration import FLAT, POSES
from thenar.drivers.cyberglove_protocol import SENSORS_18
from thenar.runtime.calibration import load_calibration

from .conftest import ENTER, Browser, Command, Wearer

pytestmark = pytest.mark.slow

ALL = (FLAT, *POSES)


@pytest.fixture
def calibrate(wearer: Wearer, command: Callable[..., Command]) -> Callable[..., Command]:
    wearer.glove.set(bytes([60] * 18))
    return lambda *more: command("calibrate", wearer.folder / "glove", "-o", "anna.toml", "--hold", 0.05, *more)


def held(page: Browser, wearer: Wearer, raw: list[int], stages: tuple[str, ...] = ("ready", "done")) -> None:
    """Hold a pose in which the sensors say this, once the page shows it, and let it be taken."""
    wearer.glove.set(bytes(raw))
    shown = "return [...document.querySelectorAll('#sensors meter')].map((one) => one.value)"
    page.wait(lambda: page.script(shown) == raw)
    page.press(ENTER)
    page.until(*stages)


def test_all_poses_make_the_calibration_that_the_terminal_makes(
    calibrate: Callable[..., Command], wearer: Wearer, browser: Browser, tmp_path: Path
) -> None:
    going = calibrate("--subject", "<b>Anna</b>")
    page = browser.see(going.url, width=400, scheme="dark")
    page.until("ready")
    assert page.text("subject") == "<b>Anna</b>"
    for number, pose in enumerate(ALL):
        assert page.text("title") == pose.name
        assert page.text("count") == f"pose {number + 1} of 7"
        assert page.text("detail") == pose.instruction
        concerned = page.script(
            "return [...document.querySelectorAll('#sensors tr.concerned th')].map((one) => one.textContent)"
        )
        assert concerned == [name for name in SENSORS_18 if not number or name in pose.degrees]
        if number == 1:
            page.picture("calibrate-fist-400-dark")
            assert page.overflow() == 0
            assert page.axe() == []
        held(page, wearer, [60 + 20 * number] * 18)
    page.until("done")
    assert page.text("title") == "All poses are taken"
    page.press(ENTER)
    assert going.finish() == 0, going.said
    page.wait(lambda: page.text("link").startswith("page: ended since"))
    assert page.text("stage").endswith("anna.toml: 18 sensors of <b>Anna</b>")
    calibration = load_calibration(tmp_path / "anna.toml")
    assert tuple(sensor.name for sensor in calibration.sensors) == SENSORS_18
    for sensor in calibration.sensors:
        (number,) = [number for number, pose in enumerate(ALL) if sensor.name in pose.degrees]
        assert (sensor.raw_a, sensor.value_a) == (60, 0.0)
        assert (sensor.raw_b, sensor.value_b) == (60 + 20 * number, ALL[number].degrees[sensor.name])
    assert page.faults() == []


def test_bad_sensors_are_reported_and_leaving_writes_nothing(
    calibrate: Callable[..., Command], wearer: Wearer, browser: Browser, tmp_path: Path
) -> None:
    (tmp_path / "anna.toml").write_text("old")
    going = calibrate("--overwrite")
    page = browser.see(going.url)
    page.until("ready")
    held(page, wearer, [60] * 18)
    index, middle = SENSORS_18.index("index_mpj"), SENSORS_18.index("middle_mpj")
    fist = [120] * 18
    fist[index], fist[middle] = 60, 255
    held(page, wearer, fist, ("doubted",))
    problems = page.script("return [...document.querySelectorAll('#problems li')].map((one) => one.textContent)")
    assert problems == [
        "index_mpj went from 60 to 60 only: was the joint moved?",
        "middle_mpj is at the end of its range (255): does the glove fit, is the sensor whole?",
    ]
    page.picture("calibrate-doubted-1400-light")
    assert page.axe() == []
    page.press("k")
    assert page.text("title") == "bent thumb"

    def state(name: str) -> object:
        script = "return document.querySelectorAll('#sensors tr')[arguments[0]].lastChild.textContent"
        return page.script(script, SENSORS_18.index(name))

    page.wait(lambda: state("index_mpj") == "dead: it never moved")
    assert state("middle_mpj") == "at the end of its range"
    assert state("thumb_mpj") == "this pose's"
    page.press("b")
    assert page.text("title") == "fist"
    page.type("q")
    page.wait(lambda: page.script("return document.getElementById('leaving').open"))
    page.type(ENTER)
    assert going.finish() == 130, going.said
    page.wait(lambda: page.text("link").startswith("page: ended since"))
    assert page.text("stage") == "left; nothing is written"
    assert (tmp_path / "anna.toml").read_text() == "old"

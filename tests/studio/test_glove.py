"""The page *Glove*, in Chromium as a person uses it, with an emulated glove, and through its WebSocket."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from thenar.drivers.calibration import FLAT, POSES
from thenar.drivers.emulated.cyberglove import EmulatedCyberGlove
from thenar.drivers.emulated.lines import BoardSender, LineServer
from thenar.drivers.emulated.serial_line import PtyLine
from thenar.runtime.calibration import load_calibration, load_lines
from thenar.runtime.harness.loading import load_harness, parse_harness
from thenar.runtime.taxels import TaxelCalibration
from thenar.studio.glove import _naming
from thenar.studio.studio import Studio

from ..browser import Browser
from .sockets import PATIENCE_S, page, reply

Start = Callable[..., Studio]
SWITCHES = ("s1", "s2", "s3", "s4")


@pytest.fixture
def board(line: LineServer) -> Iterator[BoardSender]:
    with BoardSender(line.send, SWITCHES, ("p1",), 200) as board:
        board.show({"p1": 100})
        yield board


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "recorded"
    folder.mkdir()
    return folder


def harness_in(folder: Path, port: str) -> None:
    (folder / "glove.toml").write_text(
        f'# Mine.\nname = "bench"\n[[stream]]\nport = "{port}"\nrate_hz = 200\nswitches = {json.dumps(SWITCHES)}\n'
        "taxels = { p1 = [0, 1023] }\n"
    )


def open_glove(browser: Browser, studio: Studio, **how: int | str) -> None:
    browser.open(f"{studio.server.url}glove.html", **how)  # type: ignore[arg-type]
    browser.wait(lambda: browser.text("link").startswith("page: connected"))


def states(browser: Browser) -> dict[str, str]:
    """Return the state of each sensor, as the list says it."""
    return dict(said.split(": ") for said in browser.texts("#sensors button") if ": " in said)


def toggle(browser: Browser, board: BoardSender, *names: str) -> None:
    """Close and open switches, one after the other, until the page has counted the change of the last."""
    for name in names:
        board.show({name: 1})
        browser.wait(lambda name=name: f"{name}: " in closed(browser))  # type: ignore[misc]
        board.show({name: 0})
        browser.wait(lambda name=name: f"{name}: " not in closed(browser))  # type: ignore[misc]


def closed(browser: Browser) -> str:
    """Return the labels of the switches that are drawn closed."""
    return " ".join(
        browser.script("return [...document.querySelectorAll('#hand .closed')].map((one) => one.ariaLabel ?? '')")
    )


def test_a_stuck_a_silent_and_a_lost_sensor_are_told_apart(
    browser: Browser, studio: Start, folder: Path, line: LineServer, board: BoardSender
) -> None:
    harness_in(folder, line.port)
    board.show({"s2": 1})
    opened = studio(None)
    open_glove(browser, opened)
    browser.wait(lambda: [*states(browser).values()] == ["never seen"] * 5)
    assert browser.text("problem") == "s1 has not changed yet: press it, or bend the finger"
    assert browser.axe() == []
    toggle(browser, board, *(["s1", "s3"] * 6))
    browser.wait(lambda: states(browser)["s2"] == "stuck")
    assert states(browser) == {"s1": "ok", "s2": "stuck", "s3": "ok", "s4": "never seen", "p1": "never seen"}
    assert browser.text("problem").startswith("s2 stays the same while others change")
    assert "switches and pads: " in browser.text("rates")
    browser.click("problem")
    browser.wait(lambda: browser.text("one-heading") == "s2, switch")
    browser.wait(lambda: browser.text("one-says").startswith("stuck; now closed; "))
    browser.driver.find_element(By.CSS_SELECTOR, "#hand [aria-label^='s1']").send_keys(Keys.ENTER)
    browser.wait(lambda: browser.text("one-heading") == "s1, switch")
    browser.wait(lambda: browser.script("return document.querySelector('#plot path').getAttribute('d').includes('H')"))
    browser.picture("glove")
    assert browser.axe() == []
    line.close()
    browser.wait(lambda: {*states(browser).values()} == {"lost"})
    browser.wait(lambda: "check its cable" in browser.text("problem"))
    assert browser.script("return document.getElementById('glove-state').dataset.is") == "bad"
    assert browser.axe() == []
    assert not browser.script("return document.documentElement.classList.contains('old')")
    opened.station.stop()
    browser.wait(lambda: browser.script("return document.documentElement.classList.contains('old')"))
    assert browser.text("counted").startswith("not watched since ")
    assert browser.axe() == []


class Moving(BoardSender):
    """A board whose switches and pad are pressed every second."""

    def line(self, now_s: float) -> bytes:
        """Return the next row."""
        shut = int(2 * now_s) % 2
        self.show(dict.fromkeys(SWITCHES, float(shut)) | {"p1": 100.0 + 700 * shut})
        return super().line(now_s)


@pytest.fixture
def moving(line: LineServer) -> Iterator[BoardSender]:
    with Moving(line.send, SWITCHES, ("p1",), 200) as board:
        yield board


@pytest.mark.usefixtures("moving")
def test_a_glove_is_connected_from_an_empty_folder(
    browser: Browser, studio: Start, folder: Path, line: LineServer
) -> None:
    open_glove(browser, studio(None))
    browser.wait(lambda: browser.text("addresses"))
    assert browser.axe() == []
    browser.driver.find_element(By.ID, "address").send_keys(line.port, Keys.ENTER)
    browser.wait(lambda: browser.text("found-heading").startswith("Listening"))
    browser.wait(lambda: browser.text("proposal"))
    assert len(browser.texts("#columns tr")) == 5
    assert not (folder / "glove.toml").exists()
    shown = browser.text("proposal")
    assert browser.text("find-command") == f"thenar doctor --line {line.port} --propose {folder}/glove.toml"
    assert browser.axe() == []
    browser.picture("glove-found")
    browser.click("connect")
    browser.wait(lambda: len(states(browser)) == 5)
    assert (folder / "glove.toml").read_text() == shown
    assert load_harness(folder / "glove.toml").switches == SWITCHES
    browser.wait(lambda: {*states(browser).values()} == {"ok"})
    assert browser.text("problem") == "The taxels are not calibrated. Calibrate them now."


def test_a_cyberglove_is_found_when_its_port_is_named_so(browser: Browser, studio: Start, folder: Path) -> None:
    open_glove(browser, studio(None))
    browser.wait(lambda: browser.text("addresses"))
    with PtyLine(folder / "port") as port, EmulatedCyberGlove(port, sensors=22):
        browser.driver.find_element(By.ID, "address").send_keys(f"cyberglove:{folder}/port", Keys.ENTER)
        browser.wait(lambda: browser.text("proposal"))
        assert len(browser.texts("#columns tr")) == 22
        browser.click("connect")
        browser.wait(lambda: len(states(browser)) == 22)
    harness = load_harness(folder / "glove.toml")
    assert harness.cyberglove is not None
    assert (harness.cyberglove.port, len(harness.sensor_names)) == (f"{folder}/port", 22)


def test_what_is_said_of_a_lost_device_can_be_copied(browser: Browser, studio: Start, folder: Path) -> None:
    """It is not written anew five times a second, which would take the selection of its text away."""
    harness_in(folder, "/dev/none")
    opened = studio(None)
    open_glove(browser, opened)
    browser.wait(lambda: "lost: /dev/none" in browser.text("devices-table"))
    browser.script("getSelection().selectAllChildren(document.getElementById('devices'))")
    with page(opened.server.url, "glove-state") as live:
        for _ in range(4):
            live.recv(timeout=PATIENCE_S)
    assert "lost: /dev/none" in browser.script("return String(getSelection())")


def test_an_address_without_a_glove_is_said(browser: Browser, studio: Start, folder: Path) -> None:
    open_glove(browser, studio(None))
    browser.wait(lambda: browser.text("addresses"))
    browser.driver.find_element(By.ID, "address").send_keys(str(folder / "none"), Keys.ENTER)
    browser.wait(lambda: any("there is no such port" in said for said in browser.texts("#remarks li")))
    assert not browser.driver.find_element(By.ID, "connect").is_displayed()


def key(browser: Browser, name: str) -> None:
    """Press a button of the calibration."""
    click = "const key = document.querySelector(`#keys [data-key=${arguments[0]}]`); key?.click(); return key !== null"
    browser.wait(lambda: browser.script(click, name))


def test_pads_are_calibrated_and_named_in_the_harness(
    browser: Browser, studio: Start, folder: Path, line: LineServer, board: BoardSender
) -> None:
    harness_in(folder, line.port)
    open_glove(browser, studio(None))
    browser.wait(lambda: browser.texts("#calibrate button") == ["Calibrate the pads"])
    command = f"thenar calibrate {folder}/glove.toml --overwrite --subject me --taxels -o {folder}/taxels.toml"
    assert browser.texts("#calibrate code") == [command]
    browser.driver.find_element(By.CSS_SELECTOR, "#calibrate button").click()
    key(browser, "accept")
    browser.wait(lambda: browser.text("step") == "Pads pressed")
    board.show({"p1": 900})
    assert browser.axe() == []
    # What was pressed has come when a page that watches shows it; here nothing does, so the pads' own stage is kept.
    browser.wait(lambda: browser.text("what").startswith("Press every taxel"))
    key(browser, "accept")
    browser.wait(lambda: browser.text("calibrated"))
    assert browser.text("calibrated") == "taxels.toml: 1 of 1 are calibrated"
    (pad,) = load_lines(folder / "taxels.toml", TaxelCalibration).sensors
    assert (pad.raw_a, pad.raw_b) == (100, 900)
    text = (folder / "glove.toml").read_text()
    assert text.startswith("# Mine.\n")
    assert load_harness(folder / "glove.toml").taxel_settings.calibration == str((folder / "taxels.toml").resolve())
    browser.wait(lambda: browser.texts("#calibrate button") == ["Calibrate the pads anew"])


def test_joints_are_calibrated_pose_by_pose(browser: Browser, studio: Start, folder: Path) -> None:
    (folder / "glove.toml").write_text(f'# Mine.\nname = "bench"\n[cyberglove]\nport = "{folder}/port"\n')
    with PtyLine(folder / "port") as port, EmulatedCyberGlove(port) as glove:
        open_glove(browser, studio(None))
        browser.wait(lambda: browser.texts("#calibrate button") == ["Calibrate the joints"])
        browser.driver.find_element(By.CSS_SELECTOR, "#calibrate button").click()
        for number, pose in enumerate((FLAT, *POSES)):
            wanted = f"Pose {number + 1} of {1 + len(POSES)}: {pose.name}"
            browser.wait(lambda wanted=wanted: browser.text("step") == wanted)  # type: ignore[misc]
            if number == 1:
                # The hand still lies flat.
                key(browser, "accept")
                browser.wait(lambda: browser.texts("#problems li"))
                assert browser.axe() == []
                key(browser, "accept")
            glove.set(bytes([60 + 20 * number] * 18))
            key(browser, "accept")
        browser.wait(lambda: browser.text("calibrated") == "joints.toml: 18 of 18 are calibrated")
        assert browser.text("wearer") == "wearer: me"
        calibration = load_calibration(folder / "joints.toml")
        assert len(calibration.sensors) == 18
        assert calibration.subject == "me"
        assert {sensor.raw_a for sensor in calibration.sensors} == {60}
        assert (folder / "glove.toml").read_text().startswith("# Mine.\n")
        assert load_harness(folder / "glove.toml").calibration == str((folder / "joints.toml").resolve())
        browser.wait(lambda: browser.texts("#calibrate button") == ["Calibrate the joints anew"])


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ("cyberglove", """[cyberglove]\nport = "/dev/ttyUSB0"\ncalibration = 'old.toml'\n"""),
        ("cyberglove", '# calibration = "old.toml"\n[cyberglove]\nport = "/dev/ttyUSB0"\ncalibration = "old.toml"\n'),
        ("cyberglove", "[ cyberglove ]\nport = '/dev/ttyUSB0'"),
        ("cyberglove", """cyberglove = { port = "/dev/ttyUSB0", calibration = 'old.toml' }\n"""),
        ("taxels", '[[stream]]\nport = "/dev/ttyACM0"\ntaxels = { p1 = [0, 1023] }\n[taxels]'),
        ("taxels", '[[stream]]\nport = "/dev/ttyACM0"\ntaxels = { p1 = [0, 1023] }\n'),
        ("stream", '[[ stream ]]\nport = "/dev/ttyACM0"\njoints = { j1 = [0, 254] }\n'),
    ],
)
def test_a_calibration_is_named_where_the_file_has_room_for_it(table: str, text: str) -> None:
    """However the file is written; all else stays."""
    made = parse_harness(_naming(text, table, "new.toml"), "glove.toml")
    found = made.taxel_settings.calibration if table == "taxels" else made.calibration
    assert found == "new.toml"
    before = parse_harness(text, "glove.toml")
    assert (made.sensor_names, made.taxel_names) == (before.sensor_names, before.taxel_names)


@pytest.mark.parametrize(("width", "scheme"), [(400, "dark"), (1400, "light")])
def test_it_can_be_used_by_everybody(
    browser: Browser, studio: Start, folder: Path, line: LineServer, board: BoardSender, width: int, scheme: str
) -> None:
    harness_in(folder, line.port)
    open_glove(browser, studio(None), width=width, scheme=scheme)
    browser.wait(lambda: len(states(browser)) == 5)
    browser.driver.find_elements(By.CSS_SELECTOR, "#sensors button")[0].click()
    browser.wait(lambda: browser.text("one-says"))
    assert browser.axe() == []
    assert browser.script("return document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        ({"do": "find", "name": "-"}, "is not an address"),
        ({"do": "find", "name": "spy:///etc/passwd"}, "is not a"),
        ({"do": "find", "name": "tcp://host:99999"}, "is not an address"),
        ({"do": "find", "name": "cyberglove:-"}, "is not an address"),
        ({"do": "find", "name": ""}, "is empty"),
        ({"do": "connect"}, "a glove.toml already"),
        ({"do": "past", "trial": 10_000}, "numbered from 0"),
        ({"do": "past", "trial": -1}, "numbered from 0"),
        ({"do": "calibrate", "name": "../joints"}, "can be calibrated"),
        ({"do": "key", "name": "explode"}, "there is no key 'explode' now"),
        ({"do": "key", "name": "accept"}, "there is no key 'accept' now"),
    ],
)
def test_what_no_page_sends_is_refused(studio: Start, folder: Path, asked: dict[str, object], why: str) -> None:
    harness_in(folder, f"{folder}/none")
    opened = studio(None)
    assert why in reply(opened, asked)["why"]
    assert [path.name for path in folder.iterdir()] == ["glove.toml"]
    assert opened.station.doing == ""


def test_a_recording_is_not_ended_by_watching(
    studio: Start, folder: Path, line: LineServer, board: BoardSender
) -> None:
    harness_in(folder, line.port)
    opened = studio(None)
    with page(opened.server.url) as live:
        live.send(json.dumps({"do": "record", "name": "A", "id": "kamakura14", "value": 1}))
        live.send(json.dumps({"do": "watch"}))
        told = json.loads(live.recv(timeout=PATIENCE_S))
    assert told == {"topic": "refused", "do": "watch", "why": "the glove is in use: recording; end that first"}
    assert opened.station.doing == "recording"

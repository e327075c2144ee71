"""What the page of a collection is told, by WebSocket."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from msgspec.structs import replace
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from thenar.drivers.calibration import GloveCalibration, SensorCalibration
from thenar.runtime.frames import OLD_US, GloveFrame, SwitchFrame
from thenar.runtime.published import DeviceHealth
from thenar.runtime.recording.guide import CollectionGuide, planned
from thenar.runtime.recording.session import Collection, CollectionTask, Session
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.taxels import TaxelCalibration, TaxelLine
from thenar.runtime.web.guided import GuidePage, collection_page

COLLECTION = Collection(
    "A", "own", ("cup", "pen"), (CollectionTask("cup", ("mug",)), CollectionTask("none", ("open hand",))), 2, 1
)
SESSION = Session(
    thenar="1",
    switches=("a", "b", "c"),
    sensors=("index_mpj", "index_pij"),
    collection=COLLECTION,
    calibration=GloveCalibration(sensors=(SensorCalibration("index_pij", 50, 0.0, 150, 100.0),)),
    taxels=("p", "q"),
    taxel_calibration=TaxelCalibration(unit="N", taxels=(TaxelLine("p", 100, 900, 2.0),)),
)
DEVICES = (DeviceHealth("glove", True), DeviceHealth("stream", False, "is gone"))


@pytest.fixture
def page() -> Iterator[GuidePage]:
    with collection_page(
        "127.0.0.1:0", token=None, session=SESSION, hands={}, shown=lambda trial: {"title": trial.grasp}
    ) as it:
        yield it


@pytest.fixture
def guide(tmp_path: Path) -> Iterator[CollectionGuide]:
    with Recorder(tmp_path / "a.mcap", SESSION) as recorder:
        yield CollectionGuide(planned(COLLECTION), recorder, 3_000_000)


def opened(page: GuidePage) -> ClientConnection:
    where = urlsplit(page.url).netloc
    return connect(f"ws://{where}/live", origin=Origin(f"http://{where}"), proxy=None)


def told(page: GuidePage, *topics: str) -> dict[str, Any]:
    """What a browser that opens the page now gets, by topic."""
    with opened(page) as live:
        found: dict[str, Any] = {}
        while not found.keys() >= set(topics):
            message = json.loads(live.recv(timeout=20))
            found[message["topic"]] = message
    return found


def frames(time_us: int, taxels: tuple[int | None, ...], lost: int = 0b010) -> list[SwitchFrame | GloveFrame]:
    return [SwitchFrame(time_us, 0b101, lost=lost, taxels=taxels), GloveFrame(time_us, bytes((70, 0)), 3)]


def test_what_the_glove_sees(page: GuidePage, guide: CollectionGuide) -> None:
    for time_us, taxels in ((0, (500, 40)), (60_000, (2000, 80)), (120_000, (None, 60))):
        guide.take(time_us, frames(time_us, taxels))
        page.show(time_us, guide, DEVICES)
        seen = told(page, "guide")["guide"]
        assert seen["closed"] == "1x1"
        assert seen["joints"] == [70.0, None]
        # Of the second, only the range is known that was seen here.
        assert seen["taxels"] == {0: [0.5, 0.0], 60_000: [1.0, 1.0], 120_000: [None, 0.5]}[time_us]
    guide.take(180_000, [GloveFrame(180_000, bytes((70, 100)), 3)])
    page.show(180_000, guide, DEVICES)
    assert told(page, "guide")["guide"]["joints"] == [70.0, 50.0]
    assert seen["devices"][1] == {"name": "stream", "connected": False, "error": "is gone"}


def test_joints_of_an_old_record_are_not_told_as_measured(page: GuidePage, guide: CollectionGuide) -> None:
    guide.take(0, frames(0, (500, 40)))
    for now_us, joints in ((OLD_US, [70.0, None]), (2 * OLD_US, [])):
        guide.take(now_us, [SwitchFrame(now_us, 0, lost=0b111)])
        page.show(now_us, guide, DEVICES)
        found = told(page, "guide")["guide"]
        assert found["joints"] == joints
        says = "the countdown waits: switches cannot be read: a, b, c"
        assert (found["says"] == says) == (joints == [])
        assert found["sees"].startswith("0 of 0 readable switches closed; 3 lost (a, b, c); ")
        assert (found["time_us"], found["age_us"]) == (now_us, 0)


def test_a_browser_that_comes_late_gets_all_and_presses_at_its_step(page: GuidePage, guide: CollectionGuide) -> None:
    page.study({"problem": "not yet"})
    page.show(0, guide, DEVICES)
    found = told(page, "about", "hands", "guide", "study")
    assert (found["about"]["subject"], found["about"]["study"]) == ("A", True)
    assert found["study"]["problem"] == "not yet"
    assert found["guide"]["offered"] == guide.offered()
    assert guide.trial is not None
    assert found["guide"]["title"] == guide.trial.grasp
    with opened(page) as live:
        for step in (guide.step + 1, guide.step, guide.step):
            live.send(json.dumps({"do": "accept", "step": step}))
        live.send('{"do": "nothing"}')
        while json.loads(live.recv(timeout=20))["topic"] != "refused":
            pass
    page.press(5, guide)
    assert (guide.stage, guide.step) == ("countdown", found["guide"]["step"] + 1)


def test_stages_are_sent_at_once_movements_20_times_a_second(
    page: GuidePage, guide: CollectionGuide, monkeypatch: pytest.MonkeyPatch
) -> None:
    published: list[Any] = []
    monkeypatch.setattr(page._server, "publish", lambda _topic, text: published.append(text))
    for time_us in range(0, 1_000_000, 2_000):
        guide.take(time_us, frames(time_us, (500, 40), lost=0))
        page.show(time_us, guide, DEVICES)
    assert len(published) == 20
    guide.press(999_000, "accept")
    page.show(999_000, guide, DEVICES)
    assert len(published) == 21
    page.show(999_001, guide, DEVICES)
    assert len(published) == 21


def test_a_session_without_calibrations_is_shown_by_its_bytes(tmp_path: Path) -> None:
    bare = replace(SESSION, calibration=None, taxels=(), taxel_calibration=None)
    with (
        collection_page("127.0.0.1:0", token=None, session=bare, hands={}, shown=lambda _: {"title": ""}) as page,
        Recorder(tmp_path / "b.mcap", bare) as recorder,
    ):
        guide = CollectionGuide(planned(COLLECTION), recorder, 0)
        page.show(0, guide, ())
        assert told(page, "guide")["guide"]["joints"] == []
        guide.take(0, [GloveFrame(0, bytes((70, 80)), 6)])
        page.show(60_000, guide, ())
        # The glove is not plugged into its box.
        assert told(page, "guide")["guide"]["joints"] == []

"""`thenar record --web` in real browsers, on emulated devices, by keyboard alone."""

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from thenar.cli import run
from thenar.compiler import GraspSet
from thenar.compiler.evaluation.interim import interim_accuracy
from thenar.runtime.recording.guide import read_journal

from .conftest import ENTER, Browser, Command, Wearer

pytestmark = pytest.mark.slow

OBJECTS = 'PoS = ["bottle"]\nTip = ["<script>alert(1)</script>"]\n'


@pytest.fixture
def record(wearer: Wearer, command: Callable[..., Command], tmp_path: Path) -> Callable[..., Command]:
    (tmp_path / "objects.toml").write_text(OBJECTS)

    def begin(*more: object) -> Command:
        options: list[object] = ["--glove", "glove.toml", "--objects", "objects.toml", "--subject", "A"]
        options += ["--repetitions", 3, "--countdown", 0.3, "--seed", 5, "-o", "set.grasps", *more]
        return command("record", *options)

    return begin


def captured(page: Browser) -> None:
    """Start the countdown, and let the grasp be captured."""
    page.press(ENTER)
    reviewed(page)


def reviewed(page: Browser) -> None:
    """Let the grasp be captured; on a busy machine a device may be silent for a moment: then once more."""
    while page.until("review", "ready") == "ready":
        page.press(ENTER)


def paused(page: Browser) -> None:
    """Pause in a countdown; one that ends before the key is pressed is begun again."""
    while (stage := page.until("countdown", "review", "ready", "paused")) != "paused":
        if stage == "countdown":
            page.type("p")
            page.until("review", "ready", "paused")
        else:
            page.press("r" if stage == "review" else ENTER)


def test_a_whole_collection_by_keyboard(
    record: Callable[..., Command], wearer: Wearer, browser: Browser, tmp_path: Path
) -> None:
    going = record("--none")
    page = browser.see(going.url)
    page.until("ready")
    page.picture("collect-ready-1400-light")
    assert page.text("subject") == "A"
    assert page.text("count") == "0 of 9 trials done"
    seen = set()
    for number in range(9):
        closed = wearer.show(number)
        captured(page)
        seen.add(page.text("title"))
        assert page.text("stage") == "captured: keep it?"
        assert page.text("sees").startswith(f"{closed} of {len(wearer.performance.switch_names)} switches closed")
        lit = page.script("return document.querySelectorAll('#glove .spot.closed').length")
        assert lit == closed
    page.picture("collect-review-1400-light")
    page.type(ENTER)
    page.until("done")
    assert page.text("count") == "9 of 9 trials done"
    assert "Power grip, standard type (PoS)" in seen
    assert any(title.startswith("Nothing held: ") for title in seen)
    page.wait(lambda: "of 9 trials" in page.text("study"))
    page.picture("collect-done-1400-light")
    assert page.axe() == []
    told = page.text("study"), page.script("return document.querySelectorAll('#types tr').length")
    page.type(ENTER)
    assert going.finish() == 0, going.said
    page.wait(lambda: page.text("link").startswith("page: ended since"))
    grasp_set = GraspSet.load(tmp_path / "set.grasps")
    assert len(set(grasp_set.trials.tolist())) == 9
    interim = interim_accuracy(grasp_set)
    assert told[0].startswith(f"{interim.correct} of 9 trials (")
    assert told[1] == len(interim.types) == 3
    assert run(["import", str(tmp_path / "set.mcap"), "-o", str(tmp_path / "again.grasps")]) == 0
    assert (tmp_path / "again.grasps").read_bytes() == (tmp_path / "set.grasps").read_bytes()
    assert page.faults() == []


def test_undo_skip_and_pause_in_two_browsers_and_a_kill(
    record: Callable[..., Command], wearer: Wearer, browser: Browser, other: Browser, tmp_path: Path
) -> None:
    going = record("--no-none", "--countdown", 1.5)
    page = browser.see(going.url, width=400, scheme="dark")
    page.until("ready")
    page.wait(lambda: page.offered()[0] == "start the countdown Enter")
    page.press("s")
    assert page.text("count") == "0 of 6 trials done, 1 skipped"
    captured(page)
    page.picture("collect-review-400-dark")
    assert page.overflow() == 0
    assert page.axe() == []
    page.press(ENTER)
    second = other.see(going.url)
    reviewed(page)
    # Both show the same, and a key counts in either, once.
    second.until("review")
    assert [one.text("title") for one in (page, second)] == [page.text("title")] * 2
    assert [one.text("count") for one in (page, second)] == ["1 of 6 trials done, 1 skipped"] * 2
    step = second.step()
    second.press(ENTER)
    page.wait(lambda: page.text("count") == "2 of 6 trials done, 1 skipped")
    assert page.step() != step
    # Text that would be a tag is text.
    for one in (page, second):
        assert one.script("return document.querySelectorAll('main script').length") == 0
    reviewed(page)
    page.press("u")
    paused(page)
    assert page.text("stage").startswith("paused; nothing is recorded meanwhile")
    second.until("paused")
    assert second.text("count") == "1 of 6 trials done, 1 skipped"
    # Who closes the browser in the middle of a trial loses nothing.
    second.press(ENTER)
    page.until("countdown", "review", "ready")
    for one in (page, second):
        one.driver.get("about:blank")
    back = browser.see(going.url, scheme="dark")
    reviewed(back)
    back.picture("collect-review-1400-dark")
    back.press(ENTER)
    assert back.text("count") == "2 of 6 trials done, 1 skipped"
    os.killpg(going.process.pid, signal.SIGKILL)
    going.process.wait()
    back.wait(lambda: back.text("link").startswith("page: not connected since"))
    assert back.offered() == []
    assert len(read_journal(tmp_path / "set.mcap").accepted) == 2

    again = record("--no-none")
    back.see(again.url)
    assert back.text("count") == "2 of 6 trials done"
    back.type("q")
    back.wait(lambda: back.script("return document.getElementById('leaving').open"))
    back.type(ENTER)
    assert again.finish() == 0, again.said
    assert sorted(GraspSet.load(tmp_path / "set.grasps").trials.tolist()) == sorted(
        read_journal(tmp_path / "set.mcap").accepted
    )


def test_a_signal_ends_it_and_the_page_says_so(
    record: Callable[..., Command], browser: Browser, tmp_path: Path
) -> None:
    going = record("--no-none")
    page = browser.see(going.url)
    page.until("ready")
    captured(page)
    page.press(ENTER)
    going.process.send_signal(signal.SIGTERM)
    assert going.finish() == 0, going.said
    page.wait(lambda: page.text("link").startswith("page: ended since"))
    assert page.text("stage") == "the collection has ended"
    assert len(GraspSet.load(tmp_path / "set.grasps")) == 1


def test_the_countdown_waits_for_devices_that_are_lost(
    record: Callable[..., Command], wearer: Wearer, browser: Browser
) -> None:
    going = record("--no-none")
    page = browser.see(going.url)
    page.until("ready")
    page.wait(lambda: page.text("stage") == "Enter starts the countdown" and page.offered()[0].startswith("start"))
    wearer.board_line.unplug()
    page.wait(lambda: page.text("stage").startswith("the countdown waits: ") and "start" not in page.offered()[0])
    lost = page.texts("#devices [data-is=bad]")
    assert len(lost) == 1
    name = lost[0].removeprefix("✗ ").partition(": ")[0]
    assert page.text("stage") == f"the countdown waits: {name} not connected"
    page.wait(lambda: f"{name} lost since " in page.text("glove-state"))
    wearer.glove_line.unplug()
    switches = len(wearer.performance.switch_names)
    page.wait(lambda: page.text("sees").startswith(f"0 of 0 readable switches closed; {switches} lost ("))
    page.wait(lambda: "0 of 0 readable joints measured; 18 lost (" in page.text("sees"))
    page.wait(lambda: page.script("return document.documentElement.classList.contains('old')"))
    assert page.text("link").startswith("page: connected since ")
    assert page.axe() == []
    page.picture("collect-lost-1400-light")
    wearer.board_line.replug()
    wearer.glove_line.replug()
    page.wait(lambda: page.text("stage") == "Enter starts the countdown" and page.offered()[0].startswith("start"))
    captured(page)


def test_without_devices_there_is_neither_a_page_nor_a_file(
    record: Callable[..., Command], wearer: Wearer, tmp_path: Path
) -> None:
    wearer.board.close()
    wearer.glove.close()
    (tmp_path / "glove.toml").write_text('name = "gone"\n[cyberglove]\nport = "nowhere"\n')
    going = record("--no-none")
    assert going.finish() == 2
    assert "there is no such port" in going.said
    assert "the page is at" not in going.said
    assert not list(tmp_path.glob("set.*"))

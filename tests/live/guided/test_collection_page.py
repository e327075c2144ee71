"""`thenar record --web` in real browsers, on emulated devices, by keyboard alone."""

from collections.abc import Callable
from pathlib import Path

import pytest

from thenar.cli import run
from thenar.compiler import GraspSet
from thenar.compiler.evaluation.sofar import recognition_so_far

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


def captured(page: Browser, start: str = ENTER) -> None:
    """Let the next grasp be captured; the countdown begins again while devices are on their way."""
    page.press(start)
    while page.until("review", "ready") == "ready":
        page.press(ENTER)


def test_a_whole_collection_by_keyboard(
    record: Callable[..., Command], wearer: Wearer, browser: Browser, tmp_path: Path
) -> None:
    going = record("--none")
    page = browser.open(going.url)
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
    told = page.text("study"), page.script("return document.querySelectorAll('#types tr').length")
    page.type(ENTER)
    assert going.finish() == 0, going.said
    page.wait(lambda: page.text("link") == "ended")
    grasp_set = GraspSet.load(tmp_path / "set.grasps")
    assert len(set(grasp_set.trials.tolist())) == 9
    so_far = recognition_so_far(grasp_set)
    assert told[0].startswith(f"{so_far.correct} of 9 trials (")
    assert told[1] == len(so_far.types) == 3
    assert run(["import", str(tmp_path / "set.mcap"), "-o", str(tmp_path / "again.grasps")]) == 0
    assert (tmp_path / "again.grasps").read_bytes() == (tmp_path / "set.grasps").read_bytes()
    complaints = [one for one in page.complaints() if "WebSocket" not in one["message"]]
    assert complaints == []

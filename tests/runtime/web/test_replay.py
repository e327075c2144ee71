"""The page of a recording that no build recognised: what a build makes of it now, and what was labelled."""

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.drivers.errors import SettingError
from thenar.runtime import Build
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.recording.session import Label, Session
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.web import replay as module
from thenar.runtime.web.replay import Replay

NAMES = tuple(f"s{number}" for number in range(6))
HARNESS = f'name = "mine"\n[[stream]]\nport = "/dev/none"\nswitches = {list(NAMES)}\n'.replace("'", '"')
HELD_US = 1_000_000


def collected(path: Path, switches: tuple[str, ...], rows: tuple[int, ...]) -> Path:
    """Record rows for a second each, as trials of two types by turns; the last one is done again."""
    session = Session(thenar="1", switches=switches, sensors=(), harness=HARNESS)
    with Recorder(path, session) as recorder:
        for number, row in enumerate(rows):
            start, kind = 1_000_000 + number * HELD_US, ("hook", "pinch")[number % 2]
            recorder.label(Label(start, "begun", number + 1, kind, "A", "cup"))
            for time_us in range(start, start + HELD_US, 10_000):
                recorder.frame(SwitchFrame(time_us, row))
            end = "redone" if row == rows[-1] else "accepted"
            for event in ("captured", end):
                recorder.label(Label(start + HELD_US - 1, event, number + 1, kind, "A", "cup"))  # type: ignore[arg-type]
    return path


@pytest.fixture
def replay(folder: Path, tmp_path: Path) -> Iterator[Callable[..., Replay]]:
    """Return what reads a recording of these rows, whole."""
    with ExitStack() as stack:

        def start(*rows: int, builds: int = 1) -> Replay:
            path = collected(tmp_path / "anna.mcap", NAMES, rows)
            made = stack.enter_context(Replay(path, [folder] * builds))
            assert made._scanned.wait(60)
            return made

        yield start


def asked(replay: Replay, do: str, *numbers: object) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(replay.reply({"do": do, "numbers": numbers}))
    assert found["topic"] == do
    return found


def moment_at(replay: Replay, time_us: int) -> dict[str, Any]:
    """Return what a page shows at a time."""
    frames: list[dict[str, Any]] = asked(replay, "moments", time_us // 10**6)["frames"]
    return [frame for frame in frames if frame["change"][0] <= time_us][-1]


def test_what_the_build_makes_of_a_collection_stands_beside_its_labels(
    folder: Path, replay: Callable[..., Replay]
) -> None:
    build, rows = Build.load(folder), (0b101, 0b11010, 0b111111)
    shown = replay(*rows)
    overview = asked(shown, "overview", 0, 0)
    first, last = overview["first_us"], overview["last_us"]
    assert (overview["share"], overview["faults"]) == (1.0, [])
    for number, row in enumerate(rows):
        grasp = build.recognise(np.array([row >> bit & 1 for bit in range(6)], bool), np.zeros(0, int)).grasp
        at = first + number * HELD_US + 900_000
        frame = moment_at(shown, at)
        assert (frame["closed"], frame["grasp"]) == (f"{row:06b}"[::-1], grasp)
        assert at - 20_000 < frame["change"][0] <= at
        announced = [change[1] for change in overview["changes"][0] if change[0] <= at][-1]
        assert announced == grasp
    # The last one is done again.
    assert [(trial, end - begun, kind) for trial, begun, end, kind in overview["truth"]] == [
        (1, HELD_US - 1, "hook"),
        (2, HELD_US - 1, "pinch"),
    ]
    assert overview["truth"][1][1] - first == HELD_US
    (final,) = asked(shown, "moments", last // 10**6 + 1000)["frames"]
    assert last - 10_000 <= final["change"][0] <= last
    about = json.loads(shown.about)
    assert (about["topic"], about["name"], about["builds"]) == ("replay", "anna.mcap", [folder.name])


def test_a_result_that_is_undone_leaves_no_label(folder: Path, tmp_path: Path) -> None:
    path, session = tmp_path / "undone.mcap", Session(thenar="1", switches=NAMES, sensors=(), harness=HARNESS)
    with Recorder(path, session) as recorder:
        for time_us, event, trial in ((0, "begun", 1), (9, "accepted", 1), (10, "undone", 1), (12, "begun", 1)):
            recorder.label(Label(time_us, event, trial, "hook", "A", "cup"))  # type: ignore[arg-type]
            recorder.frame(SwitchFrame(time_us, 1))
    with Replay(path, [folder]) as shown:
        assert shown._scanned.wait(60)
        found = asked(shown, "overview", 0, 0)
        assert found["truth"] == [[1, found["first_us"], found["first_us"] + 9, "hook"], [1, 0, 0, ""]]


def test_pages_get_the_moments_of_each_second_that_they_ask_for(replay: Callable[..., Replay]) -> None:
    shown = replay(1, 2, 3)
    overview = asked(shown, "overview", 0, 0)
    first, last = overview["first_us"], overview["last_us"]
    joined, newest = list[int](), first
    for second in range(first // 10**6 - 2, last // 10**6 + 3):
        found = asked(shown, "moments", second)
        assert found["second"] == second
        current, *times = [frame["change"][0] for frame in found["frames"]]
        # What was current when it began; before the recording, its first.
        assert current == (newest if second * 10**6 >= first else first)
        assert all(second * 10**6 <= time_us < (second + 1) * 10**6 for time_us in times)
        joined += [time_us for time_us in (current, *times) if time_us not in joined]
        newest = joined[-1]
    # Kept ones are 20 ms apart, as frames of every 10 ms allow, to the end.
    assert (joined[0], joined) == (first, sorted(joined))
    assert all(later - earlier <= 20_000 for earlier, later in pairwise(joined))
    assert last - joined[-1] <= 10_000
    # At a change of the announced type there is a moment, so that a page that goes there shows it.
    assert {change[0] for change in overview["changes"][0]} <= set(joined)


def test_the_overview_comes_in_parts_that_join(replay: Callable[..., Replay], monkeypatch: pytest.MonkeyPatch) -> None:
    shown = replay(1, 2, 4, 8, 16, 32, builds=2)
    whole = asked(shown, "overview", 0, 0, 0)
    assert whole["changes"][0] == whole["changes"][1]
    monkeypatch.setattr(module, "MOST_ENTRIES", 2)
    lists: list[list[Any]] = [[], [], []]
    while True:
        part = asked(shown, "overview", *map(len, lists))
        assert part["have"] == [len(each) for each in lists]
        more = [*part["changes"], part["truth"]]
        assert max(map(len, more)) <= 2
        for each, some in zip(lists, more, strict=True):
            each += some
        if not any(more):
            break
    assert lists == [*whole["changes"], whole["truth"]]
    assert len(whole["truth"]) == 5


def test_a_recording_of_too_many_changes_says_where_its_timeline_ends(
    replay: Callable[..., Replay], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_MOST_CHANGES", 2)
    overview = asked(replay(1, 2, 4, 8, 16, 32), "overview", 0, 0)
    assert (len(overview["changes"][0]), len(overview["truth"])) == (2, 2)
    assert overview["faults"] == ["the timeline ends at 2 changes of the prediction, or labels"]


HUGE = 2**62


@pytest.mark.parametrize(
    "numbers",
    [
        None,
        "0,0,1",
        {},
        (),
        (0, 1, 2),
        (0, 1, 2, 3),
        (None,),
        ("1",),
        (True,),
        (1.5,),
        (float("nan"),),
        (float("inf"),),
        (HUGE,),
        (-HUGE,),
        (10**400,),
        [[0]],
    ],
)
def test_what_is_no_number_is_refused_in_a_sentence(replay: Callable[..., Replay], numbers: object) -> None:
    shown = replay(1, 2)
    for do, count, more in (("moments", 1, ()), ("overview", 2, (0,))):
        given = [*numbers, *more] if isinstance(numbers, list | tuple) else numbers
        with pytest.raises(SettingError, match=f"for the {do} of a recording, a page must send {count} of `n"):
            shown.reply({"do": do, "numbers": given})
    others: tuple[object, ...] = ("delete", "", None, 1, [], "x" * 10**6)
    for wrong in others:
        with pytest.raises(SettingError, match="a page can ask for the overview or for moments") as refusal:
            shown.reply({"do": wrong, "numbers": (0, 1, 1)})
        assert len(str(refusal.value)) < 120


def test_whatever_span_is_asked_for_a_reply_is_bounded(
    replay: Callable[..., Replay], monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = replay(*range(1, 9))
    edges = (-HUGE + 1, -1, 0, 1, 10**6, 5 * 10**6, HUGE - 1)
    for begin in edges:
        assert 1 <= len(asked(shown, "moments", begin)["frames"]) <= 102
        for end in edges:
            assert len(asked(shown, "overview", begin, end)["truth"]) <= 7
    second = asked(shown, "overview", 0, 0)["first_us"] // 10**6 + 1
    whole = asked(shown, "moments", second)["frames"]
    monkeypatch.setattr(module, "MOST_BYTES", 2_000)
    text = shown.reply({"do": "moments", "numbers": (second,)})
    frames = json.loads(text)["frames"]
    # Fewer of them are still of the whole second.
    assert 1 <= len(frames) < len(whole)
    assert frames in [whole[::step] for step in range(2, len(whole))]
    assert len(text) < 2_000 + max(len(json.dumps(frame)) for frame in frames) + 200
    monkeypatch.setattr(module, "MOST_BYTES", 1)
    assert asked(shown, "moments", second)["frames"] == whole[:1]


def test_before_it_is_read_a_moment_is_not_claimed(folder: Path, tmp_path: Path) -> None:
    path = collected(tmp_path / "anna.mcap", NAMES, (1, 2, 3))
    with Replay(path, [folder]) as shown:
        assert shown._scanned.wait(60)
        last = shown._times[-1]
        shown._scanned.clear()
        for second in (last // 10**6, last // 10**6 + 1):
            assert asked(shown, "moments", second)["frames"] == []
        assert asked(shown, "moments", last // 10**6 - 1)["frames"][-1]["change"][0] // 10**6 == last // 10**6 - 1


def test_a_recording_that_lacks_an_input_of_the_build_is_refused(folder: Path, tmp_path: Path) -> None:
    path = collected(tmp_path / "few.mcap", NAMES[:4], (1, 2))
    with pytest.raises(SettingError, match="recorded without s4"):
        Replay(path, [folder])

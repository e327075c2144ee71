from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.runtime.frames import OLD_US, GloveFrame, SwitchFrame
from thenar.runtime.recording.guide import FRESH_US, KEYS, MOVING_US, CollectionGuide, Key, Stage, planned, read_journal
from thenar.runtime.recording.reader import Reader
from thenar.runtime.recording.session import Collection, CollectionTask, Label, Session
from thenar.runtime.recording.writer import Recorder

COUNTDOWN_US = 3_000_000
COLLECTION = Collection(
    "A", "own", ("cup", "pen"), (CollectionTask("cup", ("mug",)), CollectionTask("pen", ("biro",))), 2, 1
)


@pytest.fixture
def recorder(tmp_path: Path, session: Session) -> Recorder:
    return Recorder(tmp_path / "a.mcap", replace(session, collection=COLLECTION))


@pytest.fixture
def guide(recorder: Recorder) -> CollectionGuide:
    return CollectionGuide(planned(COLLECTION), recorder, COUNTDOWN_US)


def whole(time_us: int, closed: int = 1) -> list[SwitchFrame | GloveFrame]:
    return [SwitchFrame(time_us, closed), GloveFrame(time_us, b"\x01\x02", 3)]


def labels(recorder: Recorder) -> list[Label]:
    return [entry for entry in Reader(recorder.path) if isinstance(entry, Label)]


def events(recorder: Recorder) -> list[tuple[str, int]]:
    """What became of trials; that every capture follows when its trial began is looked at here."""
    found = labels(recorder)
    for begun, label in pairwise(found):
        assert label.event != "captured" or (begun.event, begun.trial) == ("begun", label.trial)
    return [(label.event, label.trial) for label in found if label.event != "begun"]


def stage(guide: CollectionGuide) -> Stage:
    return guide.stage


def test_one_key_a_trial_leads_through_all(guide: CollectionGuide, recorder: Recorder) -> None:
    assert stage(guide) == "ready"
    guide.press(0, "accept")
    now = 0
    for trial in planned(COLLECTION):
        assert stage(guide) == "countdown"
        assert guide.trial == trial
        assert guide.seconds_left(now) == 3.0
        guide.take(now + COUNTDOWN_US - 1, whole(now + COUNTDOWN_US - 1))
        assert stage(guide) == "countdown"
        now += COUNTDOWN_US
        guide.take(now, whole(now))
        assert stage(guide) == "review"
        guide.press(now, "accept")
    assert stage(guide) == "done"
    assert (guide.trial, guide.done, guide.total) == (None, 4, 4)
    guide.press(now, "accept")
    assert stage(guide) == "over"
    assert events(recorder) == [(event, number) for number in (1, 2, 3, 4) for event in ("captured", "accepted")]


def test_what_came_when_the_countdown_ended_is_captured_and_nothing_later(
    guide: CollectionGuide, recorder: Recorder
) -> None:
    guide.press(0, "accept")
    guide.take(COUNTDOWN_US, whole(COUNTDOWN_US, closed=0b101))
    guide.take(COUNTDOWN_US + 1, whole(COUNTDOWN_US + 1, closed=0b010))
    assert guide.captured == (SwitchFrame(COUNTDOWN_US, 0b101), GloveFrame(COUNTDOWN_US, b"\x01\x02", 3))
    entries = list(Reader(recorder.path))
    captured = [isinstance(entry, Label) and entry.event == "captured" for entry in entries]
    before = entries[: captured.index(True)]
    assert before[-2] == SwitchFrame(COUNTDOWN_US, 0b101)


def test_a_countdown_may_begin_again_but_is_not_cut_short(guide: CollectionGuide) -> None:
    guide.press(0, "accept")
    guide.press(1000, "accept")
    assert guide.seconds_left(0) == 3.0
    guide.press(1000, "redo")
    assert guide.seconds_left(1000) == 3.0


@pytest.mark.parametrize(
    ("frames", "problem"),
    [
        ([], "the switches are silent"),
        ([SwitchFrame(COUNTDOWN_US, 0)], "the CyberGlove is silent"),
        ([GloveFrame(COUNTDOWN_US, b"12")], "the switches are silent"),
        (whole(COUNTDOWN_US - FRESH_US - 1), "the switches are silent"),
        (
            [SwitchFrame(COUNTDOWN_US, 0), GloveFrame(COUNTDOWN_US - FRESH_US - 1, b"12")],
            "the CyberGlove is silent",
        ),
        ([SwitchFrame(COUNTDOWN_US, 0, lost=0b101)], "switches cannot be read: s000, s002"),
        (
            [SwitchFrame(COUNTDOWN_US, 0), GloveFrame(COUNTDOWN_US, b"12", 0b110)],
            "the CyberGlove is not plugged into its box",
        ),
    ],
)
def test_nothing_is_captured_of_devices_that_are_not_all_there(
    guide: CollectionGuide, recorder: Recorder, frames: list[SwitchFrame | GloveFrame], problem: str
) -> None:
    guide.press(0, "accept")
    guide.take(COUNTDOWN_US, frames)
    assert (guide.stage, guide.problem) == ("ready", problem)
    assert events(recorder) == []
    guide.press(COUNTDOWN_US, "accept")
    assert guide.problem == ""
    guide.take(2 * COUNTDOWN_US, whole(2 * COUNTDOWN_US))
    assert stage(guide) == "review"


def test_no_countdown_starts_while_a_device_is_lost(guide: CollectionGuide, recorder: Recorder) -> None:
    guide.take(0, whole(0))
    assert "accept" in guide.offered()
    guide.take(1, [], ["bench board"])
    assert guide.lost == "bench board not connected"
    guide.press(1, "accept")
    guide.press(1, "redo")
    assert stage(guide) == "ready"
    guide.take(OLD_US, [SwitchFrame(OLD_US, 0)])
    assert guide.lost == ""
    guide.take(OLD_US + 1, [SwitchFrame(OLD_US + 1, 0)])
    assert guide.lost == "the CyberGlove is silent"
    assert "accept" not in guide.offered()
    now = 2 * OLD_US
    guide.take(now, whole(now))
    # One frame with a lost switch is no lost device.
    for time_us, lost in ((now + 1, ""), (now + OLD_US + 1, "switches cannot be read: s001")):
        guide.take(time_us, [SwitchFrame(time_us, 0, lost=2), GloveFrame(time_us, b"\x01\x02", 3)])
        assert guide.lost == lost
    now += 2 * OLD_US
    guide.take(now, whole(now))
    guide.press(now, "accept")
    now += COUNTDOWN_US
    guide.take(now, whole(now))
    assert stage(guide) == "review"
    # A trial that is kept does not begin the next countdown either; what was captured is still shown.
    guide.take(now + 1, [], ["glove", "bench board"])
    assert guide.captured == tuple(whole(now))
    guide.press(now + 1, "accept")
    assert (guide.stage, guide.done, guide.lost) == ("ready", 1, "glove, bench board not connected")


def test_a_frame_as_old_as_may_be_is_captured(guide: CollectionGuide) -> None:
    guide.press(0, "accept")
    guide.take(COUNTDOWN_US, whole(COUNTDOWN_US - FRESH_US))
    assert stage(guide) == "review"


def test_a_glove_without_switches_and_switches_without_a_glove_are_enough(tmp_path: Path, session: Session) -> None:
    frames: tuple[SwitchFrame | GloveFrame, ...] = GloveFrame(0, b"12"), SwitchFrame(0, 1)
    for frame, bare in zip(frames, (replace(session, switches=()), replace(session, sensors=())), strict=True):
        recorder = Recorder(tmp_path / f"{len(bare.sensors)}.mcap", replace(bare, collection=COLLECTION))
        guide = CollectionGuide(planned(COLLECTION), recorder, 0)
        guide.press(0, "accept")
        guide.take(0, [frame])
        assert stage(guide) == "review"


def test_an_empty_hand_moves_after_the_countdown_and_is_captured_then(tmp_path: Path, session: Session) -> None:
    collection = replace(COLLECTION, tasks=(CollectionTask("none", ("open hand", "release")),))
    with Recorder(tmp_path / "a.mcap", replace(session, collection=collection)) as recorder:
        guide = CollectionGuide(planned(collection), recorder, COUNTDOWN_US)
        guide.press(0, "accept")
        assert stage(guide) == "countdown"
        now = COUNTDOWN_US
        guide.take(now, whole(now))
        assert stage(guide) == "moving"
        assert guide.seconds_left(now) == MOVING_US / 1e6
        guide.take(now + MOVING_US - 1, whole(now + MOVING_US - 1))
        guide.press(now + MOVING_US - 1, "accept")
        assert stage(guide) == "moving"
        guide.press(now + MOVING_US - 1, "redo")
        assert stage(guide) == "countdown"
        now += COUNTDOWN_US + MOVING_US
        guide.take(now, whole(now))
        guide.take(now + MOVING_US, [])
        assert (guide.stage, guide.problem) == ("ready", "the switches are silent")
        now += MOVING_US
        guide.take(now, whole(now))
        guide.press(now, "accept")
        now += COUNTDOWN_US
        for moment in (now, now + MOVING_US):
            guide.take(moment, whole(moment))
        assert stage(guide) == "review"
        guide.press(now + MOVING_US, "accept")
        assert (guide.trial, guide.done) == (planned(collection)[1], 1)
    assert events(recorder) == [("captured", 1), ("accepted", 1)]
    found = labels(recorder)
    assert [label.event for label in found] == ["begun", "begun", "begun", "captured", "accepted"]
    assert found[-2].time_us - found[-3].time_us == MOVING_US
    assert {label.grasp for label in found} == {"none"}


def test_where_nothing_is_left_one_may_still_undo(recorder: Recorder) -> None:
    guide = CollectionGuide(planned(COLLECTION), recorder, 0, (3, 1, 2, 4))
    assert (guide.stage, guide.done) == ("done", 4)
    guide.press(0, "undo")
    assert stage(guide) == "ready"
    assert guide.trial == planned(COLLECTION)[3]
    assert labels(recorder)[-1].event == "undone"


@settings(deadline=None)
@given(st.lists(st.sampled_from([*KEYS, None]), max_size=40))
def test_whatever_is_pressed_each_trial_counts_once_and_in_order(
    tmp_path_factory: pytest.TempPathFactory, presses: list[Key | None]
) -> None:
    session = Session(thenar="1", switches=("s",), sensors=(), collection=COLLECTION)
    with Recorder(tmp_path_factory.mktemp("guide") / "a.mcap", session) as recorder:
        guide = CollectionGuide(planned(COLLECTION), recorder, 10)
        for time_us, press in enumerate(presses):
            if press is None or guide.stage == "over":
                guide.take(20 * time_us, [SwitchFrame(20 * time_us, 1)])
            else:
                guide.press(20 * time_us, press)
    told = events(recorder)
    accepted: list[int] = []
    for (event, trial), (before, other) in zip(told, [("", 0), *told], strict=False):
        # A capture is judged, nothing else is but by a skip, and what is judged is what was captured.
        assert (before == "captured") <= (event in ("accepted", "redone", "skipped"))
        assert (event in ("accepted", "redone")) <= (before == "captured")
        assert before != "captured" or trial == other
        if event == "accepted":
            accepted.append(trial)
        elif event == "undone" and trial in accepted:
            assert accepted.pop() == trial
    assert accepted == sorted(set(accepted))
    assert len(accepted) == guide.done
    assert set(read_journal(recorder.path).accepted) == set(accepted)


def test_nothing_is_captured_while_a_taxel_cannot_be_read(tmp_path: Path, session: Session) -> None:
    for switches in (session.switches, ()):
        wired = replace(session, switches=switches, sensors=(), taxels=("p", "q"), collection=COLLECTION)
        with Recorder(tmp_path / f"{len(switches)}.mcap", wired) as recorder:
            guide = CollectionGuide(planned(COLLECTION), recorder, 0)
            for frames, problem in (
                ([], "are silent"),
                ([SwitchFrame(0, 0)], "taxels cannot be read: p, q"),
                ([SwitchFrame(1, 0, taxels=(5, None))], "taxels cannot be read: q"),
                ([SwitchFrame(2, 0, taxels=(5, 0))], ""),
            ):
                guide.press(2, "redo")
                guide.take(2, frames)
                assert guide.problem.endswith(problem)
                assert (guide.problem == "") == (problem == "")
            assert stage(guide) == "review"


def take(guide: CollectionGuide, now: int) -> int:
    """Let the countdown end and the grasp be captured; return when."""
    now += COUNTDOWN_US
    guide.take(now, whole(now))
    assert stage(guide) == "review"
    return now


def test_the_last_trial_is_undone_and_comes_again_at_once(guide: CollectionGuide, recorder: Recorder) -> None:
    first, second, *_ = planned(COLLECTION)
    assert "undo" not in guide.offered()
    guide.press(0, "undo")
    assert (stage(guide), guide.trial) == ("ready", first)
    guide.press(0, "accept")
    now = take(guide, 0)
    guide.press(now, "accept")
    assert guide.offered()["undo"] == f"undo the last ({first.grasp})"
    now = take(guide, now)
    # The second was captured, and is not judged: it is dropped with the first.
    guide.press(now, "undo")
    assert (stage(guide), guide.trial, guide.done) == ("countdown", first, 0)
    for trial in (first, second):
        assert guide.trial == trial
        now = take(guide, now)
        guide.press(now, "accept")
    assert events(recorder) == [
        ("captured", 1),
        ("accepted", 1),
        ("captured", 2),
        ("redone", 2),
        ("undone", 1),
        ("captured", 1),
        ("accepted", 1),
        ("captured", 2),
        ("accepted", 2),
    ]
    assert read_journal(recorder.path).accepted == (1, 2)


def test_a_trial_is_skipped_at_any_stage(guide: CollectionGuide, recorder: Recorder) -> None:
    guide.press(0, "skip")
    assert stage(guide) == "ready"
    guide.press(0, "accept")
    guide.press(1, "skip")
    assert stage(guide) == "countdown"
    assert guide.seconds_left(1) == 3.0
    now = take(guide, 1)
    guide.press(now, "skip")
    assert (guide.done, guide.skipped, guide.trial) == (0, 3, planned(COLLECTION)[3])
    now = take(guide, now)
    guide.press(now, "accept")
    assert (stage(guide), guide.done, guide.skipped) == ("done", 1, 3)
    assert "skip" not in guide.offered()
    assert read_journal(recorder.path).accepted == (4,)
    # The skipped one is the last but one.
    guide.press(now, "undo")
    guide.press(now, "undo")
    assert (stage(guide), guide.trial) == ("ready", planned(COLLECTION)[2])
    assert read_journal(recorder.path).accepted == ()


def test_a_pause_ends_the_countdown_and_nothing_is_recorded_meanwhile(
    guide: CollectionGuide, recorder: Recorder
) -> None:
    guide.press(0, "pause")
    assert stage(guide) == "ready"
    guide.press(0, "accept")
    guide.take(1, whole(1))
    before = recorder.messages
    guide.press(2, "pause")
    guide.take(2 * COUNTDOWN_US, whole(2 * COUNTDOWN_US, closed=0b11))
    assert (stage(guide), recorder.messages) == ("paused", before)
    # Seen it is all the same.
    assert guide.captured[0] == SwitchFrame(2 * COUNTDOWN_US, 0b11)
    now = 2 * COUNTDOWN_US
    guide.press(now, "skip")
    assert (stage(guide), guide.trial) == ("paused", planned(COLLECTION)[1])
    guide.press(now, "undo")
    assert (stage(guide), guide.trial) == ("paused", planned(COLLECTION)[0])
    guide.press(now, "pause")
    assert stage(guide) == "countdown"
    assert guide.seconds_left(now) == 3.0
    now = take(guide, now)
    assert "pause" not in guide.offered()
    guide.press(now, "pause")
    assert stage(guide) == "review"


def test_what_is_offered_does_something_and_nothing_else_does(guide: CollectionGuide) -> None:
    quiet = {"redo", "quit", "pause"}
    now = 0
    for press in ("accept", None, "accept", "pause", "accept", None):
        for key in set(KEYS) - set(guide.offered()) - quiet:
            step = guide.step
            guide.press(now, key)
            assert guide.step == step, (guide.stage, key)
        step = guide.step
        now = now if press is not None else take(guide, now)
        if press is not None:
            guide.press(now, press)
        assert guide.step > step


def test_a_later_sitting_may_undo_what_an_earlier_one_accepted(tmp_path: Path, session: Session) -> None:
    wanted = replace(session, collection=COLLECTION)
    with Recorder(tmp_path / "a.mcap", wanted) as recorder:
        guide = CollectionGuide(planned(COLLECTION), recorder, COUNTDOWN_US)
        guide.press(0, "accept")
        guide.press(take(guide, 0), "accept")
    journal = read_journal(recorder.path)
    with Recorder(recorder.path, wanted, tail=journal.tail) as recorder:
        guide = CollectionGuide(planned(COLLECTION), recorder, COUNTDOWN_US, journal.accepted)
        assert guide.trial == planned(COLLECTION)[1]
        guide.press(0, "undo")
        assert (stage(guide), guide.trial, guide.done) == ("ready", planned(COLLECTION)[0], 0)
    assert read_journal(recorder.path).accepted == ()

"""Recordings of grasps and of the empty hand, led by the guide itself: trials as rows, and as a stream of movements."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from thenar.compiler.recordings.mcap_recording import import_files, import_recordings
from thenar.compiler.recordings.taxonomy import MOVEMENTS, collected, published
from thenar.runtime.errors import FormatError
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.recording.guide import MOVING_US, CollectionGuide, planned, read_journal
from thenar.runtime.recording.reader import Reader
from thenar.runtime.recording.session import Collection, CollectionTask, Label, Session
from thenar.runtime.recording.writer import Recorder

SENSORS = tuple(f"j{number}" for number in range(4))
START_US, COUNTDOWN_US, TICK_US = 1_000_000, 2_000_000, 5_000
GRASPS = (CollectionTask("PoS", ("jar",)), CollectionTask("Tip", ("pin",)))
COLLECTION = Collection(
    "A", "kamakura14", published("kamakura14").types, (*GRASPS, CollectionTask("none", tuple(MOVEMENTS)[:2])), 2, 3
)
SESSION = Session(thenar="1", switches=("s1", "s2", "s3"), sensors=SENSORS, collection=COLLECTION)
POSES: dict[str, tuple[int, tuple[float, ...]]] = {
    "PoS": (0b011, (180, 170, 160, 150)),
    "Tip": (0b100, (90, 100, 170, 180)),
}
OPEN = np.array([60.0, 60, 60, 60])


class Wearer:
    """A hand that does what it is asked for: closes a second after a trial has begun, opens when it was judged."""

    def __init__(self, recorder: Recorder, redo: int = 0, undo: int = 0) -> None:
        self.guide = CollectionGuide(planned(recorder.session.collection or COLLECTION), recorder, COUNTDOWN_US)
        self.truth: list[tuple[int, str, int]] = []  # when which grasp closed and opened: time, type, trial
        self._redo, self._undo, self._at, self._goal, self._closed = redo, undo, OPEN.copy(), OPEN, 0
        self._random = np.random.default_rng(4)

    def collect(self) -> None:
        """Go through all trials."""
        now, begun, judge = START_US, 0, 0
        self.guide.press(now, "accept")
        while self.guide.trial is not None:
            now += TICK_US
            trial = self.guide.trial
            counting = self.guide.stage == "countdown" and self.guide.seconds_left(now) <= 1
            if counting and trial.grasp != "none" and begun != trial.number:
                begun, (self._closed, goal) = trial.number, POSES[trial.grasp]
                self._goal = np.array(goal, float)
                self.truth.append((now, trial.grasp, trial.number))
            self._at += 0.08 * (self._goal - self._at)
            raw = np.rint(self._at + self._random.normal(0, 0.6, 4)).astype(np.uint8).tobytes()
            self.guide.take(now, [SwitchFrame(now, self._closed), GloveFrame(now, raw)])
            if self.guide.stage != "review":
                judge = 0
            elif not judge:
                judge = now + 700_000
            elif now >= judge:
                again = trial.grasp != "none" and self._redo > 0
                self._redo -= again
                self.guide.press(now, "redo" if again else "accept")
                if self._undo and trial.grasp != "none" and self.guide.trial is not None:
                    self._undo -= 1
                    self.guide.press(now, "undo")
                    again = True
                begun = 0 if again else begun
                if self._closed:
                    self._closed, self._goal = 0, OPEN
                    self.truth.append((now, "none", trial.number))


@pytest.fixture
def recorded(tmp_path: Path) -> tuple[Path, Wearer]:
    with Recorder(tmp_path / "a.mcap", SESSION) as recorder:
        wearer = Wearer(recorder)
        wearer.collect()
    return recorder.path, wearer


def held_at(wearer: Wearer, times_us: np.ndarray) -> list[str]:
    """What the switches say is held at these times."""
    found = np.searchsorted([time for time, *_ in wearer.truth], times_us, "right") - 1
    return [wearer.truth[place][1] if place >= 0 else "none" for place in found.tolist()]


def start_of(path: Path) -> int:
    """When the first row of a stream was recorded: once the first trial has begun, and frames have come."""
    begun = next(entry.time_us for entry in Reader(path) if isinstance(entry, Label))
    return begun + 10_000 * (begun == START_US)


def test_trials_of_the_empty_hand_are_rows_of_none(recorded: tuple[Path, Wearer]) -> None:
    grasp_set, report = import_recordings([recorded[0]])
    assert (report.frames, report.rests, report.grasp_types, report.trials) == (24, 2, 2, 6)
    nothing = {trial.number: trial.object for trial in planned(COLLECTION) if trial.grasp == "none"}
    empty = grasp_set.rows(grasp_set.is_none)
    assert {*zip(empty.trials.tolist(), empty.objects.tolist(), strict=True)} == {*nothing.items()}
    assert np.bincount(empty.trials)[list(nothing)].tolist() == [MOVING_US // 200_000] * 2
    assert not empty.switches.any()
    assert grasp_set.without_none().switches.any(axis=1).all()
    assert grasp_set.times_us.size == 0


def test_a_stream_says_while_when_each_grasp_is_held(recorded: tuple[Path, Wearer]) -> None:
    path, wearer = recorded
    grasp_set, report = import_files([path], stream=True)
    assert (report.grasp_types, report.subjects, grasp_set.sessions[0]) == (2, 1, "1")
    assert grasp_set.times_us[0] == 0
    steps = np.diff(grasp_set.times_us)
    assert set(steps[steps < 100_000].tolist()) == {10_000}
    expected = np.array(held_at(wearer, grasp_set.times_us + start_of(path)))
    wrong = expected != grasp_set.grasps
    # A grasp is held once the joints are near: a hand that closes takes its time.
    assert wrong.mean() < 0.08
    changes = np.array([time - start_of(path) for time, *_ in wearer.truth])
    assert np.abs(changes[:, np.newaxis] - grasp_set.times_us[wrong]).min(axis=0).max() < 300_000
    assert {*grasp_set.grasps.tolist()} == {"PoS", "Tip", "none"}
    assert len(np.unique(grasp_set.movement_ids)) == 6
    runs = np.flatnonzero(np.diff(grasp_set.labels)) + 1
    assert [grasp for grasp in grasp_set.grasps[runs].tolist() if grasp != "none"] == [
        trial.grasp for trial in planned(COLLECTION) if trial.grasp != "none"
    ]


def test_what_was_done_again_is_left_out_of_a_stream(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", SESSION) as recorder:
        wearer = Wearer(recorder, redo=1)
        wearer.collect()
    grasp_set, _ = import_recordings([recorder.path], stream=True)
    again = wearer.truth[1][0]  # the first grasp was let go, and is closed to once more
    assert grasp_set.is_none[grasp_set.times_us + start_of(recorder.path) < again].all()
    assert len(np.unique(grasp_set.trial_ids[~grasp_set.is_none])) == 4


def test_what_was_undone_is_left_out_of_a_stream(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", SESSION) as recorder:
        wearer = Wearer(recorder, undo=2)
        wearer.collect()
    assert [event.event for event in Reader(recorder.path) if isinstance(event, Label)].count("undone") == 2
    grasp_set, _ = import_recordings([recorder.path], stream=True)
    held = [trial for _, grasp, trial in wearer.truth if grasp != "none"]
    assert len(held) > len(set(held))
    assert len(np.unique(grasp_set.trial_ids[~grasp_set.is_none])) == len(set(held)) == 4
    last = {trial: time for time, grasp, trial in wearer.truth if grasp != "none"}
    times = (grasp_set.times_us + start_of(recorder.path))[~grasp_set.is_none]
    trials = grasp_set.trials[~grasp_set.is_none]
    assert all(time > last[trial] for time, trial in zip(times.tolist(), trials.tolist(), strict=True))


def test_without_the_empty_hand_only_held_rows_are_known(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", replace(SESSION, collection=replace(COLLECTION, tasks=GRASPS))) as recorder:
        Wearer(recorder).collect()
    grasp_set, report = import_recordings([recorder.path], stream=True)
    assert (report.rests, report.trials) == (0, 4)
    assert grasp_set.switches.any(axis=1).all()


def test_a_hand_that_never_moves_is_empty_where_the_guide_said_so(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", SESSION) as recorder:
        wearer = Wearer(recorder)
        with pytest.MonkeyPatch.context() as patched:
            patched.setitem(POSES, "PoS", (0, tuple(OPEN)))
            patched.setitem(POSES, "Tip", (0, tuple(OPEN)))
            wearer.collect()
    grasp_set, _ = import_recordings([recorder.path], stream=True)
    assert np.count_nonzero(grasp_set.is_none) == 2 * MOVING_US // 10_000
    assert len(np.unique(grasp_set.trial_ids)) == 6


def test_what_was_begun_anew_is_another_session(recorded: tuple[Path, Wearer]) -> None:
    path, _ = recorded
    with Recorder(path, SESSION, tail=read_journal(path).tail) as recorder:
        Wearer(recorder).collect()
    grasp_set, _ = import_recordings([path], stream=True)
    sessions, first = np.unique(grasp_set.sessions, return_index=True)
    assert sessions.tolist() == ["1", "2"]
    assert grasp_set.times_us[first].tolist() == [0, 0]


def test_a_recording_whose_clock_jumps_makes_no_rows_of_the_gap(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", SESSION) as recorder:
        wearer = Wearer(recorder)
        wearer.collect()
        recorder.frame(SwitchFrame(2**50, 0))
        recorder.frame(GloveFrame(2**50, b"1234"))
    grasp_set, _ = import_recordings([recorder.path], stream=True)
    assert len(grasp_set) < 5000


def test_a_stream_longer_than_its_file_can_have_recorded_is_refused(
    recorded: tuple[Path, Wearer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("thenar.runtime.recording.reader._LARGEST_MADE", -recorded[0].stat().st_size)
    with pytest.raises(FormatError, match="its stream would take"):
        import_recordings([recorded[0]], stream=True)


def test_the_empty_hand_is_collected_where_it_is_asked_for(tmp_path: Path) -> None:
    types, tasks = collected("kamakura14", None, none=True)
    assert types == published("kamakura14")
    assert (len(tasks), tasks[-1]) == (15, CollectionTask("none", tuple(MOVEMENTS)))
    objects = tmp_path / "objects.toml"
    objects.write_text('cup = ["mug"]\nNone = ["wave"]\npen = ["biro"]\n', encoding="utf-8")
    types, tasks = collected("own", objects, none=True)
    assert types.types == ("cup", "pen")
    assert tasks == (
        CollectionTask("cup", ("mug",)),
        CollectionTask("pen", ("biro",)),
        CollectionTask("none", ("wave",)),
    )
    assert collected("own", objects)[1] == tasks[:2]

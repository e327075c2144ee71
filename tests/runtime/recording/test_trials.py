from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from thenar.drivers.errors import SettingError
from thenar.runtime.recording.guide import planned, read_journal
from thenar.runtime.recording.session import Collection, CollectionTask, Label, Session
from thenar.runtime.recording.writer import Recorder

TASKS = (
    CollectionTask("cup", ("mug", "jar")),
    CollectionTask("pen", ("biro",)),
    CollectionTask("rod", ("a", "b", "c")),
)


def collection(repetitions: int = 4, seed: int = 0, tasks: tuple[CollectionTask, ...] = TASKS) -> Collection:
    return Collection("A", "own", tuple(task.grasp for task in tasks), tasks, repetitions, seed)


@given(st.integers(1, 30), st.integers(0, 2**32))
def test_every_type_comes_as_often_and_its_objects_by_turns(repetitions: int, seed: int) -> None:
    trials = planned(collection(repetitions, seed))
    assert [trial.number for trial in trials] == list(range(1, 3 * repetitions + 1))
    assert Counter(trial.grasp for trial in trials) == dict.fromkeys(("cup", "pen", "rod"), repetitions)
    for task in TASKS:
        counts = Counter(trial.object for trial in trials if trial.grasp == task.grasp)
        assert max(counts.values()) - min(counts[name] for name in task.objects) <= 1


@given(st.integers(0, 2**32))
def test_equal_seeds_give_equal_orders_and_others_mostly_others(seed: int) -> None:
    assert planned(collection(10, seed)) == planned(collection(10, seed))
    assert planned(collection(10, seed)) != planned(collection(10, seed + 1))


def test_the_order_is_that_of_all_pythons() -> None:
    assert "".join(trial.grasp[0] for trial in planned(collection(5, 3))) == "pppcpcrrcccrrpr"


def test_every_order_is_as_likely() -> None:
    tasks = TASKS[:2]
    first = Counter(planned(collection(1, seed, tasks))[0].grasp for seed in range(2000))
    # 1000 expected, 22 the standard deviation.
    assert abs(first["cup"] - 1000) < 100


def begun(path: Path, session: Session, events: list[tuple[str, int]]) -> None:
    with Recorder(path, replace(session, collection=collection())) as recorder:
        for event, trial in events:
            recorder.label(Label(trial, event, trial, "cup", "A", "mug"))  # type: ignore[arg-type]


def test_a_journal_knows_what_was_accepted(tmp_path: Path, session: Session) -> None:
    path = tmp_path / "a.mcap"
    events = [("captured", 1), ("accepted", 1), ("captured", 2), ("redone", 2), ("captured", 2), ("accepted", 2)]
    begun(path, session, [*events, ("captured", 3)])
    journal = read_journal(path)
    assert journal.accepted == (1, 2)
    assert journal.session.collection == collection()
    with Recorder(path, replace(session, collection=collection()), tail=journal.tail) as recorder:
        recorder.label(Label(9, "accepted", 3, "cup", "A", "mug"))
        recorder.label(Label(9, "undone", 1, "cup", "A", "mug"))
        recorder.label(Label(9, "accepted", 1, "cup", "A", "mug"))
    assert read_journal(path).accepted == (2, 3, 1)


def test_a_recording_without_trials_is_no_journal(tmp_path: Path, session: Session) -> None:
    path = tmp_path / "a.mcap"
    Recorder(path, replace(session, collection=None)).close()
    with pytest.raises(SettingError, match="a recording without trials: name another output"):
        read_journal(path)


def test_behind_what_another_program_added_nothing_is_recorded(tmp_path: Path, session: Session) -> None:
    path = tmp_path / "a.mcap"
    begun(path, session, [("captured", 1)])
    data = path.read_bytes()
    end = data.rindex(b"\x0f\x04\0\0\0\0\0\0\0")
    path.write_bytes(data[:end] + b"\x80" + (5).to_bytes(8, "little") + b"12345" + data[end:])
    with pytest.raises(SettingError, match="was changed by another program"):
        read_journal(path)


def test_behind_what_is_damaged_nothing_is_recorded(tmp_path: Path, session: Session) -> None:
    """A new checksum over it would hide the damage for good."""
    path = tmp_path / "a.mcap"
    begun(path, session, [("captured", 1)])
    path.write_bytes(path.read_bytes().replace(b'"object":"mug"', b'"object":"jug"'))
    with pytest.raises(SettingError, match="or is damaged: import it"):
        read_journal(path)


def test_more_trials_than_anybody_takes_are_refused() -> None:
    with pytest.raises(SettingError, match="3 grasp types of 400000 repetitions each are more than 1000000 trials"):
        planned(collection(400_000))

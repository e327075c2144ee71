"""A recording that is read from anywhere, beside the same one read from its beginning."""

import os
from collections.abc import Sequence
from pathlib import Path

import pytest
from msgspec.structs import replace

from thenar.runtime.errors import FormatError
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.published import LiveGrasp
from thenar.runtime.recording.reader import Entry, Index, Reader
from thenar.runtime.recording.session import Label, Session
from thenar.runtime.recording.writer import Recorder

from ...conftest import calls

START_US = 5_000_000
FRAMES = 1500


def grasp(time_us: int, number: int) -> LiveGrasp:
    name = "cup" if number // 400 % 2 else "pen"
    return LiveGrasp(time_us, time_us + 10**15, number, name, name, 0.9, 3, "ok", 20, 30, 10)


def record(path: Path, session: Session, frames: int = FRAMES, sessions: int = 1) -> Path:
    """Record frames 4 ms apart, with a label every second, in so many sessions."""
    tail = None
    for part in range(sessions):
        with Recorder(path, replace(session, build="ab" * 32), tail=tail) as recorder:
            for number in range(frames):
                now = START_US + part * 100_000_000 + 4000 * number
                switches, glove = SwitchFrame(now, number % 4096), GloveFrame(now + 1, bytes((1 + number % 250, 9)))
                recorder.moment((switches, glove), grasp(now + 2, number))
                if number % 250 == 249:
                    recorder.label(Label(now + 3, "accepted", number, "cup", "A", "mug"))
        for _ in (reader := Reader(path)):
            tail = reader.tail
    return path


def whole(path: Path) -> list[tuple[int, Entry]]:
    """Return all entries with their moments, by the Reader."""
    reader, found = Reader(path), list[tuple[int, Entry]]()
    for entry in reader:
        clock_us = reader.session.clock_ns // 1000
        found.append((clock_us if isinstance(entry, Session) else clock_us + entry.time_us, entry))
    return found


def frames(entries: Sequence[tuple[int, Entry]]) -> list[tuple[int, Entry]]:
    return [pair for pair in entries if not isinstance(pair[1], Session)]


@pytest.fixture
def path(tmp_path: Path, session: Session) -> Path:
    return record(tmp_path / "long.mcap", session)


def test_from_any_moment_all_that_follows_is_read_and_not_much_before(path: Path) -> None:
    index, all_of_it = Index(path), whole(path)
    assert list(index.scan()) == all_of_it
    assert (index.scanned, index.fault) == (path.stat().st_size, "")
    entries = frames(all_of_it)
    assert index.first_us == entries[0][0]
    assert index.last_us == entries[-1][0]
    for moment in range(entries[0][0] - 10_000_000, entries[-1][0] + 10_000_000, 333_333):
        session, *found = index.since(moment)
        assert isinstance(session[1], Session)
        assert found == entries[len(entries) - len(found) :]
        assert {pair for pair in entries if pair[0] >= moment} <= set(found)
        assert found[0][0] > min(moment, entries[-1][0]) - 500_000 or found == entries


def test_an_overview_decodes_all_labels_and_few_recognitions(path: Path) -> None:
    found = [entry for _, entry in Index(path).scan(100_000)]
    kinds = [sum(isinstance(entry, kind) for entry in found) for kind in (SwitchFrame, GloveFrame, LiveGrasp, Label)]
    assert kinds == [0, 0, 4 * FRAMES // 100, FRAMES // 250]
    sampled, every = (calls(lambda us=us: list(Index(path).scan(us))) for us in (100_000, 0))  # type: ignore[misc]
    assert sampled < every / 2


def test_seeking_reads_no_more_of_longer_recordings(tmp_path: Path, session: Session) -> None:
    cost = []
    for frames_ in (1000, 8000):
        index = Index(record(tmp_path / f"{frames_}.mcap", session, frames_))
        list(index.scan(100_000))
        assert index.last_us is not None
        last_us = index.last_us
        cost.append(calls(lambda index=index, last_us=last_us: list(index.since(last_us - 1_000_000))))  # type: ignore[misc]
    assert cost[1] < 1.3 * cost[0]


def test_what_was_scanned_can_be_read_while_the_rest_still_is(path: Path) -> None:
    index, entries = Index(path), frames(whole(path))
    scan = index.scan()
    for _ in range(len(entries) // 2):
        next(scan)
    assert 0 < index.scanned < index.size
    assert index.first_us is not None
    found = frames(list(index.since(index.first_us)))
    assert found == entries[: len(found)]
    assert abs(len(found) - len(entries) // 2) < 5


def test_sessions_that_follow_each_other_are_read_by_their_own_clocks(tmp_path: Path, session: Session) -> None:
    path = record(tmp_path / "resumed.mcap", session, 300, sessions=3)
    index = Index(path)
    all_of_it = list(index.scan())
    assert all_of_it == whole(path)
    assert sum(isinstance(entry, Session) for _, entry in all_of_it) == 3
    last = frames(all_of_it)[-1]
    assert list(index.since(last[0] - 300_000))[-1] == last


@pytest.mark.parametrize("share", [0.3, 0.7, 0.999])
def test_a_cut_recording_is_read_where_whole_and_named(path: Path, share: float) -> None:
    os.truncate(path, int(share * path.stat().st_size))
    index, entries = Index(path), frames(whole(path))
    assert frames(list(index.scan())) == entries
    assert "long.mcap is whole up to byte" in index.fault
    assert "the rest was left out" in index.fault
    assert index.last_us == entries[-1][0]
    assert list(index.since(entries[-1][0]))[-1] == entries[-1]


def test_a_damaged_recording_is_read_up_to_the_named_place(path: Path) -> None:
    entries, data = frames(whole(path)), bytearray(path.read_bytes())
    place = data.index(b'"number":1000,')
    data[place : place + 8] = b'"nomber"'
    path.write_bytes(data)
    index = Index(path)
    found = frames(list(index.scan()))
    assert found == entries[: len(found)]
    assert len(found) > 3000
    assert "the record at byte" in index.fault
    assert "nothing behind it is read" in index.fault
    assert list(index.since(found[-1][0]))[-1] == found[-1]


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "no.mcap").write_bytes(b"no")
    with pytest.raises(FormatError, match="does not begin like an MCAP file"):
        Index(tmp_path / "no.mcap")

import os
import resource
import signal
import stat
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from struct import unpack
from threading import Event
from zlib import crc32

import msgspec
import pytest
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from msgspec.structs import replace

from thenar.drivers.errors import SettingError
from thenar.runtime.errors import FormatError, FrameError
from thenar.runtime.frames import GloveFrame, SwitchFrame, now_us
from thenar.runtime.published import LiveGrasp
from thenar.runtime.recording.guide import read_journal
from thenar.runtime.recording.layout import CHANNELS, Tail
from thenar.runtime.recording.mcap import LARGEST_RECORD
from thenar.runtime.recording.reader import Reader
from thenar.runtime.recording.session import Collection, Label, Session
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.taxels import TaxelCalibration

from ...gloves import pad_line

Entry = SwitchFrame | GloveFrame | LiveGrasp | Label
Record = Callable[[Recorder, Entry], None]


def frames_of(path: Path) -> list[object]:
    return [entry for entry in Reader(path) if not isinstance(entry, Session)]


def test_all_comes_back_as_it_was_recorded(recording: Path, session: Session, entries: list[Entry]) -> None:
    reader = Reader(recording)
    first, *rest = reader
    assert isinstance(first, Session)
    assert replace(first, clock_ns=0) == session
    assert rest == entries
    assert reader.end is not None
    assert (reader.end.closed, reader.end.whole, reader.altered, reader.foreign) == (
        True,
        recording.stat().st_size,
        False,
        False,
    )


def test_the_mcap_library_reads_it_by_its_summary_and_checks_its_checksums(recording: Path) -> None:
    with recording.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        counts = {summary.channels[number].topic: n for number, n in summary.statistics.channel_message_counts.items()}
        assert counts == {
            "/thenar/switches": 4,
            "/thenar/glove": 2,
            "/thenar/grasp": 2,
            "/thenar/recognition": 2,
            "/thenar/trials": 2,
            "/thenar/taxels": 0,
        }
        numbers = summary.statistics
        assert (numbers.message_count, numbers.schema_count, numbers.channel_count) == (12, 2, 6)
        assert (numbers.metadata_count, numbers.attachment_count, numbers.chunk_count) == (1, 0, 0)
        [metadata] = reader.iter_metadata()
        assert metadata.name == "thenar"
        assert msgspec.json.decode(metadata.metadata["session"])["harness"] == 'name = "bänk"\n'
    with recording.open("rb") as file:
        messages = [record for record in StreamReader(file, validate_crcs=True).records if isinstance(record, Message)]
    assert summary.statistics.message_start_time == messages[0].log_time
    assert summary.statistics.message_end_time == messages[-1].log_time


def test_the_summary_has_the_checksum_of_the_specification(recording: Path) -> None:
    data = recording.read_bytes()
    # Footer: opcode, length, start of the summary, start of its offsets (none), CRC-32 of all from that start to here.
    opcode, length, start, offsets, checksum = unpack("<BQQQI", data[-37:-8])
    assert (opcode, length, offsets) == (2, 20, 0)
    assert checksum == crc32(data[start:-12])


def test_ros_reads_every_message_by_the_definitions_in_the_file(recording: Path) -> None:
    with recording.open("rb") as file:
        decoded = [
            (channel.topic, message.data)
            for _, channel, _, message in make_reader(
                file, decoder_factories=[DecoderFactory()]
            ).iter_decoded_messages()
        ]
    assert decoded[0] == ("/thenar/switches", bytes([0, 1, 0, 1, *[0] * 7, 2]))
    assert decoded[1] == ("/thenar/glove", b"\x01\xff\x03")
    assert [data for topic, data in decoded if topic == "/thenar/grasp"] == ["unknown", "cup"]
    assert decoded[3][1].startswith('{"time_us":')


def test_the_file_is_ordered_by_log_time(tmp_path: Path, session: Session) -> None:
    start = now_us()
    with Recorder(tmp_path / "a.mcap", session) as recorder:
        for late in (50, 20, 70, 0, 70):
            recorder.frame(SwitchFrame(start + late, 0))
        clock_ns = recorder.session.clock_ns
    with recorder.path.open("rb") as file:
        messages = [record for record in StreamReader(file).records if isinstance(record, Message)]
    assert [message.publish_time - clock_ns - 1000 * start for message in messages] == [50000, 20000, 70000, 0, 70000]
    assert [message.log_time - clock_ns - 1000 * start for message in messages] == [50000, 50000, 70000, 70000, 70000]
    assert [message.sequence for message in messages] == [0, 1, 2, 3, 4]


def test_times_are_those_of_the_date(recording: Path) -> None:
    [first, *_] = Reader(recording)
    assert isinstance(first, Session)
    assert abs(first.clock_ns + time.monotonic_ns() - time.time_ns()) < 60e9


def test_a_date_that_steps_moves_nothing(tmp_path: Path, session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.mcap"
    with Recorder(path, session) as recorder:
        recorder.frame(SwitchFrame(now_us(), 1))
        monkeypatch.setattr(time, "time_ns", lambda: 0)
        recorder.frame(SwitchFrame(now_us(), 2))
    # The clock of a board that has no battery starts in 1970 again.
    with Recorder(path, session, tail=read_journal(path).tail) as recorder:
        recorder.frame(SwitchFrame(now_us(), 3))
    with path.open("rb") as file:
        messages = [record for record in StreamReader(file).records if isinstance(record, Message)]
    assert len(messages) == 3
    for times in ([message.log_time for message in messages], [message.publish_time for message in messages]):
        assert times == sorted(times)
        assert times[-1] - times[0] < 60e9


def test_a_recording_is_never_written_over(recording: Path, session: Session) -> None:
    before = recording.read_bytes()
    with pytest.raises(SettingError, match="exists, and a recording is never overwritten"):
        Recorder(recording, session)
    assert recording.read_bytes() == before


def test_a_folder_that_is_not_there_is_an_error_before_anything_starts(tmp_path: Path, session: Session) -> None:
    with pytest.raises(FileNotFoundError):
        Recorder(tmp_path / "no" / "a.mcap", session)


def test_nobody_else_may_read_a_recording(tmp_path: Path, session: Session) -> None:
    path = tmp_path / "a.mcap"
    with Recorder(path, replace(session, collection=Collection("A", "own", (), (), 1, 0))):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    with Recorder(path, session, tail=read_journal(path).tail):
        pass
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_a_glove_whose_description_no_reader_would_take_is_refused(tmp_path: Path, session: Session) -> None:
    with pytest.raises(SettingError, match="and at most 16777216 are recorded: shorten glove"):
        Recorder(tmp_path / "a.mcap", replace(session, harness="#" * LARGEST_RECORD))
    with pytest.raises(SettingError, match=r"this cannot be recorded: its session cannot be read: .*sensors"):
        Recorder(tmp_path / "a.mcap", replace(session, sensors=tuple(f"j{number}" for number in range(256))))
    assert not list(tmp_path.iterdir())


def test_a_frame_of_another_glove_is_refused_and_the_file_stays_whole(tmp_path: Path, session: Session) -> None:
    with Recorder(tmp_path / "a.mcap", session) as recorder:
        with pytest.raises(FrameError):
            recorder.frame(SwitchFrame(0, 1 << 12))
        with pytest.raises(FrameError):
            recorder.frame(GloveFrame(0, b"123"))
        recorder.frame(SwitchFrame(5, 1))
    assert len(frames_of(recorder.path)) == 1


@pytest.mark.parametrize("cut", [0, 1, 40])
def test_a_recorder_goes_on_behind_the_last_whole_record(
    recording: Path, session: Session, entries: list[Entry], record: Record, cut: int
) -> None:
    data_end = recording.read_bytes().rindex(b"\x0f\x04\0\0\0\0\0\0\0")
    if cut:
        os.truncate(recording, data_end - cut)
    kept = frames_of(recording)
    assert kept == entries[: len(kept)]
    assert len(kept) == len(entries) - (cut > 0)
    with Recorder(recording, session, tail=read_journal(recording).tail) as recorder:
        for entry in entries:
            record(recorder, entry)
    reader = Reader(recording)
    again = list(reader)
    assert [entry for entry in again if not isinstance(entry, Session)] == [*kept, *entries]
    assert len([entry for entry in again if isinstance(entry, Session)]) == 2
    assert not reader.altered
    with recording.open("rb") as file:
        mcap = make_reader(file, validate_crcs=True)
        summary = mcap.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        messages = [message for _, _, message in mcap.iter_messages(log_time_order=False)]
        assert len(list(mcap.iter_metadata())) == 2
    assert summary.statistics.message_count == len(messages)
    assert all(before.log_time <= after.log_time for before, after in pairwise(messages))


def fill(recorder: Recorder) -> list[SwitchFrame]:
    """Record until a frame is lost, and return the others."""
    frames: list[SwitchFrame] = []
    while recorder.failure is None:
        frames.append(SwitchFrame(now_us(), len(frames) % 4096))
        recorder.frame(frames[-1])
    return frames[:-1]


def check_that_it_goes_on(recorder: Recorder, frames: list[SwitchFrame]) -> None:
    """Record once there is room again, and check that the file is whole and lacks one frame only."""
    assert recorder.lost == 1
    frames.append(SwitchFrame(now_us(), 7))
    recorder.frame(frames[-1])
    assert (recorder.failure, recorder.lost) == (None, 1)
    recorder.close()
    reader = Reader(recorder.path)
    assert [entry for entry in reader if not isinstance(entry, Session)] == frames
    assert reader.end is not None
    assert (reader.end.closed, reader.altered, recorder.messages) == (True, False, len(frames))


@pytest.mark.parametrize("beyond", range(0, 80, 7))
def test_a_full_disk_loses_what_comes_and_nothing_else(tmp_path: Path, session: Session, beyond: int) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    path = tmp_path / "a.mcap"
    recorder = Recorder(path, session)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8000 + beyond, before[1]))
    try:
        frames = fill(recorder)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    size = path.stat().st_size
    assert recorder.failure == (
        f"{path}: File too large: nothing more is written after {size} bytes, all of them whole"
    )
    assert frames_of(path) == frames
    assert len(frames) > 10
    reader = Reader(path)
    list(reader)
    assert reader.end is not None
    assert (reader.end.whole, reader.end.reason) == (size, "it was never closed")
    check_that_it_goes_on(recorder, frames)


def test_a_session_that_does_not_fit_is_no_session(recording: Path, session: Session) -> None:
    tail, before = read_journal(recording).tail, resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (tail.size + 10, before[1]))
    try:
        with pytest.raises(OSError, match="File too large: nothing more is written after"):
            Recorder(recording, session, tail=tail)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_nobody_waits_for_a_slow_disk(tmp_path: Path, session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    syncing, go_on = Event(), Event()

    def slowly(_file: int) -> None:
        syncing.set()
        assert go_on.wait(30)

    monkeypatch.setattr(os, "fdatasync", slowly)
    recorder = Recorder(tmp_path / "a.mcap", session, sync_s=0.01)
    recorder.frame(SwitchFrame(now_us(), 1))
    assert syncing.wait(30)
    recorder.frame(SwitchFrame(now_us(), 2))
    assert [frame.closed for frame in frames_of(recorder.path)] == [1, 2]  # type: ignore[attr-defined]
    go_on.set()
    recorder.close()


def test_a_disk_that_fails_later_ends_the_recording(
    tmp_path: Path, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = Event()

    def failing(_file: int) -> None:
        tried.set()
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fdatasync", failing)
    with Recorder(tmp_path / "a.mcap", session, sync_s=0.01) as recorder:
        recorder.frame(SwitchFrame(now_us(), 1))
        assert tried.wait(30)
    assert recorder.failure is not None
    assert "Input/output error" in recorder.failure


def test_closing_twice_is_closing_once(recording: Path, session: Session, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "b.mcap", session)
    recorder.close()
    size = recorder.path.stat().st_size
    recorder.close()
    assert recorder.path.stat().st_size == size
    # Its descriptor may be another file's by now.
    recorder.frame(SwitchFrame(0, 1))
    assert recorder.failure is None
    assert recorder.path.stat().st_size == size


KILLED = """
    import sys
    from pathlib import Path
    from thenar.runtime.frames import SwitchFrame
    from thenar.runtime.recording.session import Session
    from thenar.runtime.recording.writer import Recorder

    recorder = Recorder(Path(sys.argv[1]), Session(thenar="1", switches=("s",) * 160, sensors=(), taxels=("p", "q")))
    number = 0
    while True:
        recorder.frame(SwitchFrame(number, number, taxels=(number & 0xFFF, None)))
        sys.stdout.write(f"{number}\\n")
        sys.stdout.flush()
        number += 1
"""


@pytest.mark.parametrize("after", [0, 7, 500, 3000])
def test_a_killed_process_has_recorded_all_that_it_said_it_had(tmp_path: Path, after: int) -> None:
    path = tmp_path / "a.mcap"
    command = [sys.executable, "-c", textwrap.dedent(KILLED), str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for _ in range(after + 1):
            process.stdout.readline()
        process.send_signal(signal.SIGKILL)
        said = after + 1 + len(process.stdout.read().splitlines())
    found = frames_of(path)
    assert found == [SwitchFrame(number, number, taxels=(number & 0xFFF, None)) for number in range(len(found))]
    assert len(found) >= said


def test_taxels_have_a_topic_in_every_recording(tmp_path: Path, session: Session) -> None:
    def topics(path: Path) -> dict[str, int]:
        with path.open("rb") as file:
            summary = make_reader(file, validate_crcs=True).get_summary()
            assert summary is not None
            assert summary.statistics is not None
            counts = summary.statistics.channel_message_counts
            return {channel.topic: counts.get(number, 0) for number, channel in summary.channels.items()}

    with Recorder(tmp_path / "plain.mcap", session):
        pass
    assert topics(tmp_path / "plain.mcap") == {topic: 0 for topic, _ in CHANNELS.values()}
    analog = replace(session, taxels=("p", "q"), taxel_calibration=TaxelCalibration(sensors=(pad_line("p", 1, 9),)))
    path, frames = tmp_path / "a.mcap", [SwitchFrame(time_us, 1, taxels=(time_us, 3)) for time_us in (5, 6)]
    with Recorder(path, analog):
        pass
    assert topics(path)["/thenar/taxels"] == 0
    reader = Reader(path)
    assert replace(reader.session, clock_ns=0) == analog
    list(reader)
    with Recorder(path, analog, tail=reader.tail) as recorder:
        for frame in frames:
            recorder.frame(frame)
        recorder.frame(SwitchFrame(7, 1))
        with pytest.raises(FrameError, match="a frame has 1 taxels, but 2 are recorded"):
            recorder.frame(SwitchFrame(8, 1, taxels=(1,)))
        with pytest.raises(FrameError, match=r"outside 0\.\.65534"):
            recorder.frame(SwitchFrame(8, 1, taxels=(65535, 1)))
    assert frames_of(path) == [*frames, SwitchFrame(7, 1)]
    assert topics(path)["/thenar/taxels"] == 2
    other = replace(analog, taxels=("p", "r"))
    with Recorder(path, other, tail=read_to_the_end(path)):
        pass
    with pytest.raises(FormatError, match="its switches, taxels or sensors differ"):
        read_to_the_end(path)


def read_to_the_end(path: Path) -> Tail:
    reader = Reader(path)
    list(reader)
    return reader.tail

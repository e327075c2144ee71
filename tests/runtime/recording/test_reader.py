import os
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from struct import pack
from typing import Any

import pytest
from mcap.opcode import Opcode
from mcap.records import Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from msgspec.structs import replace

from thenar.runtime.errors import FormatError
from thenar.runtime.frames import GloveFrame, SwitchFrame
from thenar.runtime.published import LiveGrasp
from thenar.runtime.recording.guide import read_journal
from thenar.runtime.recording.mcap import LARGEST_RECORD, MAGIC
from thenar.runtime.recording.reader import OTHER_RECORDS, Reader
from thenar.runtime.recording.session import Label, Session
from thenar.runtime.recording.writer import Recorder

from ...conftest import peak_bytes

Entry = SwitchFrame | GloveFrame | LiveGrasp | Label
Record = Callable[[Recorder, Entry], None]
DATA_END = b"\x0f\x04\0\0\0\0\0\0\0"


def read(path: Path) -> tuple[list[object], Reader]:
    reader = Reader(path)
    return [entry for entry in reader if not isinstance(entry, Session)], reader


def ends_of_records(data: bytes) -> list[int]:
    """Return where every record ends, by the lengths that stand in the file."""
    ends, place = [], len(MAGIC)
    while place < len(data) - len(MAGIC):
        place += 9 + int.from_bytes(data[place + 1 : place + 9], "little")
        ends.append(place)
    return ends


def test_a_file_cut_at_any_byte_gives_its_whole_entries(recording: Path, tmp_path: Path, entries: list[Entry]) -> None:
    data = recording.read_bytes()
    ends = ends_of_records(data)
    # Those of the messages on channels that are entries of their own, in order.
    messages = [
        end for begin, end in zip([len(MAGIC), *ends], ends, strict=False) if data[begin] == 5 and data[begin + 9] != 3
    ]
    assert len(messages) == len(entries)
    session_end = next(end for begin, end in zip([0, *ends], ends, strict=False) if data[begin] == 0x0C)
    path = tmp_path / "cut.mcap"
    path.write_bytes(data)
    for cut in range(len(data), -1, -1):
        os.truncate(path, cut)
        if cut < session_end:
            with pytest.raises(FormatError, match=r"cut.mcap (does not begin like an MCAP file|holds no session)"):
                Reader(path)
            continue
        found, reader = read(path)
        assert found == entries[: sum(end <= cut for end in messages)]
        assert reader.end is not None
        assert reader.end.closed == (cut == len(data))
        assert reader.end.size == cut
        assert reader.end.whole == (cut if cut in (len(data), *ends[:-1]) else max(e for e in ends if e <= cut))
        assert bool(reader.end.reason) == (cut < len(data))
        assert not reader.altered


def test_zeros_after_a_power_cut_are_left_out(recording: Path, entries: list[Entry]) -> None:
    data = recording.read_bytes()
    end = data.rindex(DATA_END)
    recording.write_bytes(data[:end] + bytes(4096))
    found, reader = read(recording)
    assert found == entries
    assert reader.end is not None
    assert (reader.end.whole, reader.end.reason) == (end, "no record begins there")


def read_cheaply(path: Path) -> tuple[list[object], Reader]:
    """Read a recording within four megabytes."""
    done = list[tuple[list[object], Reader]]()
    assert peak_bytes(lambda: done.append(read(path))) < 4_000_000
    return done[0]


@pytest.mark.parametrize("claimed", [2**63, 2**40, 2**31, LARGEST_RECORD + 1, 10_000])
def test_a_length_that_is_damaged_takes_no_memory(recording: Path, claimed: int) -> None:
    data = bytearray(recording.read_bytes())
    begin = next(end for end in ends_of_records(bytes(data)) if data[end] == 5)
    data[begin + 1 : begin + 9] = pack("<Q", claimed)
    recording.write_bytes(bytes(data))
    found, reader = read_cheaply(recording)
    assert found == []
    assert reader.end is not None
    assert reader.end.whole == begin
    assert reader.end.reason.startswith(f"a record claims {claimed} bytes and ")


def test_a_record_too_large_to_be_one_is_passed_over_unread(recording: Path, entries: list[Entry]) -> None:
    data = recording.read_bytes()
    first = next(end for end in ends_of_records(data) if data[end] == 5)
    with recording.open("wb") as file:
        file.write(data[:first] + pack("<BQ", 5, LARGEST_RECORD + 1))
        # A hole: it is as long as it says and takes no disk.
        file.seek(LARGEST_RECORD + 1, 1)
        file.write(data[first:])
    found, reader = read_cheaply(recording)
    assert found == entries
    assert reader.foreign


@pytest.mark.parametrize(
    "places",
    [
        pytest.param(lambda size: range(size // 3 * 8, size * 8, 13), id="some"),
        pytest.param(lambda size: range(0, size * 8, 3), id="every third bit", marks=pytest.mark.slow),
    ],
)
def test_no_flipped_bit_of_a_closed_recording_is_silent(
    recording: Path, tmp_path: Path, places: Callable[[int], range]
) -> None:
    data = bytearray(recording.read_bytes())
    path = tmp_path / "flipped.mcap"
    for place in places(len(data)):
        data[place // 8] ^= 1 << place % 8
        path.write_bytes(data)
        data[place // 8] ^= 1 << place % 8
        try:
            _, reader = read(path)
        except FormatError:
            continue
        faults = list(reader.faults())
        assert faults, divmod(place, 8)
        assert all(fault.message.startswith(path.name) for fault in faults)


@pytest.mark.parametrize("kind", [b"\x05", b"\x0c", b"\x06", b"\x04", b"\x03"])
@pytest.mark.parametrize("bit", range(8))
def test_a_record_whose_kind_is_damaged_is_named_with_its_place(
    recording: Path, session: Session, record: Record, entries: list[Entry], kind: bytes, bit: int
) -> None:
    """Also in a recording that was never closed, where no checksum says so."""
    with Recorder(recording, session, tail=read_journal(recording).tail) as recorder:
        record(recorder, entries[0])
    data = bytearray(recording.read_bytes()[: recording.read_bytes().rindex(DATA_END)])
    begin = max((end for end in ends_of_records(bytes(data))[:-1] if data[end] == kind[0]), default=None)
    if begin is None:
        return
    data[begin] ^= 1 << bit
    recording.write_bytes(data)
    try:
        _, reader = read(recording)
    except FormatError:
        return
    assert any(f"byte {begin}" in fault.message for fault in reader.faults()), list(reader.faults())


def test_of_a_recording_that_was_closed_a_checksum_is_missed(recording: Path) -> None:
    data = recording.read_bytes()
    end = data.rindex(DATA_END) + len(DATA_END)
    for without, said in (
        (data[:end] + bytes(4) + data[end + 4 :], "the checksum of its data does not match"),
        (data[:-12] + bytes(4) + data[-8:], "the checksum of its summary does not match"),
        (data[: end - len(DATA_END)] + data[end + 4 :], "the end of its data is missing"),
    ):
        recording.write_bytes(without)
        _, reader = read(recording)
        assert reader.altered
        assert [fault.kind for fault in reader.faults() if said in fault.message] == ["altered recordings"]


def test_what_follows_the_end_is_told(recording: Path) -> None:
    size = recording.stat().st_size
    with recording.open("ab") as file:
        file.write(b"more")
    _, reader = read(recording)
    assert [fault.message for fault in reader.faults()] == [
        f"whole.mcap is whole up to byte {size} of {size + 4}, the rest was left out: "
        "bytes follow the end of the recording"
    ]


def test_what_is_no_mcap_is_named(tmp_path: Path) -> None:
    path = tmp_path / "set.mcap"
    for content in (b"", b"PK\x03\x04", b"\x80\x04\x95pickle"):
        path.write_bytes(content)
        with pytest.raises(FormatError, match=r"set\.mcap does not begin like an MCAP file"):
            Reader(path)


def test_a_recording_of_another_program_is_named(tmp_path: Path) -> None:
    path = tmp_path / "camera.mcap"
    with path.open("wb") as file:
        writer: Any = Writer(file, compression=CompressionType.NONE)
        writer.start()
        writer.finish()
    with pytest.raises(FormatError, match="holds no session of thenar"):
        Reader(path)


def copied(source: Path, target: Path, **options: Any) -> None:
    """Write the messages of `source` as another program would: its own channel numbers, a camera between."""
    with source.open("rb") as file:
        records = list(StreamReader(BytesIO(file.read())).records)
    output = BytesIO()
    writer: Any = Writer(output, **options)
    writer.start()
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    camera = None
    for record in records:
        if isinstance(record, Metadata):
            writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Schema):
            schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
        elif isinstance(record, Channel) and record.id not in channels:
            camera = camera or writer.register_channel("/camera", "cdr", schemas[record.schema_id])
            schema = schemas[record.schema_id]
            channels[record.id] = writer.register_channel(record.topic, record.message_encoding, schema)
        elif isinstance(record, Message):
            writer.add_message(camera, record.log_time, b"picture", record.log_time)
            writer.add_message(channels[record.channel_id], record.log_time, record.data, record.publish_time)
    writer.finish()
    target.write_bytes(output.getvalue())


def test_what_other_programs_made_of_a_recording_is_read(recording: Path, tmp_path: Path, entries: list[Entry]) -> None:
    path = tmp_path / "copy.mcap"
    copied(recording, path, compression=CompressionType.NONE, use_chunking=False)
    found, reader = read(path)
    assert found == entries
    assert reader.foreign
    assert not list(reader.faults())


def test_a_copy_in_chunks_is_refused_with_advice(recording: Path, tmp_path: Path) -> None:
    path = tmp_path / "copy.mcap"
    copied(recording, path, compression=CompressionType.NONE)
    with pytest.raises(FormatError, match=r"copy\.mcap: the record at byte \d+ is a chunk, .* data as CSV"):
        read(path)


def test_a_session_of_another_glove_is_refused(recording: Path, session: Session) -> None:
    tail = read_journal(recording).tail
    with Recorder(recording, replace(session, switches=session.switches[1:]), tail=tail):
        pass
    with pytest.raises(FormatError, match="begins a session of another glove"):
        read(recording)


def test_a_number_beyond_64_bits_is_refused(recording: Path) -> None:
    data = recording.read_bytes()
    place = data.index(b'"number":1,')
    begin = max(end for end in ends_of_records(data) if end < place)
    length = int.from_bytes(data[begin + 1 : begin + 9], "little") + 30
    text = int.from_bytes(data[begin + 35 : begin + 39], "little") + 30
    head = data[:begin] + pack("<BQ", 5, length) + data[begin + 9 : begin + 35] + pack("<I", text)
    larger = head + data[begin + 39 : place] + b'"number":1' + b"0" * 30 + data[place + 10 :]
    recording.write_bytes(larger)
    with pytest.raises(FormatError, match="its 'number' has more than 64 bits"):
        read(recording)


@pytest.mark.parametrize(
    ("opcode", "behind_the_data"),
    [(Opcode.MESSAGE_INDEX, True), (0x80, False), (Opcode.CHANNEL, True), (Opcode.SCHEMA, False)],
)
def test_records_without_measurements_are_read_up_to_a_limit(
    recording: Path, opcode: int, behind_the_data: bool
) -> None:
    """Ten million of nine bytes each would take minutes."""
    data = recording.read_bytes()
    ends = [place for place in ends_of_records(data) if data[place] in (Opcode.DATA_END, Opcode.FOOTER)]
    place = ends[-1] if behind_the_data else ends[0]
    content: dict[int, bytes] = {
        Opcode.CHANNEL: pack("<HHIII", 90, 0, 0, 0, 0),
        Opcode.SCHEMA: pack("<HIII", 90, 0, 0, 0),
    }
    record = pack("<BQ", opcode, len(content.get(opcode, b""))) + content.get(opcode, b"")
    recording.write_bytes(data[:place] + record * (OTHER_RECORDS + 1) + data[place:])
    with pytest.raises(FormatError, match=r"is one of more than 100000 that hold no measurements, the most that are"):
        read(recording)


def test_a_message_that_no_session_explains_is_named(recording: Path) -> None:
    data = recording.read_bytes()
    ends = ends_of_records(data)
    begin = next(end for end in ends if data[end] == 0x0C)
    recording.write_bytes(data[:begin] + data[next(end for end in ends if end > begin) :])
    with pytest.raises(FormatError, match=f"the record at byte {begin} is a message before any session of thenar"):
        Reader(recording)


def test_a_message_that_cannot_be_read_is_named_with_its_place(recording: Path) -> None:
    data = recording.read_bytes()
    place = data.index(b'"event":"captured"')
    begin = max(end for end in ends_of_records(data) if end < place)
    recording.write_bytes(data.replace(b'"event":"captured"', b'"event":"kaptured"'))
    said = rf"whole\.mcap: the record at byte {begin} cannot be read: Invalid enum value"
    with pytest.raises(FormatError, match=said):
        read(recording)


def test_topics_are_ours_only_with_our_types(recording: Path) -> None:
    data = recording.read_bytes()
    recording.write_bytes(data.replace(b"std_msgs/msg/String", b"std_msgs/msg/Strong"))
    with pytest.raises(
        FormatError, match=r"says that /thenar/grasp holds cdr of std_msgs/msg/Strong, not cdr of std_msgs/msg/String"
    ):
        read(recording)


def test_a_file_may_grow_while_it_is_read(recording: Path, entries: list[Entry]) -> None:
    reader = Reader(recording)
    with recording.open("ab") as file:
        file.write(b"more")
    assert [entry for entry in reader if not isinstance(entry, Session)] == entries

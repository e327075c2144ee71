import os
import tracemalloc
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from struct import pack
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.records import Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from thenar.runtime.live.frames import GloveFrame, SwitchFrame
from thenar.runtime.live.published import LiveGrasp
from thenar.runtime.recording.errors import McapError
from thenar.runtime.recording.layout import CHANNELS, LARGEST_RECORD, MAGIC
from thenar.runtime.recording.reader import Reader
from thenar.runtime.recording.session import Label, Session

Entry = SwitchFrame | GloveFrame | LiveGrasp | Label
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


def test_a_file_that_is_cut_at_any_byte_gives_what_is_whole_and_says_what_is_cut(
    recording: Path, tmp_path: Path, entries: list[Entry]
) -> None:
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
            with pytest.raises(McapError, match=r"cut.mcap (does not begin as an MCAP file does|holds no session)"):
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


def test_the_rest_of_a_file_that_a_power_cut_filled_with_zeros_is_left_out(
    recording: Path, entries: list[Entry]
) -> None:
    data = recording.read_bytes()
    end = data.rindex(DATA_END)
    recording.write_bytes(data[:end] + bytes(4096))
    found, reader = read(recording)
    assert found == entries
    assert reader.end is not None
    assert (reader.end.whole, reader.end.reason) == (end, "no record begins there")


@pytest.mark.parametrize("claimed", [2**63, 2**40, 2**31, LARGEST_RECORD + 1, 10_000])
def test_a_length_that_is_damaged_takes_no_memory(recording: Path, claimed: int) -> None:
    data = bytearray(recording.read_bytes())
    place = data.index(b"\x05", ends_of_records(bytes(data))[8])
    begin = next(end for end in ends_of_records(bytes(data)) if data[end] == 5)
    data[begin + 1 : begin + 9] = pack("<Q", claimed)
    recording.write_bytes(bytes(data))
    assert place
    tracemalloc.start()
    found, reader = read(recording)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert found == []
    assert reader.end is not None
    assert reader.end.whole == begin
    assert reader.end.reason.startswith(f"a record claims {claimed} bytes and ")
    assert peak < 4_000_000


def test_a_record_too_large_to_be_one_is_passed_over_unread(recording: Path, entries: list[Entry]) -> None:
    data = recording.read_bytes()
    first = next(end for end in ends_of_records(data) if data[end] == 5)
    with recording.open("wb") as file:
        file.write(data[:first] + pack("<BQ", 5, LARGEST_RECORD + 1))
        # A hole: it is as long as it says and takes no disk.
        file.seek(LARGEST_RECORD + 1, 1)
        file.write(data[first:])
    tracemalloc.start()
    found, reader = read(recording)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert found == entries
    assert reader.foreign
    assert peak < 4_000_000


@pytest.mark.slow
def test_every_flipped_byte_is_refused_told_or_found_by_the_checksum(
    recording: Path, tmp_path: Path, entries: list[Entry]
) -> None:
    data = recording.read_bytes()
    path = tmp_path / "flipped.mcap"
    said = set()
    for place in range(data.rindex(DATA_END)):
        path.write_bytes(data[:place] + bytes([data[place] ^ 0x10]) + data[place + 1 :])
        try:
            _, reader = read(path)
        except McapError as wrong:
            said.add(str(wrong).partition(":")[0].split()[0])
            continue
        assert reader.end is not None
        assert reader.altered or not reader.end.closed or reader.foreign, place
    assert said == {path.name}


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=150, deadline=None)
@given(st.data())
def test_no_damage_raises_anything_but_its_own_error(recording: Path, data: st.DataObject) -> None:
    good = recording.read_bytes()
    bad = bytearray(good)
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(bad) - 1))
        cut = data.draw(st.integers(0, 12))
        bad[place : place + cut] = data.draw(st.binary(max_size=12))
    path = recording.with_name("bad.mcap")
    path.write_bytes(bytes(bad))
    with suppress(McapError):
        read(path)


def test_what_is_no_mcap_is_named(tmp_path: Path) -> None:
    path = tmp_path / "set.mcap"
    for content in (b"", b"PK\x03\x04", b"\x80\x04\x95pickle"):
        path.write_bytes(content)
        with pytest.raises(McapError, match=r"set\.mcap does not begin as an MCAP file does"):
            Reader(path)


def test_a_recording_of_another_program_is_named(tmp_path: Path) -> None:
    path = tmp_path / "camera.mcap"
    with path.open("wb") as file:
        writer: Any = Writer(file, compression=CompressionType.NONE)
        writer.start()
        writer.finish()
    with pytest.raises(McapError, match="holds no session of thenar"):
        Reader(path)


def copied(source: Path, target: Path, **options: Any) -> None:
    """Write the messages of `source` as another program would: its own channel numbers, a camera between, in chunks."""
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


@pytest.mark.parametrize("chunked", [True, False])
def test_what_other_programs_made_of_a_recording_is_read(
    recording: Path, tmp_path: Path, entries: list[Entry], chunked: bool
) -> None:
    path = tmp_path / "copy.mcap"
    copied(recording, path, compression=CompressionType.NONE, use_chunking=chunked, chunk_size=300)
    found, reader = read(path)
    assert found == entries
    assert reader.foreign
    assert not reader.altered


def test_a_compressed_copy_is_refused_with_advice(recording: Path, tmp_path: Path) -> None:
    path = tmp_path / "copy.mcap"
    copied(recording, path, compression=CompressionType.NONE, chunk_size=300)
    data = path.read_bytes()
    # The compression of the first chunk, in place of none: 4 bytes longer.
    chunk = data.index(b"\x06", data.index(b"thenar"))
    while int.from_bytes(data[chunk + 1 : chunk + 9], "little") > 2000:
        chunk = data.index(b"\x06", chunk + 1)
    length = int.from_bytes(data[chunk + 1 : chunk + 9], "little")
    changed = data[: chunk + 1] + pack("<Q", length + 4) + data[chunk + 9 : chunk + 37] + pack("<I", 4) + b"zstd"
    path.write_bytes(changed + data[chunk + 41 :])
    with pytest.raises(McapError, match=r"copy\.mcap: the record at byte \d+ is compressed by zstd: `mcap decompress`"):
        read(path)


def test_chunks_inside_chunks_are_refused_however_deep(recording: Path) -> None:
    data = recording.read_bytes()
    begin = next(end for end in ends_of_records(data) if data[end] == 5)
    nested = b""
    for _ in range(2000):
        content = pack("<QQQIIQ", 0, 0, len(nested), 0, 0, len(nested)) + nested
        nested = pack("<BQ", 6, len(content)) + content
    recording.write_bytes(data[:begin] + nested)
    with pytest.raises(McapError, match=f"the record at byte {begin} is a chunk that holds a record of kind 6"):
        read(recording)


def test_a_message_that_no_session_explains_is_named(recording: Path) -> None:
    data = recording.read_bytes()
    ends = ends_of_records(data)
    begin = next(end for end in ends if data[end] == 0x0C)
    recording.write_bytes(data[:begin] + data[next(end for end in ends if end > begin) :])
    with pytest.raises(McapError, match=f"the record at byte {begin} is a message before any session of thenar"):
        Reader(recording)


def test_a_message_that_cannot_be_read_is_named_with_its_place(recording: Path) -> None:
    data = recording.read_bytes()
    place = data.index(b'"event":"captured"')
    begin = max(end for end in ends_of_records(data) if end < place)
    recording.write_bytes(data.replace(b'"event":"captured"', b'"event":"kaptured"'))
    with pytest.raises(McapError, match=rf"whole\.mcap: the record at byte {begin} cannot be read: Invalid enum value"):
        read(recording)


def test_topics_are_ours_only_with_our_types(recording: Path) -> None:
    data = recording.read_bytes()
    recording.write_bytes(data.replace(b"std_msgs/msg/String", b"std_msgs/msg/Strong"))
    with pytest.raises(
        McapError, match=r"says that /thenar/grasp holds cdr of std_msgs/msg/Strong, not cdr of std_msgs/msg/String"
    ):
        read(recording)


def test_a_file_may_grow_while_it_is_read(recording: Path, entries: list[Entry]) -> None:
    reader = Reader(recording)
    with recording.open("ab") as file:
        file.write(b"more")
    assert [entry for entry in reader if not isinstance(entry, Session)] == entries


def test_every_channel_is_named_as_ros_names_topics() -> None:
    assert all(topic.startswith("/thenar/") and topic.islower() for topic, _ in CHANNELS.values())

"""The layout of a recording as MCAP: its channels, its beginning, and its end.

It is neither chunked nor compressed: a record is whole in the file as soon as it is written, so that a killed process
loses at most the record that it was writing. All messages are standard ROS 2 messages in CDR under the profile `ros2`,
with their definitions embedded: Foxglove shows them, `ros2 bag` plays them, and neither needs a package of thenar.
(MCAP specification, appendix `ros2`; rosbag2_storage_mcap, which reads a file without message indices in its order.)

std_msgs/msg/String and std_msgs/msg/UInt8MultiArray are CDR, little-endian: the encapsulation header 00 01 00 00, then
the fields, each aligned to its size (OMG DDSI-RTPS 2.5, 10.2; the lengths of strings and sequences are uint32, and a
string's counts its NUL).

A switch's byte has bit 0 set when it is closed, bit 1 when it could not be read: 0 open, 1 closed, 2 or more not known.
Where a record of the joints was read with the switches, as in a row of both, that record follows them: its time in
microseconds of the host's monotonic clock (8 bytes, little-endian), then its bytes. The bytes of a glove are its
sensors in wire order, then its status byte if it sends one. The codes of taxels, two bytes each, little-endian, FFFF
for one that was not read, come before the switches that were read with them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from struct import Struct, error
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import SettingError

from ..errors import FormatError, FrameError
from ..frames import GloveFrame, Mask, SwitchFrame
from .mcap import LARGEST_RECORD, MAGIC, Opcode, encode
from .session import METADATA, Session, from_metadata, to_metadata

_ENCAPSULATION = b"\0\1\0\0"
_TEXT = Struct("<4sI")
# No dimensions, data_offset 0, then the length of the data.
_BYTES = Struct("<4sIII")

_RULE = "=" * 80

STRING, BYTES = "std_msgs/msg/String", "std_msgs/msg/UInt8MultiArray"
# As embedded by `ros2 bag record`: the definition, then the definitions that it uses.
DEFINITIONS = {
    STRING: "string data\n",
    BYTES: (
        "MultiArrayLayout layout\nuint8[] data\n"
        f"{_RULE}\nMSG: std_msgs/MultiArrayLayout\nMultiArrayDimension[] dim\nuint32 data_offset\n"
        f"{_RULE}\nMSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride\n"
    ),
}

# Prefix of the program's name in the file's header.
WRITER = "thenar "

SWITCHES, GLOVE, GRASP, RECOGNITION, TRIALS, TAXELS = range(1, 7)
# Channel number: (topic, type of its messages).
CHANNELS = {
    SWITCHES: ("/thenar/switches", BYTES),
    GLOVE: ("/thenar/glove", BYTES),
    GRASP: ("/thenar/grasp", STRING),
    RECOGNITION: ("/thenar/recognition", STRING),
    TRIALS: ("/thenar/trials", STRING),
    TAXELS: ("/thenar/taxels", BYTES),
}
_SCHEMAS = {name: number for number, name in enumerate(DEFINITIONS, start=1)}


@dataclass(slots=True)
class Tail:
    """The content of a recording's end: length and CRC-32 of the data section so far, messages per channel, times of
    the first and the last (nanoseconds since 1970), place and length of every session's record.
    """

    size: int = 0
    crc: int = 0
    counts: dict[int, int] = field(default_factory=lambda: dict.fromkeys(CHANNELS, 0))
    first_ns: int | None = None
    last_ns: int = 0
    sessions: list[tuple[int, int]] = field(default_factory=list)

    def add_bytes(self, data: bytes) -> None:
        """Count bytes of the data section."""
        self.size += len(data)
        self.crc = crc32(data, self.crc)

    def add_session(self, length: int) -> None:
        """Count the session whose record ends here."""
        self.sessions.append((self.size - length, length))

    def add_message(self, channel: int, log_ns: int) -> None:
        """Count a message."""
        self.counts[channel] += 1
        self.first_ns = log_ns if self.first_ns is None else min(self.first_ns, log_ns)
        self.last_ns = max(self.last_ns, log_ns)


def beginning(version: str) -> bytes:
    """Return the first bytes of a recording by this version of thenar, up to its first session."""
    return MAGIC + encode(Opcode.HEADER, "ros2", f"{WRITER}{version}") + _descriptions()


def session_record(session: Session) -> bytes:
    """Return the record that begins a session. Raises SettingError if no reader would accept it."""
    texts = to_metadata(session)
    try:
        from_metadata(texts)
    except FormatError as wrong:
        raise SettingError(f"this cannot be recorded: {wrong}") from None
    record = encode(Opcode.METADATA, METADATA, texts)
    if len(record) > LARGEST_RECORD:
        raise SettingError(
            f"the description of this glove takes {len(record)} bytes, and at most {LARGEST_RECORD} are recorded: "
            "shorten glove.toml, or the names in it"
        )
    return record


def ending(tail: Tail) -> bytes:
    """Return the bytes that close a recording: the end of its data, a summary, the footer."""
    data_end = encode(Opcode.DATA_END, tail.crc)
    indices = b"".join(encode(Opcode.METADATA_INDEX, offset, length, METADATA) for offset, length in tail.sessions)
    summary = _descriptions() + _statistics(tail) + indices
    start = tail.size + len(data_end)
    # The CRC of a summary covers the footer up to the CRC itself.
    open_footer = encode(Opcode.FOOTER, start, 0, 0)[:-4]
    footer = encode(Opcode.FOOTER, start, 0, crc32(open_footer, crc32(summary)))
    return data_end + summary + footer + MAGIC


def _descriptions() -> bytes:
    """Return the records of schemas and channels."""
    # The profile requires the key; if it is empty, a player uses its own settings.
    qos = {"offered_qos_profiles": ""}
    records = [
        encode(Opcode.SCHEMA, _SCHEMAS[name], name, "ros2msg", text.encode()) for name, text in DEFINITIONS.items()
    ]
    records += [
        encode(Opcode.CHANNEL, number, _SCHEMAS[name], topic, "cdr", qos) for number, (topic, name) in CHANNELS.items()
    ]
    return b"".join(records)


def _statistics(tail: Tail) -> bytes:
    messages, attachments, chunks = sum(tail.counts.values()), 0, 0
    numbers = messages, len(_SCHEMAS), len(tail.counts), attachments, len(tail.sessions), chunks
    return encode(Opcode.STATISTICS, *numbers, tail.first_ns or 0, tail.last_ns, tail.counts)


def encode_text(text: bytes) -> bytes:
    """Return a std_msgs/msg/String of UTF-8 `text`."""
    return _TEXT.pack(_ENCAPSULATION, len(text) + 1) + text + b"\0"


def encode_bytes(data: bytes) -> bytes:
    """Return a std_msgs/msg/UInt8MultiArray of `data`, without dimensions."""
    return _BYTES.pack(_ENCAPSULATION, 0, 0, len(data)) + data


def decode_text(message: bytes) -> bytes:
    """Return the UTF-8 text of a std_msgs/msg/String. Raises FormatError."""
    encapsulation, length = _unpack(_TEXT, message)
    text = message[_TEXT.size :]
    if encapsulation != _ENCAPSULATION or length != len(text) or not text.endswith(b"\0"):
        raise FormatError("is no little-endian CDR string")
    return text[:-1]


def decode_bytes(message: bytes) -> bytes:
    """Return the data of a std_msgs/msg/UInt8MultiArray without dimensions. Raises FormatError."""
    encapsulation, dimensions, data_offset, length = _unpack(_BYTES, message)
    data = message[_BYTES.size :]
    if encapsulation != _ENCAPSULATION or dimensions or data_offset or length != len(data):
        raise FormatError("is no little-endian CDR array of bytes without dimensions")
    return data


def _unpack(layout: Struct, message: bytes) -> tuple[bytes, ...] | tuple[int, ...]:
    try:
        return layout.unpack_from(message)
    except error:
        raise FormatError(f"has {len(message)} bytes, too few for what its channel carries") from None


_CLOSED, _LOST = 1, 2
_TIME_BYTES = 8


def switch_bytes(frame: SwitchFrame, switches: int, sensors: int) -> bytes:
    """Return a byte for each of `switches`, and the record of `sensors` that was read with them, if any.

    Raises FrameError if the frame has other numbers of them.
    """
    if (frame.closed | frame.lost) >> switches:
        raise FrameError(f"a frame has bits beyond the {switches} recorded switches")
    closed, lost = switch_matrix([frame.closed, frame.lost], switches).view(np.uint8)
    states: bytes = (closed * _CLOSED + lost * _LOST).tobytes()
    if frame.glove is None:
        return states
    return states + frame.glove.time_us.to_bytes(_TIME_BYTES, "little") + glove_bytes(frame.glove, sensors)


def switch_frame(time_us: int, data: bytes, switches: int, sensors: int) -> SwitchFrame:
    """Return the frame written by `switch_bytes`. Raises FormatError."""
    states, rest = data[:switches], data[switches:]
    if len(states) < switches or 0 < len(rest) < _TIME_BYTES:
        raise FormatError(f"holds {len(data)} bytes, but its session names {switches} switches")
    array = np.frombuffer(states, np.uint8)
    if switches and int(array.max()) > _CLOSED | _LOST:
        raise FormatError(f"holds a switch in state {int(array.max())}")
    glove_us = int.from_bytes(rest[:_TIME_BYTES], "little")
    return SwitchFrame(
        time_us,
        closed=_gather(array, _CLOSED),
        lost=_gather(array, _LOST),
        glove=glove_frame(glove_us, rest[_TIME_BYTES:], sensors) if rest else None,
    )


def glove_bytes(frame: GloveFrame, sensors: int) -> bytes:
    """Return the record of `sensors` sensors. Raises FrameError if it has another number."""
    if len(frame.sensors) != sensors:
        found = f"a record has {len(frame.sensors)} sensors, but {sensors} are recorded"
        raise FrameError(f"{found}: set the number under [cyberglove] of glove.toml")
    return frame.sensors if frame.status is None else frame.sensors + bytes((frame.status,))


def glove_frame(time_us: int, data: bytes, sensors: int) -> GloveFrame:
    """Return the frame written by `glove_bytes`. Raises FormatError."""
    if len(data) - sensors not in (0, 1):
        raise FormatError(f"holds {len(data)} bytes, but its session names {sensors} sensors")
    return GloveFrame(time_us, data[:sensors], data[sensors] if len(data) > sensors else None)


_NOT_READ = 0xFFFF


def taxel_bytes(codes: Sequence[int | None], taxels: int) -> bytes:
    """Return the bytes of `taxels` codes. Raises FrameError for another number of codes, or one that does not fit."""
    if len(codes) != taxels:
        raise FrameError(f"a frame has {len(codes)} taxels, but {taxels} are recorded")
    if any(code is not None and not 0 <= code < _NOT_READ for code in codes):
        raise FrameError(f"a taxel's code is outside 0..{_NOT_READ - 1}")
    return Struct(f"<{taxels}H").pack(*(_NOT_READ if code is None else code for code in codes))


def taxel_codes(data: bytes, taxels: int) -> tuple[int | None, ...]:
    """Return the codes written by `taxel_bytes`. Raises FormatError."""
    if len(data) != 2 * taxels:
        raise FormatError(f"holds {len(data)} bytes, but its session names {taxels} taxels")
    return tuple(None if code == _NOT_READ else code for code in Struct(f"<{taxels}H").unpack(data))


def switch_matrix(masks: Sequence[Mask], switches: int) -> NDArray[np.bool_]:
    """Return (len(masks), switches) bool: bit s of every mask."""
    length = (switches + 7) // 8
    rows = np.frombuffer(b"".join(mask.to_bytes(length, "little") for mask in masks), np.uint8)
    bits = np.unpackbits(rows.reshape(len(masks), length), axis=1, count=switches, bitorder="little")
    return bits.view(np.bool_)


def _gather(states: NDArray[np.uint8], flag: int) -> Mask:
    return int.from_bytes(np.packbits(states & flag != 0, bitorder="little").tobytes(), "little")

"""The layout of a recording as MCAP: its channels, its beginning, and its end.

It is neither chunked nor compressed: a record is whole in the file as soon as it is written, so that a killed process
loses at most the record that it was writing. All messages are standard ROS 2 messages in CDR under the profile `ros2`,
with their definitions embedded: Foxglove shows them, `ros2 bag` plays them, and neither needs a package of thenar.
(MCAP specification, appendix `ros2`; rosbag2_storage_mcap, which reads a file without message indices in its order.)
"""

from dataclasses import dataclass, field
from zlib import crc32

from thenar.drivers.errors import SettingError

from ..errors import McapError
from .mcap import Opcode, encode
from .messages import BYTES, DEFINITIONS, STRING
from .session import METADATA, Session, from_metadata, to_metadata

MAGIC = b"\x89MCAP0\r\n"
# Longer than any record of ours. Parsed as JSON a record takes about twenty times its length.
LARGEST_RECORD = 16 << 20
# Prefix of the program's name in the file's header.
WRITER = "thenar "

SWITCHES, GLOVE, GRASP, RECOGNITION, TRIALS, TAXELS, MARKS = range(1, 8)
# Channel number: (topic, type of its messages). The taxels' channel exists only if the glove has taxels, that of marks
# only if marks can be set.
CHANNELS = {
    SWITCHES: ("/thenar/switches", BYTES),
    GLOVE: ("/thenar/glove", BYTES),
    GRASP: ("/thenar/grasp", STRING),
    RECOGNITION: ("/thenar/recognition", STRING),
    TRIALS: ("/thenar/trials", STRING),
    TAXELS: ("/thenar/taxels", BYTES),
    MARKS: ("/thenar/marks", STRING),
}
_SCHEMAS = {name: number for number, name in enumerate(DEFINITIONS, start=1)}


@dataclass(slots=True)
class Tail:
    """The content of a recording's end: length and CRC-32 of the data section so far, messages per channel, times of
    the first and the last (nanoseconds since 1970), place and length of every session's record.
    """

    size: int = 0
    crc: int = 0
    counts: dict[int, int] = field(default_factory=lambda: dict.fromkeys(range(SWITCHES, TAXELS), 0))
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
        self.counts[channel] = self.counts.get(channel, 0) + 1
        self.first_ns = log_ns if self.first_ns is None else min(self.first_ns, log_ns)
        self.last_ns = max(self.last_ns, log_ns)


def beginning(version: str, tail: Tail | None = None) -> bytes:
    """Return the first bytes of a recording by this version of thenar, with the channels that `tail` counts, up to its
    first session.
    """
    return MAGIC + encode(Opcode.HEADER, "ros2", f"{WRITER}{version}") + _schemas() + _channels(tail or Tail())


def session_record(session: Session) -> bytes:
    """Return the record that begins a session. Raises SettingError if no reader would accept it."""
    texts = to_metadata(session)
    try:
        from_metadata(texts)
    except McapError as wrong:
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
    summary = _schemas() + _channels(tail) + _statistics(tail) + indices
    start = tail.size + len(data_end)
    # The CRC of a summary covers the footer up to the CRC itself.
    open_footer = encode(Opcode.FOOTER, start, 0, 0)[:-4]
    footer = encode(Opcode.FOOTER, start, 0, crc32(open_footer, crc32(summary)))
    return data_end + summary + footer + MAGIC


def _schemas() -> bytes:
    return b"".join(
        encode(Opcode.SCHEMA, _SCHEMAS[name], name, "ros2msg", text.encode()) for name, text in DEFINITIONS.items()
    )


def _channels(tail: Tail) -> bytes:
    # The profile requires the key; if it is empty, a player uses its own settings.
    qos = {"offered_qos_profiles": ""}
    return b"".join(
        encode(Opcode.CHANNEL, number, _SCHEMAS[name], topic, "cdr", qos)
        for number, (topic, name) in CHANNELS.items()
        if number in tail.counts
    )


def _statistics(tail: Tail) -> bytes:
    messages, attachments, chunks = sum(tail.counts.values()), 0, 0
    numbers = messages, len(_SCHEMAS), len(tail.counts), attachments, len(tail.sessions), chunks
    return encode(Opcode.STATISTICS, *numbers, tail.first_ns or 0, tail.last_ns, tail.counts)

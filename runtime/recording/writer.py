"""`Recorder`: frames, recognitions and labels into an MCAP file, as they come."""

import time
from pathlib import Path
from struct import Struct
from typing import Self

import msgspec
from msgspec.structs import replace

from thenar.drivers.errors import SettingError

from ..files import write_atomically
from ..live.frames import GloveFrame, SwitchFrame
from ..live.published import LiveGrasp
from .appending import SYNC_S, AppendedFile
from .cdr import encode_bytes, encode_text
from .frame_bytes import glove_bytes, switch_bytes
from .layout import GLOVE, GRASP, RECOGNITION, SWITCHES, TRIALS, Tail, beginning, ending, session_record
from .session import Label, Session

# Opcode, length of the rest, channel, sequence, log time, publish time (MCAP specification, Message).
_MESSAGE = Struct("<BQHIQQ")
_MESSAGE_OPCODE, _OPENING = 5, 9
# A recording tells how somebody's hand moves.
_PRIVATE = 0o600
_json = msgspec.json.Encoder().encode


class Recorder:
    """Writes a recording; every message has left the process when its method returns.

    A message is published at the time of its frame and logged then too, but never before the message written last:
    the file is in the order of its log times. Both are the monotonic clock, set by the date once when the session
    begins, so that a date that is changed meanwhile moves nothing.

    A full disk ends the recording and nothing else: no method raises, and `failure` holds the sentence for the user.
    """

    def __init__(self, path: Path, session: Session, *, tail: Tail | None = None, sync_s: float = SYNC_S) -> None:
        """Begin a file that must not exist, or go on behind the `tail` of one that does.

        Raises SettingError where the file exists, OSError as the operating system gives it.
        """
        after_ns = 0 if tail is None else tail.last_ns
        self.session = replace(session, clock_ns=max(time.time_ns(), after_ns) - time.monotonic_ns())
        self.path = path
        self._tail = _begun(path, self.session) if tail is None else tail
        self._file = AppendedFile(path, self._tail.size, sync_s)
        if tail is not None and self._append(record := session_record(self.session)):
            self._tail.add_session(len(record))
        self._grasp = ""
        self._switches, self._sensors = len(session.switches), len(session.sensors)

    @property
    def failure(self) -> str | None:
        """Why nothing is recorded any more; None while all is well."""
        return self._file.failure

    @property
    def messages(self) -> int:
        """How many messages the file holds."""
        return sum(self._tail.counts.values())

    def switches(self, frame: SwitchFrame) -> None:
        """Record a reading of the switches. Raises FrameError if it is not of this session's switches."""
        self._message(SWITCHES, frame.time_us, encode_bytes(switch_bytes(frame, self._switches, self._sensors)))

    def glove(self, frame: GloveFrame) -> None:
        """Record a record of the CyberGlove. Raises FrameError if it has not this session's sensors."""
        self._message(GLOVE, frame.time_us, encode_bytes(glove_bytes(frame, self._sensors)))

    def grasp(self, grasp: LiveGrasp) -> None:
        """Record a recognition; the grasp type also by itself whenever it changes."""
        self._message(RECOGNITION, grasp.time_us, encode_text(_json(grasp)))
        if grasp.grasp != self._grasp:
            self._grasp = grasp.grasp
            self._message(GRASP, grasp.time_us, encode_text(grasp.grasp.encode()))

    def label(self, label: Label) -> None:
        """Record what became of a trial."""
        self._message(TRIALS, label.time_us, encode_text(_json(label)))

    def close(self) -> None:
        """Write the summary and close; may wait for the disk, and may be called again."""
        if self._file.size == self._tail.size:
            self._file.append(ending(self._tail))
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _message(self, channel: int, time_us: int, data: bytes) -> None:
        tail = self._tail
        published = self.session.clock_ns + 1000 * time_us
        logged = max(published, tail.last_ns)
        length = _MESSAGE.size - _OPENING + len(data)
        sequence = tail.counts[channel] & 0xFFFFFFFF
        head = _MESSAGE.pack(_MESSAGE_OPCODE, length, channel, sequence, logged, published)
        if self._append(head + data):
            tail.add_message(channel, logged)

    def _append(self, record: bytes) -> bool:
        whole = self._file.append(record)
        if whole:
            self._tail.add_bytes(record)
        return whole


def _begun(path: Path, session: Session) -> Tail:
    """Make the file, its first session in it, and return its tail."""
    if path.exists():
        raise SettingError(f"{path} exists, and a recording is never written over: name another file")
    first, record = beginning(session.thenar), session_record(session)
    # Whole or not at all, so that there is no file without a session.
    write_atomically(path, first + record, mode=_PRIVATE)
    tail = Tail()
    tail.add_bytes(first + record)
    tail.add_session(len(record))
    return tail

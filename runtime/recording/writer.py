"""`Recorder`: writes frames, predictions and labels into an MCAP file as they come."""

import os
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace as replace_dataclass
from functools import partial
from pathlib import Path
from struct import Struct
from threading import Event, Thread

import msgspec
from msgspec.structs import astuple, replace

from thenar.drivers.closing import Closing
from thenar.drivers.errors import SettingError

from ..files import write_atomically
from ..frames import GloveFrame, SwitchFrame
from ..published import LiveGrasp
from ..writer_thread import WriterThread
from . import layout
from .layout import Tail
from .session import Label, Session

SYNC_S = 1.0


# Opcode, length of the rest, channel, sequence, log time, publish time (MCAP specification, Message).
_MESSAGE = Struct("<BQHIQQ")
_MESSAGE_OPCODE, _OPENING = 5, 9
# A recording shows how a person's hand moves.
_PRIVATE = 0o600
_json = msgspec.json.Encoder().encode
# Its channel, time in microseconds, and content.
_Message = tuple[int, int, bytes]


class _Recognition(LiveGrasp, frozen=True, omit_defaults=True):
    """A prediction as recorded: without empty fields, such as those of a segment while there is none."""


class Recorder(Closing):
    """Writes a recording; every message has left the process when its method returns: no kill can take it.

    A power failure can take about the last second, because a separate thread calls fdatasync that often; nobody waits
    for it.

    A message is published at the time of its frame and logged then too, but never before the message written last: the
    file is in the order of its log times. Both use the monotonic clock, set to the date once when the session begins,
    so that a later change of the date moves nothing.

    A full disk raises nothing: what does not fit is lost, and counted in `lost`; the file keeps its whole records, and
    recording goes on once there is room. `failure` says why nothing can be written now. A disk that does not keep what
    it took ends the recording.

    Attributes
    ----------
    session : Session
        What is recorded, with the clock.
    path : Path
        The file.
    lost : int
        The number of messages that the disk did not take.
    """

    def __init__(self, path: Path, session: Session, *, tail: Tail | None = None, sync_s: float = SYNC_S) -> None:
        """Begin a file that must not exist, or continue after the `tail` of an existing one, and cut off the rest.

        Raises SettingError if the file exists, OSError as the operating system gives it.
        """
        after_ns = 0 if tail is None else tail.last_ns
        self.session = replace(session, clock_ns=max(time.time_ns(), after_ns) - time.monotonic_ns())
        self.path = path
        self.lost = 0
        self._tail = _begun(path, self.session) if tail is None else tail
        self._size = self._synced = self._tail.size
        # Two threads fail: a write is tried again, a disk that kept nothing is not.
        self._full: str | None = None
        self._broken: str | None = None
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC)
        try:
            os.ftruncate(self._file, self._size)
        except OSError:
            os.close(self._file)
            raise
        self._closing = Event()
        self._thread = Thread(target=self._keep_synced, args=(sync_s,), name="thenar recording", daemon=True)
        self._thread.start()
        if tail is not None:
            record = layout.session_record(self.session)
            if not self._append(record):
                self._end()
                raise OSError(self.failure)
            self._tail.add_bytes(record)
            self._tail.add_session(len(record))
        self._grasp = ""
        self._switches, self._sensors, self._taxels = len(session.switches), len(session.sensors), len(session.taxels)

    @property
    def failure(self) -> str | None:
        """Why nothing can be written now; None while there is no error."""
        return self._broken or self._full

    @property
    def messages(self) -> int:
        """The number of messages in the file."""
        return sum(self._tail.counts.values())

    def frame(self, frame: SwitchFrame | GloveFrame) -> None:
        """Record a reading of the switches, and the taxels' codes before it, or a record of the CyberGlove.

        Raises FrameError if it does not have the inputs of this session.
        """
        self._write(self._of_frame(frame))

    def moment(self, arrived: Iterable[SwitchFrame | GloveFrame], grasp: LiveGrasp) -> None:
        """Record the frames that arrived since the last moment, then the prediction for the newest of them; the grasp
        type also separately whenever it changes.
        """
        messages = [message for frame in arrived for message in self._of_frame(frame)]
        messages.append((layout.RECOGNITION, grasp.time_us, layout.encode_text(_json(_Recognition(*astuple(grasp))))))
        if grasp.grasp != self._grasp:
            messages.append((layout.GRASP, grasp.time_us, layout.encode_text(grasp.grasp.encode())))
        if self._write(messages):
            self._grasp = grasp.grasp

    def label(self, label: Label) -> None:
        """Record the outcome of a trial."""
        self._write([(layout.TRIALS, label.time_us, layout.encode_text(_json(label)))])

    def close(self) -> None:
        """Write the summary and close; may wait for the disk, and may be called again."""
        if self._size == self._tail.size:
            self._append(layout.ending(self._tail))
        self._end()

    def _of_frame(self, frame: SwitchFrame | GloveFrame) -> list[_Message]:
        sensors, found = self._sensors, list[tuple[int, bytes]]()
        if isinstance(frame, GloveFrame):
            found.append((layout.GLOVE, layout.glove_bytes(frame, sensors)))
        else:
            if frame.taxels is not None:
                found.append((layout.TAXELS, layout.taxel_bytes(frame.taxels, self._taxels)))
            found.append((layout.SWITCHES, layout.switch_bytes(frame, self._switches, sensors)))
        return [(channel, frame.time_us, layout.encode_bytes(data)) for channel, data in found]

    def _write(self, messages: Sequence[_Message]) -> bool:
        """Append all messages, or none, which are then lost; return whether they are in the file."""
        tail, data = replace_dataclass(self._tail, counts=dict(self._tail.counts)), b""
        for channel, time_us, content in messages:
            published = self.session.clock_ns + 1000 * time_us
            logged = max(published, tail.last_ns)
            length = _MESSAGE.size - _OPENING + len(content)
            sequence = tail.counts[channel] & 0xFFFFFFFF
            data += _MESSAGE.pack(_MESSAGE_OPCODE, length, channel, sequence, logged, published) + content
            tail.add_message(channel, logged)
        if written := self._append(data):
            tail.add_bytes(data)
            self._tail = tail
        elif self.failure is not None:
            self.lost += len(messages)
        return written

    def _append(self, data: bytes) -> bool:
        """Append `data` whole and return True; return False if that fails, and when closed."""
        if self._broken is not None or self._closing.is_set():
            return False
        try:
            written = os.write(self._file, data)
            while written < len(data):
                written += os.write(self._file, data[written:])
        except OSError as reason:
            self._full = self._sentence(reason)
            try:
                # Remove the part of the record that fitted.
                os.ftruncate(self._file, self._size)
            except OSError as worse:
                self._broken = self._sentence(worse)
            return False
        self._size += len(data)
        self._full = None
        return True

    def _end(self) -> None:
        """Write everything to the disk and close. May wait for the disk."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._thread.join()
        self._sync()
        os.close(self._file)

    def _keep_synced(self, every_s: float) -> None:
        while not self._closing.wait(every_s):
            self._sync()

    def _sync(self) -> None:
        size = self._size
        if size == self._synced or self._broken is not None:
            return
        try:
            os.fdatasync(self._file)
        except OSError as reason:
            self._broken = self._sentence(reason)
        self._synced = size

    def _sentence(self, reason: OSError) -> str:
        return f"{self.path}: {reason.strerror}: nothing more is written after {self._size} bytes, all of them whole"


# Moments that wait for the disk: those of five seconds of the fastest glove.
MOST_WAITING = 8192


class LiveRecorder(Closing):
    """A recording whose disk delays nobody: its messages are written on a separate thread.

    A moment is written at once, unless the disk hangs: then up to `MOST_WAITING` moments wait, and those beyond are
    lost. A kill takes what waits.
    """

    def __init__(self, path: Path, session: Session) -> None:
        """Begin a file. Raises as `Recorder` does."""
        self._recorder = Recorder(path, session)
        self._thread = WriterThread("recording", MOST_WAITING)
        self.path = path

    @property
    def failure(self) -> str | None:
        """Why nothing can be written now; None if it can."""
        hanging = f"{self.path}: the disk does not respond: up to {MOST_WAITING} moments wait for it"
        return self._recorder.failure or (hanging if self._thread.hangs else None)

    @property
    def messages(self) -> int:
        """The number of messages in the file."""
        return self._recorder.messages

    @property
    def lost(self) -> str:
        """What was not written, in words; "" if all was."""
        messages, moments = self._recorder.lost, self._thread.dropped
        return " and ".join(
            f"{number} {what}{'s' * (number != 1)} lost"
            for number, what in ((messages, "message"), (moments, "moment"))
            if number
        )

    def moment(self, arrived: Sequence[SwitchFrame | GloveFrame], grasp: LiveGrasp) -> None:
        """Record the frames that arrived since the last moment, then the prediction for the newest of them."""
        self._thread.put(partial(self._recorder.moment, arrived, grasp))

    def close(self) -> None:
        """Write what waits and the summary, unless the disk hangs, and close; may be called again."""
        self._thread.close(self._recorder.close)


def _begun(path: Path, session: Session) -> Tail:
    """Make the file, its first session in it, and return its tail."""
    if path.exists():
        raise SettingError(f"{path} exists, and a recording is never overwritten: name another file")
    tail = Tail()
    first, record = layout.beginning(session.thenar), layout.session_record(session)
    # Written whole or not at all, so that no file lacks a session.
    write_atomically(path, first + record, mode=_PRIVATE)
    tail.add_bytes(first + record)
    tail.add_session(len(record))
    return tail

"""The page of a recording: the glove's readings and the prediction at any moment, next to the labels.

The recording is recognised once, while the page is open, and the messages of its moments are kept in a temporary file.
The part that was read can be shown at once. All pages show the same moment.
"""

import os
from bisect import bisect_left, bisect_right
from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from tempfile import TemporaryFile
from threading import Event, Thread
from time import monotonic
from typing import Any

from msgspec.structs import replace

from thenar.drivers.closing import Closing
from thenar.drivers.errors import SettingError, ThenarError

from ..build import Build
from ..hand import load_hand
from ..harness.loading import parse_harness
from ..harness.wiring import Harness
from ..live.recogniser import Moment
from ..live.replay import Stepper, periods_us
from ..published import LiveGrasp
from ..recording.reader import Entry, Reader
from ..recording.session import Label, Session
from .live import PAST_US, Change, FrameText, build_message, change_of, shell_message
from .server import Server, message

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0)
# Moments are kept at this interval, and this many changes of the prediction.
_SAMPLE_US, _MOST_CHANGES = 20_000, 100_000
_FRAME_S, _IDLE_S, _TOLD_S = 0.02, 0.2, 0.5
_PERIODS_OF = 20_000


class Overview:
    """The overview of a whole recording: changes of the prediction, and labelled spans.

    A trial's span lasts from its beginning to its judgement; a repeated trial has none.
    """

    def __init__(self) -> None:
        self.changes: list[Change] = []
        self.truth: list[tuple[int, int, str]] = []
        self._begun: tuple[int, str] | None = None

    def take(self, unix_us: int, entry: object) -> None:
        """Take an entry, or a prediction."""
        if isinstance(entry, LiveGrasp):
            self._change(entry)
        elif isinstance(entry, Label):
            self._label(unix_us, entry)
        elif isinstance(entry, Session):
            self._begun = None

    def truth_at(self, unix_us: int) -> str | None:
        """Return the label at a moment."""
        at = bisect_left(self.truth, (unix_us + 1,)) - 1
        return self.truth[at][2] if at >= 0 and unix_us < self.truth[at][1] else None

    def past(self, unix_us: int) -> bytes:
        """Return the message of the predictions before a moment, in the form of a live run."""
        first = max(bisect_left(self.changes, (unix_us - PAST_US,)) - 1, 0)
        last = bisect_left(self.changes, (unix_us,))
        return message("past", changes=self.changes[first:last], until_us=unix_us)

    def text(self) -> bytes:
        """Return the overview's message: spans of predictions, and spans of labels."""
        spans: list[tuple[int, str]] = []
        for unix_us, _, grasp, *_ in self.changes:
            if not spans or spans[-1][1] != grasp:
                spans.append((unix_us, grasp))
        return message("overview", predictions=spans, truth=self.truth)

    def _change(self, grasp: LiveGrasp) -> None:
        change = change_of(grasp)
        last = self.changes[-1] if self.changes else None
        if last is not None and grasp.time_us < last[0]:  # clocks of two overlapping sessions
            return
        # In very long recordings, changes of the announced grasp are kept longest.
        most = _MOST_CHANGES if last is None or change[2] == last[2] else 2 * _MOST_CHANGES
        if (last is None or change[1:] != last[1:]) and len(self.changes) < most:
            self.changes.append(change)

    def _label(self, unix_us: int, label: Label) -> None:
        if label.event == "begun" or self._begun is None:
            self._begun = unix_us, label.grasp
        if label.event == "accepted" and len(self.truth) < _MOST_CHANGES:
            self.truth.append((self._begun[0], unix_us, label.grasp))
        if label.event in ("accepted", "redone"):
            self._begun = None


class ReplayPage(Closing):
    """Serves the page of a recording; a context manager.

    Parameters
    ----------
    path : Path
        The recording.
    address, token
        As for `Server`.
    build : Path
        The folder of a build, by which every frame is scored. For a run of the same build, its own predictions are
        shown; for other recordings, the predictions of this build.

    Attributes
    ----------
    server : Server
        The server of the page.

    Raises
    ------
    FormatError, OSError
        If `path` is not a recording of thenar.
    BuildError, SettingError
        If the build cannot be read, or the recording lacks an input of it; and as `Server` does.
    """

    def __init__(self, path: Path, address: str, *, token: str | None, build: Path) -> None:
        self._reader, self._size, self._overview = Reader(path), path.stat().st_size, Overview()
        self._build = loaded = Build.load(build)
        session = self._reader.session
        self._stepper = Stepper(loaded, path.name, periods_us(islice(Reader(path), _PERIODS_OF)))
        self._stepper.take(session)
        harness = parse_harness(session.harness, path.name) if session.harness else Harness(name="")
        self._text = FrameText(loaded, harness)
        # What was read so far: its span, and of each kept moment its time and where its text ends.
        self._first_us: int | None = None
        self._last_us = 0
        self._times, self._ends = list[int](), [0]
        self._asked = SimpleQueue[Mapping[str, object]]()
        self._faults = list[str]()
        self._at_us, self._playing, self._speed, self._sought, self._shown = 0, False, 1.0, True, -1
        hand = message("hand", load_hand(build, loaded.manifest))
        self._scanned = Event()
        self._told = 0.0
        self._stop = Event()
        self._thread = Thread(target=self._scan, name="thenar scan", daemon=True)
        self.server = Server("live", address, token=token, on_message=self._take)
        self.server.publish("shell", shell_message(path.name, build, loaded.manifest))
        self.server.publish("build", build_message(loaded.manifest, replay=True))
        self.server.publish("hand", hand)
        self._kept = TemporaryFile(buffering=0)  # noqa: SIM115

    def run(self, stop: Event) -> None:
        """Show the recording, as pages request it, until `stop` is set."""
        self._thread.start()
        before = monotonic()
        while not stop.is_set():
            self._do(_FRAME_S if self._playing else _IDLE_S)
            now = monotonic()
            self._advance(now - before)
            before = now
            self._show()

    def close(self) -> None:
        """Close the page."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self.server.close()
        self._kept.close()

    def _scan(self) -> None:
        """Recognise the whole recording: fill the overview, and keep what the page shows."""
        name, newest = self._reader.path.name, None
        try:
            for entry in self._reader:
                newest = self._recognised(entry) or newest
                if self._stop.is_set():
                    return
            if newest is not None and newest.grasp.time_us > self._times[-1]:
                self._keep(newest)
        except ThenarError as wrong:
            self._faults.append(str(wrong))
        except OSError as wrong:
            self._faults.append(f"{name} is shown up to here: {wrong.strerror}")
        self._faults += [fault.message for fault in self._reader.faults()]
        self._scanned.set()

    def _recognised(self, entry: Entry) -> Moment | None:
        """Take an entry; return its moment, if it has one, with times since 1970."""
        moment, session = self._stepper.take(entry), self._reader.session
        clock_us = session.clock_ns // 1000
        if isinstance(entry, Session):
            self._overview.take(clock_us, entry)
            return None
        unix_us = clock_us + entry.time_us
        self._first_us = unix_us if self._first_us is None else self._first_us
        self._last_us = max(self._last_us, unix_us)
        if moment is None:
            self._overview.take(unix_us, entry)
            return None
        own = session.build == self._build.manifest.checksum
        moment.grasp = _dated(entry if own and isinstance(entry, LiveGrasp) else moment.grasp, clock_us)
        self._overview.take(unix_us, moment.grasp)
        if not self._times or unix_us >= self._times[-1] + _SAMPLE_US:
            self._keep(moment)
        return moment

    def _keep(self, moment: Moment) -> None:
        """Keep the message of a moment. The page's thread reads it once its time is in the list."""
        text = self._text(moment)
        self._kept.write(text)
        self._ends.append(self._ends[-1] + len(text))
        self._times.append(moment.grasp.time_us)

    def _take(self, asked: Mapping[str, object]) -> None:
        do, value = asked["do"], asked.get("value")
        number = value if isinstance(value, int | float) and not isinstance(value, bool) else None
        if do not in ("seek", "play", "pause", "speed"):
            raise SettingError(f"a page can request seek, play, pause or a speed, not {str(do)[:20]!r}")
        if do == "seek" and (number is None or not abs(number) < 2**62):
            raise SettingError("a moment must be a number of microseconds since 1970")
        if do == "speed" and number not in SPEEDS:
            raise SettingError(f"a speed must be one of {', '.join(map(str, SPEEDS))}")
        self._asked.put(asked)

    def _do(self, wait_s: float) -> None:
        """Carry out the requests of pages, waiting briefly for them."""
        try:
            asked: Mapping[str, Any] = self._asked.get(timeout=wait_s)
            while True:
                if asked["do"] == "seek":
                    self._at_us, self._sought = int(asked["value"]), True
                elif asked["do"] == "speed":
                    self._speed = float(asked["value"])
                else:
                    self._playing = asked["do"] == "play"
                asked = self._asked.get_nowait()
        except Empty:
            return

    def _advance(self, passed_s: float) -> None:
        first, last = self._first_us, self._last_us
        if first is None:
            return
        if self._playing and self._at_us >= last and self._scanned.is_set() and not self._sought:
            self._playing = False
        if self._playing and not self._sought:
            self._at_us += round(1e6 * passed_s * self._speed)
        self._at_us = min(max(self._at_us, first), last)

    def _show(self) -> None:
        first, last = self._first_us, self._last_us
        if first is None:
            if self._scanned.is_set():
                self._tell(0, 0)
            return
        if self._sought:
            self.server.publish("past", self._overview.past(self._at_us))
        # Before the first prediction, the first one is shown.
        shown = max(bisect_right(self._times, self._at_us) - 1, 0)
        if self._times and shown != self._shown:
            begin, end = self._ends[shown : shown + 2]
            self.server.publish("frame", os.pread(self._kept.fileno(), end - begin, begin))
            self._shown = shown
        self._sought = False
        self._tell(first, last)

    def _tell(self, first_us: int, last_us: int) -> None:
        """Show where the pages are: moments in microseconds since 1970, the label there, and the share of the file that
        was scanned, with its faults.
        """
        state = {
            "at_us": self._at_us,
            "first_us": first_us,
            "last_us": last_us,
            "playing": self._playing,
            "speed": self._speed,
            "share": 1.0 if self._scanned.is_set() else self._reader.tail.size / max(self._size, 1),
            "truth": self._overview.truth_at(self._at_us),
            "faults": self._faults[:8],
        }
        self.server.publish("replay", message("replay", state))
        now = monotonic()
        if self._told < float("inf") and now - self._told >= _TOLD_S:
            self._told = float("inf") if self._scanned.is_set() else now
            self.server.publish("overview", self._overview.text())


def _dated(grasp: LiveGrasp, clock_us: int) -> LiveGrasp:
    """Return a grasp with times since 1970 instead of its session's clock."""
    began_us = None if grasp.segment_us is None else grasp.segment_us + clock_us
    return replace(grasp, time_us=grasp.time_us + clock_us, segment_us=began_us)

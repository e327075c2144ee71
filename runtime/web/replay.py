"""The page of a recording: the glove's readings and the prediction at any moment, next to the labels.

The file is scanned while the page is open; the scanned part can be shown at once. All pages show the same moment.
"""

from bisect import bisect_left
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
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
from ..live.replay import Stepper, periods_us
from ..published import LiveGrasp
from ..recording.reader import Index
from ..recording.session import Label, Session
from .live import PAST_US, Change, FrameText, build_message, change_of
from .server import Server, message

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0)
# Recognition starts this long before the moment that is shown, so that it has settled.
LEAD_US = 1_500_000
# Predictions of a run are sampled at this interval; this many changes are kept.
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
        self._index, self._overview = Index(path), Overview()
        self._build = Build.load(build)
        self._own = self._index.session.build == self._build.manifest.checksum
        self._walk = _Walk(self._index, self._build)
        self._asked = SimpleQueue[Mapping[str, object]]()
        self._faults = list[str]()
        self._at_us, self._playing, self._speed, self._sought = 0, False, 1.0, True
        manifest = self._build.manifest
        hand = message("hand", load_hand(build, manifest))
        self._first = build_message(build, manifest, path.name, replay=True), hand
        self._scanned = Event()
        self._told = 0.0
        self._stop = Event()
        self._thread = Thread(target=self._scan, name="thenar scan", daemon=True)
        self.server = Server("live", address, token=token, on_message=self._take, hello=lambda: self._first)

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

    def _scan(self) -> None:
        """Scan the whole recording for its overview."""
        try:
            for unix_us, entry in self._predicted():
                self._overview.take(unix_us, entry)
                if self._stop.is_set():
                    return
        except ThenarError as wrong:
            self._faults.append(str(wrong))
        except OSError as wrong:
            self._faults.append(f"{self._index.path.name} cannot be read: {wrong.strerror}")
        if self._index.fault:
            self._faults.append(self._index.fault)
        self._scanned.set()

    def _predicted(self) -> Iterator[tuple[int, object]]:
        """Yield labels and predictions; those of the build if the recording is not its own."""
        if self._own:
            for unix_us, entry in self._index.scan(_SAMPLE_US):
                clock_us = unix_us - entry.time_us if isinstance(entry, LiveGrasp) else 0
                yield unix_us, _dated(entry, clock_us) if isinstance(entry, LiveGrasp) else entry
            return
        stepper = Stepper(self._build, self._index.path.name, self._walk.periods)
        for unix_us, entry in self._index.scan():
            moment = stepper.take(entry)
            yield unix_us, entry if moment is None else _dated(moment.grasp, unix_us - moment.grasp.time_us)

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
        first, last = self._index.first_us, self._index.last_us
        if first is None or last is None:
            return
        if self._playing and self._at_us >= last and self._scanned.is_set() and not self._sought:
            self._playing = False
        if self._playing and not self._sought:
            self._at_us += round(1e6 * passed_s * self._speed)
        self._at_us = min(max(self._at_us, first), last)

    def _show(self) -> None:
        first, last = self._index.first_us, self._index.last_us
        if first is None or last is None:
            if self._scanned.is_set():
                self._tell(0, 0)
            return
        if self._sought:
            self.server.publish("past", self._overview.past(self._at_us))
        try:
            if self._walk.to(self._at_us):
                self.server.publish("frame", self._walk.text())
        except (ThenarError, OSError) as wrong:
            if str(wrong) not in self._faults:
                self._faults.append(str(wrong))
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
            "share": 1.0 if self._scanned.is_set() else self._index.scanned / max(self._index.size, 1),
            "truth": self._overview.truth_at(self._at_us),
            "faults": self._faults[:8],
        }
        self.server.publish("replay", message("replay", state))
        now = monotonic()
        if self._told < float("inf") and now - self._told >= _TOLD_S:
            self._told = float("inf") if self._scanned.is_set() else now
            self.server.publish("overview", self._overview.text())


class _Walk:
    """Moves through a recording to any moment, and holds the state there."""

    def __init__(self, index: Index, build: Build) -> None:
        self._index, self._build, name = index, build, index.path.name
        self.periods = periods_us(entry for _, entry in islice(Index(index.path).scan(), _PERIODS_OF))
        self._stepper = Stepper(build, name, self.periods)
        self._stepper.take(index.session)
        harness = parse_harness(index.session.harness, name) if index.session.harness else Harness(name="")
        self._text = FrameText(build, harness)
        self._entries: Iterator[tuple[int, object]] = iter(())
        self._next: tuple[int, Any] | None = None
        self._at_us = -1
        self._shown: Any = None
        self._moment: Any = None

    def to(self, unix_us: int) -> bool:
        """Go to a moment; return whether there is something new to show."""
        if not self._at_us <= unix_us <= self._at_us + 2 * LEAD_US:
            self._entries = self._index.since(unix_us - LEAD_US)
            self._stepper = Stepper(self._build, self._index.path.name, self.periods)
            self._next = self._moment = None
        self._at_us = unix_us
        while True:
            if self._next is None:
                self._next = next(self._entries, None)
            # Before the first prediction, the first one is shown.
            if self._next is None or self._next[0] > unix_us + LEAD_US * (self._moment is None):
                break
            self._take(*self._next)
            self._next = None
        newest = self._moment
        changed, self._shown = newest is not None and newest is not self._shown, newest
        if self._next is None:
            self._at_us = -1  # the part that is scanned later starts afresh
        return changed

    def text(self) -> bytes:
        """Return the message of the newest moment."""
        return self._text(self._moment)

    def _take(self, unix_us: int, entry: Any) -> None:
        moment, session = self._stepper.take(entry), self._stepper.session
        if moment is not None and session is not None:
            own = session.build == self._build.manifest.checksum
            grasp = entry if own and isinstance(entry, LiveGrasp) else moment.grasp
            moment.grasp = _dated(grasp, unix_us - grasp.time_us)
            self._moment = moment


def _dated(grasp: LiveGrasp, clock_us: int) -> LiveGrasp:
    """Return a grasp with times since 1970 instead of its session's clock."""
    began_us = None if grasp.segment_us is None else grasp.segment_us + clock_us
    return replace(grasp, time_us=grasp.time_us + clock_us, segment_us=began_us)

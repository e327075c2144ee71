"""A recording for a page: the predictions of one build or of two, the labels, and the glove at any moment.

The recording is recognised once, while pages show it, and the messages of its moments are kept in a temporary file. A
page asks for what it shows, and gets its own reply: no page moves another. What was read so far can be shown at once.
"""

import os
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path
from tempfile import TemporaryFile
from threading import Event, Thread

from thenar.drivers.closing import Closing
from thenar.drivers.errors import SettingError, ThenarError

from ..build import Build
from ..harness.loading import parse_harness
from ..harness.wiring import Harness
from ..live.recogniser import Moment
from ..live.replay import Stepper, periods_us
from ..published import LiveGrasp
from ..recording.reader import Entry, Reader
from ..recording.session import Label, Session
from .live import FrameText, Past, build_message, change_of, silent_us
from .server import message

# The interval of moments that are kept; the most changes of a build, or labels, that the overview holds.
_SAMPLE_US, _MOST_CHANGES = 20_000, 40_000
_PERIODS_OF = 20_000
# Of one reply: bytes of moments.
MOST_BYTES = 1 << 20
_LARGEST = 2**62


class Replay(Closing):
    """What pages ask of a recording; read on a thread until it is closed.

    A trial's span lasts from its beginning to its judgement; a repeated trial has none.

    Parameters
    ----------
    path : Path
        The recording.
    builds : sequence of Path
        The folders of builds, one or more, by which every frame is scored. For a run of the same build, its own
        predictions are shown; for other recordings, the predictions of this build. The page shows the hand and the
        moments of the first.

    Attributes
    ----------
    manifest : Manifest
        That of the first build.
    about : bytes
        The message "replay": what `build_message` says of the first build, and the names of recording and builds.

    Raises
    ------
    FormatError, OSError
        If `path` is not a recording of thenar.
    BuildError, SettingError
        If a build cannot be read, or the recording lacks an input of it.
    """

    def __init__(self, path: Path, builds: Sequence[Path]) -> None:
        self._reader, self._size = Reader(path), path.stat().st_size
        session = self._reader.session
        self._builds = [Build.load(build) for build in builds]
        for build in self._builds:
            Stepper(build, path.name, (None, None)).take(session)
        harness = parse_harness(session.harness, path.name) if session.harness else Harness(name="")
        self._text = FrameText(self._builds[0], harness)
        self.manifest = manifest = self._builds[0].manifest
        names = [build.resolve().name for build in builds]
        if len(set(names)) < len(names):
            names = [str(build) for build in builds]
        self.about = build_message("replay", builds[0], manifest, silent_us=None, name=path.name, builds=names)
        # What was read so far: its span; by build the changes; the labels; of each kept moment its time and where its
        # text ends.
        self._first_us: int | None = None
        self._last_us = 0
        self._pasts = [Past() for _ in builds]
        # The span and the type of each trial, by its number.
        self._truth = dict[int, tuple[int, int, str]]()
        self._begun_us: int | None = None
        self._times, self._ends = array("q"), array("q", (0,))
        self._faults, self._scanned, self._stop = list[str](), Event(), Event()
        self._kept = TemporaryFile(buffering=0)  # noqa: SIM115
        self._thread = Thread(target=self._scan, name="thenar scan", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Read no further, and forget what was read."""
        self._stop.set()
        self._thread.join()
        self._kept.close()

    def reply(self, asked: Mapping[str, object]) -> bytes:
        """Return the reply to a page.

        Parameters
        ----------
        asked : mapping
            `do` is "overview", for the changes and labels that were read so far, or "moments", of which `numbers` has
            the second since 1970.

        Raises
        ------
        SettingError
            If the page asks for something else.
        """
        do, numbers = asked.get("do"), asked.get("numbers")
        if do not in ("overview", "moments"):
            raise SettingError(f"a page can ask for the overview or for moments of a recording, not {str(do)[:20]!r}")
        if do == "overview":
            return self._overview()
        second = numbers[0] if isinstance(numbers, list | tuple) and len(numbers) == 1 else None
        if not isinstance(second, int) or isinstance(second, bool) or abs(second) >= _LARGEST:
            raise SettingError("for the moments of a recording, a page must send a whole number below 2^62")
        return self._moments(second)

    def _overview(self) -> bytes:
        scanned = self._scanned.is_set()
        return message(
            "overview",
            changes=[[*past.changes] for past in self._pasts],
            truth=sorted(self._truth.values()),
            first_us=self._first_us,
            last_us=self._last_us,
            share=1.0 if scanned else min(self._reader.tail.size / max(self._size, 1), 0.999),
            faults=self._faults[:8],
        )

    def _moments(self, second: int) -> bytes:
        """Return the moment that was current when a second began, and those in it; none before it was read whole."""
        scanned, count = self._scanned.is_set(), len(self._times)
        first = max(bisect_right(self._times, 1_000_000 * second, hi=count) - 1, 0)
        end = bisect_left(self._times, 1_000_000 * (second + 1), first, count)
        texts = b""
        if count and (scanned or end < count):
            begin = self._ends[first]
            most = bisect_right(self._ends, begin + MOST_BYTES, hi=count + 1) - 1
            end = max(min(end, most), first + 1)
            texts = os.pread(self._kept.fileno(), self._ends[end] - begin, begin)
        return message("moments", second=second)[:-1] + b',"frames":[' + texts[:-1] + b"]}"

    def _scan(self) -> None:
        """Recognise the whole recording: fill the overview, and keep what pages show."""
        path, newest = self._reader.path, None
        try:
            periods = periods_us(islice(Reader(path), _PERIODS_OF))
            for past in self._pasts:
                past.silent_us = silent_us(*periods)
            steppers = [Stepper(build, path.name, periods) for build in self._builds]
            for entry in self._reader:
                if self._stop.is_set():
                    return
                # A moment has the clock of its session.
                newest = None if isinstance(entry, Session) else newest
                newest = self._take(entry, [stepper.take(entry) for stepper in steppers]) or newest
            if newest is not None and self._clock_us + newest.grasp.time_us > self._times[-1]:
                self._keep(newest)
        except ThenarError as wrong:
            self._faults.append(str(wrong))
        except OSError as wrong:
            self._faults.append(f"{path.name} is shown up to here: {wrong.strerror}")
        self._faults += [fault.message for fault in self._reader.faults()]
        if max(len(self._truth), *(len(past.changes) for past in self._pasts)) >= _MOST_CHANGES:
            self._faults.append(f"the timeline ends at {_MOST_CHANGES} changes of the prediction, or labels")
        self._scanned.set()

    @property
    def _clock_us(self) -> int:
        """When the clock of the session began, since 1970."""
        return self._reader.session.clock_ns // 1000

    def _take(self, entry: Entry, moments: Sequence[Moment | None]) -> Moment | None:
        """Take an entry and what each build makes of it; return the first one's moment."""
        if isinstance(entry, Session):
            self._begun_us = None
            return None
        unix_us = self._clock_us + entry.time_us
        self._first_us = unix_us if self._first_us is None else self._first_us
        self._last_us = max(self._last_us, unix_us)
        if isinstance(entry, Label):
            self._label(unix_us, entry)
        changed = False
        for build, moment, past in zip(self._builds, moments, self._pasts, strict=True):
            if moment is None:
                continue
            # For a run of the same build, its own predictions are shown.
            if isinstance(entry, LiveGrasp) and self._reader.session.build == build.manifest.checksum:
                moment.grasp = entry
            if len(past.changes) < _MOST_CHANGES and past.take(change_of(moment.grasp, self._clock_us)):
                changed |= moment is moments[0]
        moment = moments[0]
        if moment is not None and (not self._times or changed or unix_us >= self._times[-1] + _SAMPLE_US):
            self._keep(moment)
        return moment

    def _label(self, unix_us: int, label: Label) -> None:
        if label.event == "begun" or self._begun_us is None:
            self._begun_us = unix_us
        if label.event == "undone":
            self._truth.pop(label.trial, None)
        if label.event == "accepted" and len(self._truth) < _MOST_CHANGES:
            self._truth[label.trial] = self._begun_us, unix_us, label.grasp
        if label.event in ("accepted", "redone"):
            self._begun_us = None

    def _keep(self, moment: Moment) -> None:
        """Keep the message of a moment. The server's thread reads it once its time is in the list."""
        text = self._text(moment, self._clock_us) + b","
        self._kept.write(text)
        self._ends.append(self._ends[-1] + len(text))
        self._times.append(self._clock_us + moment.grasp.time_us)

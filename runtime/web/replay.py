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
_SAMPLE_US, _MOST_CHANGES = 20_000, 200_000
_PERIODS_OF = 20_000
# Of one reply: entries of each list of the overview, and bytes of moments.
MOST_ENTRIES, MOST_BYTES = 4_000, 1 << 20
_LARGEST = 2**62
# The number of a trial, its span, and its type; an empty span revokes the trial.
Truth = tuple[int, int, int, str]


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
        self._truth = list[Truth]()
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
            `do` is "overview", for the changes and labels that the page has not got yet, or "moments". `numbers` are,
            of the overview, how many changes of each build, and labels, it has; of moments, the second since 1970.

        Raises
        ------
        SettingError
            If the page asks for something else.
        """
        do, numbers = asked.get("do"), asked.get("numbers")
        if do not in ("overview", "moments"):
            raise SettingError(f"a page can ask for the overview or for moments of a recording, not {str(do)[:20]!r}")
        count = 1 if do == "moments" else len(self._builds) + 1
        if not isinstance(numbers, list | tuple) or len(numbers) != count or not all(map(_is_number, numbers)):
            raise SettingError(f"for the {do} of a recording, a page must send {count} of `numbers`, below 2^62")
        return self._moments(*numbers) if do == "moments" else self._overview(numbers)

    def _overview(self, have: Sequence[int]) -> bytes:
        scanned = self._scanned.is_set()
        lists: list[Sequence[object]] = [*(past.changes for past in self._pasts), self._truth]
        *changes, truth = [found[max(n, 0) : max(n, 0) + MOST_ENTRIES] for n, found in zip(have, lists, strict=True)]
        return message(
            "overview",
            have=have,
            changes=changes,
            truth=truth,
            first_us=self._first_us,
            last_us=self._last_us,
            share=1.0 if scanned else min(self._reader.tail.size / max(self._size, 1), 0.999),
            faults=self._faults[:8],
        )

    def _moments(self, second: int) -> bytes:
        """Return the moment that was current when a second began, and those in it; none before it was read whole.

        Of too many, every second one is returned, or every third, and so on.
        """
        scanned, count = self._scanned.is_set(), len(self._times)
        first = max(bisect_right(self._times, 1_000_000 * second, hi=count) - 1, 0)
        end = bisect_left(self._times, 1_000_000 * (second + 1), first, count)
        texts = list[bytes]()
        if count and (scanned or end < count):
            end = max(end, first + 1)
            step = 1 + (self._ends[end] - self._ends[first]) // MOST_BYTES
            for number in range(first, end, step):
                begin, behind = self._ends[number : number + 2]
                texts.append(os.pread(self._kept.fileno(), behind - begin, begin))
        return message("moments", second=second)[:-1] + b',"frames":[' + b",".join(texts) + b"]}"

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
        if label.event in ("accepted", "undone") and len(self._truth) < _MOST_CHANGES:
            span = (self._begun_us, unix_us, label.grasp) if label.event == "accepted" else (0, 0, "")
            self._truth.append((label.trial, *span))
        if label.event in ("accepted", "redone"):
            self._begun_us = None

    def _keep(self, moment: Moment) -> None:
        """Keep the message of a moment. The server's thread reads it once its time is in the list."""
        text = self._text(moment, self._clock_us)
        self._kept.write(text)
        self._ends.append(self._ends[-1] + len(text))
        self._times.append(self._clock_us + moment.grasp.time_us)


def _is_number(given: object) -> bool:
    return isinstance(given, int) and not isinstance(given, bool) and abs(given) < _LARGEST

"""The live page of a run: its view of each moment, and recordings that it begins, marks and ends while the glove runs.

In the loop of the run a moment costs a reference or two; its text is made on the server's thread, if a page is open.
Recordings equal those of `thenar run --record`, of the same glove by the same recorder, in one folder: a page sends
part of a file's name, never a path. The files are created and closed on other threads than that of the run, which only
changes its recorder: no disk delays it.
"""

import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from threading import Thread
from time import time

import msgspec

from thenar.drivers.closing import Closing
from thenar.drivers.errors import SettingError

from ..build import Build
from ..detail import Details
from ..frames import now_us
from ..glove import Glove
from ..hand import load_hand
from ..harness.wiring import Harness
from ..live.recogniser import Moment
from ..manifest import Manifest
from ..published import HealthReport, LiveGrasp
from ..recording.session import Mark
from ..recording.writer import LiveRecorder
from ..taxels import calibration_of
from .server import Server, message

# Length and resolution of the past that a newly opened page gets.
PAST_US, _STEP_US = 30_000_000, 10_000
MOST_LETTERS, MOST_TEXT = 40, 200
_NAME = re.compile(rf"[A-Za-z0-9][A-Za-z0-9_-]{{0,{MOST_LETTERS - 1}}}")
_encode = msgspec.json.Encoder().encode
_FRAME = b'{"topic":"frame",'


class LivePage(Closing):
    """Serves the live page of a glove until it is left; a context manager.

    Parameters
    ----------
    glove : Glove
        The running glove; it is `recordable`.
    folder : Path
        The build's folder, whose hand is drawn.
    address, token
        As for `Server`.
    recordings : Path
        The only folder into which a page can record.

    Attributes
    ----------
    server : Server
        The server of the page; `server.url` is its address.

    Raises
    ------
    BuildError
        If the build's drawing of a hand is damaged.
    SettingError, SinkError
        As `Server` does.
    """

    def __init__(self, glove: Glove, folder: Path, address: str, *, token: str | None, recordings: Path) -> None:
        self._glove, self._frames = glove, FrameText(glove.system.build, glove.system.harness)
        self._health: HealthReport | None = None
        # The latest predictions, for pages opened later.
        self._past = deque[LiveGrasp](maxlen=PAST_US // _STEP_US)
        self._recordings = Recordings(glove, recordings, self._tell_recording)
        manifest, name = glove.system.build.manifest, glove.system.harness.name
        self._first = (
            build_message(folder, manifest, name, preshapes=glove.has_preshapes, records=True),
            message("hand", load_hand(folder, manifest)),
        )
        self.server = Server("live", address, token=token, on_message=self._recordings.take, hello=self._hello)
        self._tell_recording()

    def show(self, moment: Moment) -> None:
        """Show the moment that the glove has just published, and carry out requests. For the thread of the run."""
        grasp, glove = moment.grasp, self._glove
        self.server.publish("frame", partial(self._frames, moment))
        if not self._past or grasp.time_us >= self._past[-1].time_us + _STEP_US:
            self._past.append(grasp)
        if glove.health is not self._health and glove.health is not None:
            self._health = glove.health
            self.server.publish("health", partial(message, "health", self._health))
            self._tell_recording()
        self._recordings.step()

    @property
    def recorded(self) -> Sequence[LiveRecorder]:
        """The recordings begun by pages."""
        return self._recordings.made

    def close(self) -> None:
        """Close the page, and a recording that it began."""
        self.server.close()
        self._recordings.close()

    def _tell_recording(self) -> None:
        self.server.publish("recording", message("recording", self._recordings.state))

    def _hello(self) -> Sequence[bytes]:
        changes: list[tuple[object, ...]] = []
        past = self._past.copy()
        for grasp in past:
            entry = (
                *(grasp.candidate, grasp.grasp, grasp.health, grasp.state, grasp.segment),
                *(grasp.segment_type, grasp.segment_us),
            )
            if not changes or entry != changes[-1][1:]:
                changes.append((grasp.time_us, *entry))
        until_us = past[-1].time_us if past else 0
        return (*self._first, message("past", changes=changes, until_us=until_us))


class Recordings:
    """The recordings of one run of `glove`, which is `recordable`, in `folder`; `made` are those begun by pages.

    `take` may be called on any one thread, `step` on that of the run; `changed` is called, on either, after the state
    has changed.
    """

    def __init__(self, glove: Glove, folder: Path, changed: Callable[[], None]) -> None:
        self._glove, self._folder, self._changed = glove, folder, changed
        self._asked: deque[LiveRecorder | Mark | None] = deque()
        self._own: LiveRecorder | None = None
        self._beginning = False
        self._since_s, self._marks = time(), 0
        self._closing: list[Thread] = []
        self.made: list[LiveRecorder] = []

    @property
    def state(self) -> dict[str, object]:
        """What a page shows: the "folder"; whether one is being written ("on"), and since when ("since_s", since 1970);
        the "name" of the file, the newest one's if none is being written; whether the command began it (--record), so
        that no page can end it ("fixed"); numbers of "messages" and "marks"; why nothing can be recorded now.
        """
        shown = self._glove.recorder or self._own
        return {
            "folder": str(self._folder),
            "on": self._glove.recorder is not None,
            "name": "" if shown is None else shown.path.name,
            "fixed": shown is not self._own,
            "since_s": self._since_s,
            "messages": 0 if shown is None else shown.messages,
            "marks": self._marks,
            "failure": "" if shown is None else shown.failure or "",
        }

    def take(self, message: Mapping[str, object]) -> None:
        """Carry out a page's request. Raises SettingError if it is impossible."""
        do = message["do"]
        if do == "record":
            recorder = self._begun(message.get("name", ""))
            self._beginning = True
            self._asked.append(recorder)
        elif do == "mark":
            self._asked.append(self._mark(message.get("text", "")))
        elif do == "stop":
            self._check_ours()
            self._asked.append(None)
        else:
            raise SettingError(f"a page can request record, mark or stop, not {str(do)[:20]!r}")

    def step(self) -> None:
        """Carry out pending requests, between two moments of the glove."""
        while self._asked:
            asked = self._asked.popleft()
            if isinstance(asked, Mark):
                if self._glove.recorder is not None:
                    self._glove.recorder.mark(asked)
                    self._marks += 1
            else:
                self._replace(asked)
            self._changed()

    def close(self) -> None:
        """End the recording that a page began, and wait until all are complete on the disk."""
        self.step()
        if self._own is not None and self._glove.recorder is self._own:
            self._replace(None)
        for thread in self._closing:
            thread.join()

    def _begun(self, name: object) -> LiveRecorder:
        if self._beginning or self._glove.recorder is not None:
            raise SettingError("a recording is running: stop it first")
        if not isinstance(name, str) or not (name == "" or _NAME.fullmatch(name)):
            raise SettingError(f"a recording's name has at most {MOST_LETTERS} letters of a to z, digits, - and _")
        moment = datetime.now().strftime("%Y%m%d-%H%M%S")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            return self._glove.new_recording(self._folder / f"{name or 'run'}-{moment}.mcap")
        except OSError as reason:
            raise SettingError(f"nothing can be recorded in {self._folder}: {reason.strerror}") from None

    def _mark(self, text: object) -> Mark:
        if self._glove.recorder is None:
            raise SettingError("no recording is running, so there is nothing to mark: start one first")
        if not isinstance(text, str) or len(text) > MOST_TEXT:
            raise SettingError(f"a mark has at most {MOST_TEXT} letters")
        return Mark(now_us(), text)

    def _check_ours(self) -> None:
        recorder = self._glove.recorder
        if recorder is None:
            raise SettingError("no recording is running")
        if recorder is not self._own:
            raise SettingError(f"{recorder.path.name} was begun by the command (--record), and ends with it")

    def _replace(self, recorder: LiveRecorder | None) -> None:
        """Record into this from now on, or nowhere; close the previous recording."""
        before = self._glove.recorder
        if recorder is not None:
            self._own, self._since_s, self._marks = recorder, time(), 0
            self.made.append(recorder)
        self._glove.recorder, self._beginning = recorder, False
        if before is not None:
            self._closing = [thread for thread in self._closing if thread.is_alive()]
            self._closing.append(Thread(target=before.close, name="thenar recorded"))
            self._closing[-1].start()


def build_message(folder: Path | None, manifest: Manifest | None, name: str, **shows: bool) -> bytes:
    """Return the message on the build of a page called `name`: which one it is, None where it is not known; its types,
    switches and joints; whether it knows an empty hand; and what else the page `shows`: "preshapes", the buttons of
    "records", or a "replay".
    """
    known: dict[str, object] = {"grasps": (), "switches": (), "joints": (), "partial": True}
    if folder is not None and manifest is not None:
        known = {
            "build": f"{folder.resolve().name} {manifest.checksum[:8]}",
            "grasps": manifest.classes,
            "switches": [switch.name for switch in manifest.switches],
            "joints": [joint.name for joint in manifest.joints],
            "empty_hand": manifest.knows_none,
        }
    return message("build", known, name=name, **{"preshapes": False, "records": False, "replay": False} | shows)


class FrameText:
    """Makes the text of a moment: the fields of its grasp, preshape and angles as in sinks, those of `Detail`,
    `late_us`: its age now, and `taxels`: by name, how far each read and calibrated taxel is pressed, from 0 at rest to
    1 at its press.
    """

    def __init__(self, build: Build, harness: Harness) -> None:
        self._details = Details(build)
        calibration = calibration_of(harness.taxel_settings)
        self._taxels = [None if calibration is None else calibration.line(name) for name in harness.taxel_names]

    def __call__(self, moment: Moment) -> bytes:
        """Return the text."""
        frame = moment.switches
        more = {
            "preshape": moment.preshape,
            "angles": moment.angles,
            "late_us": now_us() - moment.grasp.time_us,
            "taxels": {} if frame is None or frame.taxels is None else self._pressed(frame.taxels),
        }
        parts = map(_inside, (moment.grasp, self._details(moment), more))
        return _FRAME + b",".join(parts) + b"}"

    def _pressed(self, codes: Sequence[int | None]) -> dict[str, float]:
        return {
            line.name: round(min(max((code - line.rest) / (line.press - line.rest), 0.0), 1.0), 3)
            for code, line in zip(codes, self._taxels, strict=True)
            if code is not None and line is not None
        }


def _inside(fields: object) -> bytes:
    return _encode(fields)[1:-1]

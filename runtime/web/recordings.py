"""Recordings that a page begins, marks and ends while the glove runs.

They equal those of `thenar run --record`, of the same glove by the same recorder, in one folder: a page sends part of a
file's name, never a path. The files are created and closed on other threads than that of the run, which only changes
its recorder: no disk delays it.
"""

import re
from collections import deque
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from threading import Thread
from time import time

from thenar.drivers.errors import SettingError

from ..frames import now_us
from ..glove import Glove
from ..recording.session import Mark
from ..recording.writer import LiveRecorder

MOST_LETTERS, MOST_TEXT = 40, 200
_NAME = re.compile(rf"[A-Za-z0-9][A-Za-z0-9_-]{{0,{MOST_LETTERS - 1}}}")


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

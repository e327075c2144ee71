"""`Studio`: one server, the project that its pages show, and the work that they ask for.

A page asks with a message: `do` names the request, other fields its values. A request is carried out on the server's
thread if it takes milliseconds. Longer work is queued and done one at a time, by `run`; its progress is the topic
"work", its result that of the request's name. The devices of the glove have one user at a time, whose thread the
`Station` keeps.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event, Lock, Thread
from time import monotonic
from typing import Any

import msgspec

from thenar.drivers.closing import Closing
from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.names import shortened
from thenar.runtime.published import DeviceHealth
from thenar.runtime.web.live import shell_message
from thenar.runtime.web.server import Server, message

from .edits import edits_shown
from .project import Project

PAGES = Path(__file__).parent / "pages"
# The file and the title of each page, in the order of the links.
_TITLES = [
    (f"{title.lower()}.html", title) for title in ("Glove", "Record", "Choose", "Errors", "Live", "Wearer", "Compare")
]
_MOST_QUEUED = 8
_LOOK_S = 0.2
# What is said of devices is old after this time.
_LASTS_S = 2.0
# How far work is: how much is done, and of how much. Work that was asked for returns the fields of its result.
Report = Callable[[int, int], None]
Job = Callable[[Report], Mapping[str, object] | None]

_log = logging.getLogger("thenar")


class Asked(msgspec.Struct, frozen=True):
    """What a page asks for: `do`, and the values that this takes.

    sensors  numbers of sensors        trial, trials  numbers of trials
    id       of a member of the project    name, names  a name, or a key; several
    value    a number                      ids   of several members
    numbers  of moments and parts of a recording, as `Replay.reply` takes them
    """

    do: str
    sensors: tuple[int, ...] = ()
    trial: int = 0
    trials: tuple[int, ...] = ()
    id: str = ""
    name: str = ""
    names: tuple[str, ...] = ()
    value: float | None = None
    ids: tuple[str, ...] = ()
    numbers: tuple[int, ...] = ()


# What carries out a request returns a reply to the page, or work to queue, whose result all pages get.
Handler = Callable[[Asked], bytes | Job | None]


class Studio(Closing):
    """Serves the pages of a project until it is closed; a context manager.

    Parameters
    ----------
    project : Project
        The project.
    address, token, page
        As for `Server`.
    jobs : int
        Worker processes of a measurement.

    Attributes
    ----------
    server : Server
        The server of the pages; `server.url` is its address.
    station : Station
        What uses the glove.
    closing : ExitStack
        What is to be closed with the studio.

    Raises
    ------
    SettingError, SinkError
        As `Server` does.
    """

    def __init__(
        self, project: Project, address: str, *, token: str | None, jobs: int = -1, page: str = "choose"
    ) -> None:
        self.project, self.jobs = project, jobs
        self._requests: dict[str, Handler] = {
            "cancel": self._cancel,
            "key": lambda asked: self.station.press(asked.name),
        }
        self._readers = list[Callable[[Report], None]]()
        self._queue = SimpleQueue[tuple[str, Job]]()
        self._stale = False
        self._began_s, self._cancelled = 0.0, False
        self.server = Server(page, address, token=token, on_message=self._take, folder=PAGES)
        self.station = Station(self.publish)
        self.closing = ExitStack()

    def add(self, requests: Mapping[str, Handler], read: Callable[[Report], None] | None = None) -> None:
        """Add what carries out the requests of a page, by their `do`.

        `read` is queued whenever the project has changed: it publishes what the page shows of it.
        """
        self._requests |= requests
        self._readers += [] if read is None else [read]

    def publish(self, topic: str, content: object = None, **more: object) -> None:
        """Make these fields, as `message` takes them, the newest message of a topic."""
        self.server.publish(topic, message(topic, content, **more))

    def queue(self, what: str, work: Job) -> None:
        """Do this later, and publish its result as the message `what`.

        Raises ThenarError if too much waits already.
        """
        if self._queue.qsize() >= _MOST_QUEUED:
            raise ThenarError(f"{_MOST_QUEUED} jobs are waiting already: let them finish")
        self._queue.put((what, work))

    def changed(self) -> None:
        """Show the project as it is now, after a set or a build came, went or changed, or trials were edited."""
        about, state = tuple[Any, ...](), self.project.state
        # What is wrong with a build is said by the pages that read it.
        with suppress(ThenarError, OSError):
            folder, build = self.project.build()
            about = folder, build.manifest
        self.show_edits()
        shell = shell_message(self.project.name, *about, pages=_TITLES, wearer=state.wearer)
        self.server.publish("shell", shell)
        self._show_members()
        # Of several changes the last is read: a recording or a build may come while another is read.
        if not self._stale:
            self._stale = True
            self._queue.put(("reading", self._read))

    def show_edits(self) -> None:
        """Show the log of edits. What is wrong with it is said by Choose."""
        with suppress(ThenarError, OSError):
            self.publish("edits", edits_shown(self.project.edits))

    def _read(self, report: Report) -> None:
        """Let every page read the project. Raises the first error once all have tried."""
        self._stale, wrong = False, list[Exception]()
        # Again: of two threads that showed it at the same time, the later one may have read it first.
        self.show_edits()
        for read in self._readers:
            try:
                read(report)
            except (ThenarError, OSError) as reason:
                wrong.append(reason)
        if wrong:
            raise wrong[0]

    def run(self, stop: Event) -> None:
        """Do what pages ask for, until `stop` is set."""
        while not stop.is_set():
            try:
                what, work = self._queue.get(timeout=_LOOK_S)
            except Empty:
                continue
            report = partial(self._report, what)
            self._began_s, self._cancelled = monotonic(), False
            try:
                report(0, 1)
                made = work(report)
                if made is not None:
                    self.publish(what, made)
                self.publish("work", done=1, total=1, what=what)
                if what != "reading":
                    took = round(monotonic() - self._began_s, 1)
                    # A folder that cannot be written to is read all the same.
                    with suppress(OSError):
                        self.project.remember(took=self.project.state.took | {what: took})
                    self._show_members()
            except Exception as reason:
                self.publish("work", done=0, total=0, why=_sentence(reason))

    def close(self) -> None:
        """End what uses the glove, and close the pages."""
        self.station.close()
        self.server.close()
        self.closing.close()

    def _show_members(self) -> None:
        kinds = {
            f"{kind}s": [{"id": member, "name": path.name} for member, path in self.project.members(kind).items()]
            for kind in ("set", "recording", "build")
        }
        self.publish("project", kinds, state=self.project.state)

    def _report(self, what: str, done: int, total: int) -> None:
        """Tell how far the work is, and how long it takes still: as its parts so far, or as the last time, if known.

        Raises ThenarError if it was cancelled.
        """
        if self._cancelled:
            raise ThenarError("cancelled")
        spent, last = monotonic() - self._began_s, self.project.state.took.get(what)
        left = spent / done * (total - done) if done else None if last is None else max(last - spent, 0.0)
        self.publish("work", done=done, total=total, what=what, left_s=left)

    def _cancel(self, _: Asked) -> None:
        """End the work at its next report."""
        self._cancelled = True

    def _take(self, fields: Mapping[str, object]) -> bytes | None:
        """Carry out a request. Raises ThenarError if it cannot be met."""
        try:
            asked = msgspec.convert(fields, Asked)
        except msgspec.ValidationError as wrong:
            raise ThenarError(f"the page sent an invalid message: {wrong}") from None
        handler = self._requests.get(asked.do)
        if handler is None:
            raise ThenarError(f"a page cannot {asked.do[:20]!r}")
        try:
            made = handler(asked)
        except OSError as reason:  # the folder is read-only, full or gone
            raise ThenarError(str(reason)) from None
        if not callable(made):
            return made
        self.queue(asked.do, made)
        return None


class Station:
    """The one user of the glove's devices: watching, recording, calibrating or running, on a thread.

    Parameters
    ----------
    publish : callable
        As `Studio.publish`. The topic "station" says what uses the glove, and why it ended.
    """

    def __init__(self, publish: Callable[..., None]) -> None:
        self._publish, self._stop = publish, Event()
        self._thread: Thread | None = None
        self._changing = Lock()
        self._keys, self._pressed = tuple[str, ...](), SimpleQueue[str]()
        self.doing = ""
        self._tell("")

    def start(self, doing: str, work: Callable[[Event], None], keys: Sequence[str] = ()) -> None:
        """End what uses the glove, and then start this: `work` gets an event that is set when it is to end.

        It takes these `keys`, which pages press. Returns at once: a device may take seconds to end. Raises SettingError
        during a recording, which is only ended on its page, and during a run for what is no recording.
        """
        with self._changing:
            if self.doing == "recording" or (self.doing == "live" and doing != "recording"):
                raise SettingError(f"the glove is in use: {self.doing}; end that first")
            self._stop.set()
            self._stop, self.doing = Event(), doing
            self._keys, self._pressed = tuple(keys), SimpleQueue()
            follow = partial(self._run, doing, work, self._stop, self._thread)
            self._thread = Thread(target=follow, name=f"thenar {doing}", daemon=True)
            self._thread.start()

    def press(self, key: str) -> None:
        """Press a key for what uses the glove. Raises SettingError if it does not take this."""
        if key not in self._keys:
            raise SettingError(f"there is no key {shortened(repr(key))} now")
        self._pressed.put(key)

    def pressed(self) -> list[Any]:
        """Return the keys that were pressed since the last call."""
        pressed = self._pressed
        return [pressed.get() for _ in range(pressed.qsize())]

    def stop(self) -> None:
        """Let what uses the glove end soon."""
        self._stop.set()

    def close(self) -> None:
        """End what uses the glove."""
        self.stop()
        if self._thread is not None:
            self._thread.join()

    def _run(self, doing: str, work: Callable[[Event], None], stop: Event, before: Thread | None) -> None:
        if before is not None:
            before.join()
        self._tell(doing)
        why = ""
        try:
            if not stop.is_set():
                work(stop)
        except Exception as reason:
            why = _sentence(reason)
        with self._changing:
            if stop is self._stop:
                self.doing, self._keys = "", ()
        self._tell(self.doing, why)

    def _tell(self, doing: str, why: str = "") -> None:
        self._publish("station", doing=doing, why=why)
        if not doing:
            self._publish("glove", {"is": "warn", "words": "not in use"})


def _sentence(reason: Exception) -> str:
    """Return why something failed. A bug of ours is logged, and ends neither the pages nor a recording."""
    if isinstance(reason, ThenarError | OSError | BrokenExecutor):
        # Parameters are named between backticks, for commands to spell.
        return str(reason).replace("``", "")
    _log.error("the studio: a bug in the program", exc_info=reason)
    return f"a bug in thenar: {type(reason).__name__}"


def glove_shown(devices: Sequence[DeviceHealth]) -> dict[str, object]:
    """Return the fields of the message on the bar about the state of the glove's devices."""
    lost = ", ".join(f"{device.name} lost" for device in devices if not device.connected)
    return {"is": "bad" if lost else "good", "words": lost or "connected", "lasts_s": _LASTS_S}

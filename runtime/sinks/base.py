"""The interface of all sinks, their kinds, and several sinks as one."""

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import msgspec

from thenar.drivers.errors import SettingError, ThenarError
from thenar.drivers.members import Members

from ..names import shortened
from ..preshape.selector import Preshape
from ..published import HealthReport, JointAngles, LiveGrasp
from ..task import Progress

if TYPE_CHECKING:
    from ..build import Build
    from ..live.recogniser import Moment

_log = logging.getLogger("thenar")


class SinkError(ThenarError, OSError):
    """A sink cannot be opened: the name is taken, the folder or a package is missing. The message says which."""


class SinkReport(msgspec.Struct, frozen=True):
    """The state of a sink since it was opened.

    where     as given to `open_sink`
    readers   number of current readers; None if unknown
    sent      lines sent, counted once per reader
    lost      lines not sent: a reader was slow or gone, or the system refused
    error     the last error, or nothing
    over      whether nothing more will be sent: its only reader is gone, the disk is full, it broke
    dropped   number of readers dropped because they took nothing, or were the slowest when all places were taken
    """

    where: str
    readers: int | None
    sent: int
    lost: int
    error: str = ""
    over: bool = False
    dropped: int = 0


class Sink(ABC):
    """An open sink: it takes every frame's result. To write your own, derive from this; only `publish` is required.

    No method blocks and none but the constructor raises: what cannot be sent is lost, and counted.
    """

    __slots__ = ()

    def begin(self, build: "Build") -> None:  # noqa: B027
        """Take the build that recognises, before the first frame."""

    @abstractmethod
    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Send a prediction.

        preshape is the one that the hand should have now, or None to send it nothing; angles are the glove's.
        """

    def moment(self, moment: "Moment") -> None:  # noqa: B027
        """Send the frames, codes and scores behind the grasp that was published last."""

    def health(self, report: HealthReport) -> None:  # noqa: B027
        """Send the glove's health, about once a second."""

    def task(self, progress: Progress) -> None:  # noqa: B027
        """Send the hand's progress in a task, at the first frame and whenever it changes."""

    def report(self) -> SinkReport:
        """Return the state of the sink itself."""
        return SinkReport(type(self).__name__, None, 0, 0)

    def close(self) -> None:  # noqa: B027
        """Release everything; may be called twice."""


@dataclass(frozen=True, slots=True)
class SinkPlace:
    """The place where a sink is to be opened.

    text     as the user wrote it: "ros:/thenar?public&rate=50"
    place    what follows the name: "/thenar"
    options  the options that are given, and their values: {"public": "", "rate": "50"}
    wait     whether to wait for a slow reader rather than lose lines: right for a replay, wrong for a live glove
    """

    text: str
    place: str
    options: Mapping[str, str] = field(default_factory=dict)
    wait: bool = False


@dataclass(frozen=True, slots=True)
class SinkKind:
    """A kind of sink, as chosen by `--sink NAME:PLACE`.

    A module of `thenar.runtime.sinks` defines one as `MEMBER`, or a tuple of several; another package registers one
    under the entry point `thenar.sinks`.

    Attributes
    ----------
    name : str
        The name before the colon: "tcp".
    place : str
        The part after it, as spelled in help: "127.0.0.1:PORT".
    help : str
        Its function, in a few words: "JSON lines to whoever connects".
    open : callable
        `open(where)` returns an open `Sink` at a `SinkPlace`. It raises SettingError for an invalid place, SinkError
        for one that cannot be opened. A package that only this sink needs is imported in it.
    options : tuple of str
        Words that may follow the place after a question mark, separated by &: "public"; "rate=HZ" takes a value.
    rank : int
        Orders the kinds.
    """

    name: str
    place: str
    help: str
    open: Callable[[SinkPlace], Sink]
    options: tuple[str, ...] = ()
    rank: int = 0

    @property
    def spelling(self) -> str:
        """Its form in `--sink`: "ros:/NAMESPACE[?public][?rate=HZ]"."""
        return f"{self.name}:{self.place}" + "".join(f"[?{option}]" for option in self.options)


SINKS = Members("sink", SinkKind, "thenar.runtime.sinks", "thenar.sinks")


def open_sink(where: str, *, wait: bool = False) -> Sink:
    """Return the sink that `where` names: NAME:PLACE, spelled as in the kinds of `SINKS`.

    With `wait`, it waits for a slow reader rather than lose lines. Raises SettingError for an invalid name, SinkError
    for one that cannot be opened.
    """
    name, _, place = where.partition(":")
    if not place or name not in SINKS:
        kinds = ", ".join(kind.spelling for kind in SINKS.values())
        wrong = f"there is no kind of sink called {shortened(name)!r}" if place else "names no sink"
        raise SettingError(f"{shortened(repr(where))}: {wrong}: use one of {kinds}")
    kind, options = SINKS[name], dict[str, str]()
    if kind.options:
        place, mark, given = place.partition("?")
        parts = [option.partition("=") for option in given.split("&")] if mark else []
        known = {option.partition("=")[:2] for option in kind.options}
        if not {part[:2] for part in parts} <= known:
            spelled = " or ".join(f"`{option}`" for option in kind.options)
            raise SettingError(f"{shortened(repr(where))}: after the question mark only {spelled} can follow")
        options = {option: value for option, _, value in parts}
    return kind.open(SinkPlace(where, place, options, wait))


class Fanout:
    """Publishes to every one of `sinks`. One that raises, against its contract, is left out from then on: its report
    says why, and the log has the trace.
    """

    __slots__ = ("_errors", "_lost", "_sinks")

    def __init__(self, sinks: Iterable[Sink]) -> None:
        self._sinks = tuple(sinks)
        self._errors, self._lost = [""] * len(self._sinks), [0] * len(self._sinks)

    def begin(self, build: "Build") -> None:
        """Pass the build to all sinks."""
        self._all(lambda sink: sink.begin(build))

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Publish to all sinks that work."""
        self._all(lambda sink: sink.publish(grasp, preshape, angles))

    def moment(self, moment: "Moment") -> None:
        """Send the moment behind the newest grasp to all sinks that work."""
        self._all(lambda sink: sink.moment(moment))

    def health(self, report: HealthReport) -> None:
        """Send the glove's health to all sinks that work."""
        self._all(lambda sink: sink.health(report))

    def task(self, progress: Progress) -> None:
        """Send the hand's progress to all sinks that work."""
        self._all(lambda sink: sink.task(progress))

    def reports(self) -> tuple[SinkReport, ...]:
        """Return the states of all sinks, in order."""
        return tuple(self._report(number, sink) for number, sink in enumerate(self._sinks))

    def close(self) -> None:
        """Close all sinks, also after one of them fails to."""
        for number, sink in enumerate(self._sinks):
            try:
                sink.close()
            except Exception as reason:
                self._blame(number, reason)

    def _all(self, send: Callable[[Sink], None]) -> None:
        for number, sink in enumerate(self._sinks):
            if self._errors[number]:
                self._lost[number] += 1
                continue
            try:
                send(sink)
            except Exception as reason:
                self._leave_out(number, reason)

    def _report(self, number: int, sink: Sink) -> SinkReport:
        if not self._errors[number]:
            try:
                return sink.report()
            except Exception as reason:
                self._blame(number, reason)
        return SinkReport(type(sink).__name__, None, 0, self._lost[number], self._errors[number], over=True)

    def _leave_out(self, number: int, reason: Exception) -> None:
        self._blame(number, reason)
        self._lost[number] += 1

    def _blame(self, number: int, reason: Exception) -> None:
        self._errors[number] = f"{type(reason).__name__}: {reason}"
        _log.error("sink %s: a bug in the program", type(self._sinks[number]).__name__, exc_info=reason)

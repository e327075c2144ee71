"""The interface of all sinks, their kinds, and several sinks as one."""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from functools import partial
from threading import current_thread, main_thread
from typing import TYPE_CHECKING

import msgspec
from msgspec.structs import replace

from thenar.drivers.errors import SettingError, ThenarError
from thenar.drivers.members import Members

from ..names import shortened
from ..published import HealthReport, JointAngles, LiveGrasp, OutputTrouble, Preshape
from ..writer_thread import WriterThread

if TYPE_CHECKING:
    from ..build import Build
    from ..live.recogniser import Moment

# What has waited for longer is not published as now.
LATE_US = 500_000
# More than come in that time.
_MOST_WAITING = 1024


class SinkError(ThenarError, OSError):
    """A sink cannot be opened: the name is taken, the folder or a package is missing. The message says which."""


class SinkReport(msgspec.Struct, frozen=True):
    """The state of a sink since it was opened.

    where     as given to `open_sink`
    readers   number of current readers; None if unknown
    sent      lines sent, counted once per reader
    lost      lines not sent: a reader was slow or gone, or the system refused
    error     the last error, or nothing
    gone      whether its only reader has gone for good
    """

    where: str
    readers: int | None
    sent: int
    lost: int
    error: str = ""
    gone: bool = False


class Sink(ABC):
    """An open sink: it takes the results of frames. To write your own, derive from this; only `publish` is required.

    None but the constructor raises: what cannot be sent is lost, and counted. In a live run all but the constructor and
    `report` run on a thread that serves this sink alone.

    Attributes
    ----------
    pace : PublishPace or None
        When it gets a result; None: it gets every frame's. `open_sink` sets it.
    where, sent, lost, error, gone
        Its part of a `SinkReport`.
    """

    pace: "PublishPace | None" = None
    where = error = ""
    sent = lost = 0
    gone = False

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

    def attempt(self, send: Callable[[], object]) -> None:
        """Call `send`, and count what it sends; as lost if it raises."""
        try:
            send()
            self.sent += 1
        except Exception as reason:  # packages raise many kinds for what cannot be sent
            self.lost += 1
            self.error = getattr(reason, "strerror", None) or str(reason)

    def report(self) -> SinkReport:
        """Return the state of the sink itself."""
        where = self.where or type(self).__name__
        return SinkReport(where, self.readers(), self.sent, self.lost, self.error, self.gone)

    def readers(self) -> int | None:
        """Return the number of current readers; None if unknown."""
        return None

    def close(self) -> None:  # noqa: B027
        """Release everything; may be called twice."""


class SinkPlace(msgspec.Struct, frozen=True):
    """The place where a sink is to be opened.

    text     as the user wrote it: "ros:/thenar?public&rate=50"
    place    what follows the name: "/thenar"
    options  the given options of the kind: {"public"}
    wait     whether to wait for a slow reader rather than lose lines: right for a replay, wrong for a live glove
    """

    text: str
    place: str
    options: frozenset[str] = frozenset()
    wait: bool = False


class SinkKind(msgspec.Struct, frozen=True):
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
        Words that may follow the place after a question mark, separated by &, in addition to those of all kinds:
        "public".
    rate : int, optional
        How often a live grasp is sent that does not change, in times a second; None: every one is sent.
    rank : int
        Orders the kinds.
    """

    name: str
    place: str
    help: str
    open: Callable[[SinkPlace], Sink]
    options: tuple[str, ...] = ()
    rate: int | None = None
    rank: int = 0

    @property
    def spelling(self) -> str:
        """Its form in `--sink`: "ros:/NAMESPACE[?public]"."""
        return f"{self.name}:{self.place}" + "".join(f"[?{option}]" for option in self.options)


SINKS = Members("sink", SinkKind, "thenar.runtime.sinks", "thenar.sinks")


# Options of all kinds. With a rate, a grasp is sent when it changes, and HZ times a second while it does not.
PACES = "?every, ?rate=HZ or ?on=change"
_FASTEST_HZ = 1000


def open_sink(where: str, *, wait: bool = False) -> Sink:
    """Return the sink that `where` names: NAME:PLACE, spelled as in the kinds of `SINKS`, with their options and PACES.

    With `wait`, it waits for a slow reader rather than lose lines, and gets every grasp unless a pace is given. Raises
    SettingError for an invalid name, SinkError for one that cannot be opened.
    """
    name, _, place = where.partition(":")
    if not place or name not in SINKS:
        kinds = ", ".join(kind.spelling for kind in SINKS.values())
        wrong = f"there is no kind of sink called {shortened(name)!r}" if place else "names no sink"
        raise SettingError(f"{shortened(repr(where))}: {wrong}: use one of {kinds}")
    kind = SINKS[name]
    place, mark, text = place.partition("?")
    options = set(text.split("&")) if mark else set[str]()
    paces = {option for option in options if option in ("every", "on=change") or option.startswith("rate=")}
    if len(paces) > 1 or not options - paces <= set(kind.options):
        known = ", ".join(f"?{option}" for option in kind.options)
        raise SettingError(
            f"{shortened(repr(where))}: after the question mark only {known}{' and ' * bool(known)}one of {PACES} can "
            "follow, separated by &"
        )
    usual = None if wait or kind.rate is None else PublishPace(kind.rate)
    pace = _pace(where, *paces) if paces else usual
    sink = kind.open(SinkPlace(where, place, frozenset(options - paces), wait))
    sink.pace = pace
    return sink


def _pace(where: str, option: str) -> "PublishPace | None":
    """Return the pace of an option; None: every grasp is sent."""
    if option == "every":
        return None
    if option == "on=change":
        return PublishPace(0)
    rate = option.removeprefix("rate=")
    if not re.fullmatch("[0-9]{1,9}", rate) or not 1 <= int(rate) <= _FASTEST_HZ:
        raise SettingError(
            f"{where}: a rate of {shortened(repr(rate))} is not possible: use 1 to {_FASTEST_HZ} a second"
        )
    return PublishPace(int(rate))


class PublishPace:
    """When a grasp is to be published: when what is shown of it changes, and `rate` times a second; 0: only then."""

    def __init__(self, rate: int) -> None:
        self._period_us, self._last_us = 1_000_000 // rate if rate else None, 0
        self._shown: tuple[object, ...] = ()

    def due(self, time_us: int, shown: tuple[object, ...]) -> bool:
        """Return whether a grasp of this time that shows this is to be published."""
        first, changed, self._shown = not self._shown, shown != self._shown, shown
        # The recording of several sessions may go back in time.
        due = self._period_us is not None and (first or not 0 <= time_us - self._last_us < self._period_us)
        self._last_us = time_us if due else self._last_us
        return due or changed


class _Receiver:
    """A sink, the reason if it is left out, and, if it must not delay its caller, the thread on which it works."""

    def __init__(self, sink: Sink, *, live: bool) -> None:
        name = f"{type(sink).__module__}.{type(sink).__qualname__}"
        self.sink, self._fault, self._lost = sink, "", 0
        self._thread = WriterThread(name, _MOST_WAITING) if live else None
        self._nothing = SinkReport(name, None, 0, 0)

    @property
    def fault_message(self) -> str:
        """Why it takes nothing now; "" if it does."""
        hangs = self._thread is not None and self._thread.hangs
        return self._fault or ("does not respond: what comes meanwhile is lost" if hangs else "")

    @property
    def report(self) -> SinkReport:
        """The sink's report, with what it never took: one that hangs loses, which is no error."""
        made = [self._nothing]
        if not self._fault:
            self._carried_out(lambda sink: made.append(sink.report()))
        said = made[-1]
        lost = said.lost + self._lost + (0 if self._thread is None else self._thread.dropped)
        return replace(said, lost=lost, error=self._fault or said.error)

    def send(self, send: Callable[[Sink], None], longest_us: int | None) -> None:
        if self._thread is None:
            self._try(send)
        else:
            self._thread.put(partial(self._try, send), longest_us)

    def close(self) -> None:
        """Close the sink, also if it is left out; one that hangs is left to its thread."""
        if self._thread is None:
            self._carried_out(lambda sink: sink.close())
        else:
            self._thread.close(lambda: self._carried_out(lambda sink: sink.close()))

    def _try(self, send: Callable[[Sink], None]) -> None:
        if self._fault or not self._carried_out(send):
            self._lost += 1

    def _carried_out(self, call: Callable[[Sink], None]) -> bool:
        """Return whether the sink did its part; one that raises is left out from then on."""
        try:
            call(self.sink)
        except BaseException as reason:
            if isinstance(reason, KeyboardInterrupt) and current_thread() is main_thread():  # the user's Ctrl-C
                raise
            self._fault = f"{type(reason).__name__}: {reason}"
            from logging import getLogger  # for bugs only

            getLogger("thenar").error("sink %s: a bug in the program", self._nothing.where, exc_info=reason)
            return False
        return True


class Fanout:
    """Publishes to every one of `sinks`. One that raises, against its contract, is left out from then on: its report
    says why, and the log has the trace.

    If `live`, each sink works on a separate thread: one that waits delays neither the caller nor the others, and loses
    what has waited for half a second, so that nothing old is published.
    """

    def __init__(self, sinks: Iterable[Sink], *, live: bool = False) -> None:
        self._receivers = tuple(_Receiver(sink, live=live) for sink in sinks)

    def begin(self, build: "Build") -> None:
        """Pass the build to all sinks."""
        self._all(lambda sink: sink.begin(build))

    def publish(
        self,
        grasp: LiveGrasp,
        preshape: Preshape | None,
        angles: JointAngles | None,
        moment: "Moment | None" = None,
    ) -> None:
        """Publish to all sinks that work, as far as their paces make it due, with the moment behind the grasp."""

        def send(sink: Sink) -> None:
            sink.publish(grasp, preshape, angles)
            if moment is not None:
                sink.moment(moment)

        health = "ok" if grasp.health == "changing" else grasp.health
        shown = (grasp.grasp, health, grasp.state, grasp.segment, grasp.segment_type, preshape)
        for receiver in self._receivers:
            pace = receiver.sink.pace
            if pace is None or pace.due(grasp.time_us, shown):
                receiver.send(send, LATE_US)

    def health(self, report: HealthReport) -> None:
        """Send the glove's health to all sinks that work."""
        self._all(lambda sink: sink.health(report), LATE_US)

    def troubles(self) -> tuple[OutputTrouble, ...]:
        """Return the sinks that take nothing now, and why."""
        return tuple(
            OutputTrouble(each.report.where, each.fault_message) for each in self._receivers if each.fault_message
        )

    def reports(self) -> tuple[SinkReport, ...]:
        """Return the states of all sinks, in order."""
        return tuple(receiver.report for receiver in self._receivers)

    def close(self) -> None:
        """Close all sinks, also after one of them fails to."""
        for receiver in self._receivers:
            receiver.close()

    def _all(self, send: Callable[[Sink], None], longest_us: int | None = None) -> None:
        for receiver in self._receivers:
            receiver.send(send, longest_us)

"""Several sinks as one, with a fence round each: a sink of the user's own may break its promise not to raise."""

from collections.abc import Callable, Iterable

from ..live.health import HealthReport
from ..live.published import LiveGrasp
from ..preshape.preshape import Preshape
from .angles import JointAngles
from .sink import Sink, SinkReport


class Fanout:
    """Publishes to every one of `sinks`. One that raises is left out from then on, and its report says why."""

    __slots__ = ("_fenced",)

    def __init__(self, sinks: Iterable[Sink]) -> None:
        self._fenced = [_Fenced(sink) for sink in sinks]

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        """Publish to all sinks that work."""
        for fenced in self._fenced:
            fenced.publish(grasp, preshape, angles)

    def health(self, report: HealthReport) -> None:
        """Send on to all sinks that work how the glove fares."""
        for fenced in self._fenced:
            fenced.health(report)

    def reports(self) -> tuple[SinkReport, ...]:
        """Return how every sink is doing, in their order."""
        return tuple(fenced.report() for fenced in self._fenced)

    def close(self) -> None:
        """Close all sinks, also after one of them fails to."""
        for fenced in self._fenced:
            fenced.close()


class _Fenced:
    __slots__ = ("_error", "_lost", "_sink")

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self._error = ""
        self._lost = 0

    def publish(self, grasp: LiveGrasp, preshape: Preshape | None, angles: JointAngles | None) -> None:
        self._try(lambda: self._sink.publish(grasp, preshape, angles))

    def health(self, report: HealthReport) -> None:
        self._try(lambda: self._sink.health(report))

    def _try(self, send: Callable[[], None]) -> None:
        if self._error:
            self._lost += 1
            return
        try:
            send()
        except Exception as reason:
            self._fail(reason)
            self._lost += 1

    def report(self) -> SinkReport:
        if not self._error:
            try:
                return self._sink.report()
            except Exception as reason:
                self._fail(reason)
        return SinkReport(type(self._sink).__name__, None, 0, self._lost, self._error, over=True)

    def close(self) -> None:
        try:
            self._sink.close()
        except Exception as reason:
            self._fail(reason)

    def _fail(self, reason: Exception) -> None:
        self._error = f"{type(reason).__name__}: {reason}"

"""What is told of every moment of a live run: to the sinks, to the view, and on stderr."""

from contextlib import suppress
from threading import Event

from thenar.runtime.live.frames import GloveFrame, now_us
from thenar.runtime.live.health import Health, HealthReport
from thenar.runtime.live.keeper import NOT_YET
from thenar.runtime.live.loop import Moment
from thenar.runtime.live.newest import Newest
from thenar.runtime.live.sources import Sources
from thenar.runtime.live.system import System
from thenar.runtime.preshape.selector import PreshapeSelector
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.sinks.angles import AngleReader
from thenar.runtime.sinks.fanout import Fanout

from .common import of_device
from .lines import echo
from .live_view import LiveView, health_lines

_REPORT_US = 1_000_000


class Teller:
    """Tells every moment of the loop to the sinks and the view, and once a second how the glove fares."""

    def __init__(
        self,
        system: System,
        fanout: Fanout,
        sources: Sources,
        view: LiveView | None,
        stop: Event,
        selector: PreshapeSelector | None,
        angles: AngleReader | None,
        recorder: Recorder | None,
        *,
        status: bool,
    ) -> None:
        self._fanout, self._sources, self._view, self._stop = fanout, sources, view, stop
        self._selector, self._angles, self._recorder, self._status = selector, angles, recorder, status
        self._said: dict[str, str] = {}
        self._glove = Newest[GloveFrame](sources.glove_period_us)
        self._health = Health(system.build)
        self._report: HealthReport | None = None
        self._lines: tuple[str, ...] = ()

    def tell(self, moment: Moment) -> None:
        """Publish one moment; end the run where a device can never work as it is told to."""
        grasp, glove = moment.grasp, moment.glove
        preshape = None if self._selector is None else self._selector.update(grasp)
        self._glove.take(glove, grasp.time_us)
        fresh = self._glove.fresh(grasp.time_us)
        angles = self._angles.angles(fresh.sensors) if self._angles and fresh and fresh.plugged else None
        self._fanout.publish(grasp, preshape, angles)
        self._health.update(grasp, moment.switches, glove.time_us if glove else None, moment.codes)
        if self._report is None or grasp.time_us - self._report.time_us >= _REPORT_US:
            self._look()
        if self._view is not None:
            self._view.show(grasp, self._sources.health, self._lines)

    def _look(self) -> None:
        self._report = self._health.report(now_us(), self._sources.health(), self._sources.overflowed)
        if self._status:
            self._fanout.health(self._report)
            self._lines = health_lines(self._report)
        if self._view is None:
            self._say_news(self._report)
        if self._sources.failed or self._nobody_is_told():
            self._stop.set()

    def _say_news(self, report: HealthReport) -> None:
        """Say on stderr what has become of devices and recording, once each time that it changes."""
        news = {device.name: device.error or "connected" for device in report.devices}
        if self._recorder is not None and self._recorder.failure:
            news["recording"] = self._recorder.failure
        for name, state in news.items():
            if self._said.get(name) != state and state != NOT_YET:
                say(of_device(name, state))
                self._said[name] = state

    def _nobody_is_told(self) -> bool:
        """Return whether every reader went away for good (`| head`), and nothing is recorded or looked at either."""
        told = self._fanout.reports()
        return bool(told) and self._view is None and self._recorder is None and all(report.over for report in told)


def say(line: str) -> None:
    """Say it on stderr, where that is still there: a terminal that was closed is told nothing."""
    with suppress(OSError):
        echo(line, err=True)

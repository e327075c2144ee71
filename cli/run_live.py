"""`thenar run --glove`: the live loop with its sinks, its view, its recording, and the signals that end it."""

import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from threading import Event
from types import FrameType

import click

from ..runtime.harness.writing import harness_to_toml
from ..runtime.live.frames import now_us
from ..runtime.live.health import Health, HealthReport
from ..runtime.live.loop import LiveLoop, Moment
from ..runtime.live.sources import Sources
from ..runtime.live.system import System
from ..runtime.preshape.loading import load_preshapes
from ..runtime.preshape.selector import PreshapeSelector
from ..runtime.recording.session import Session
from ..runtime.recording.writer import Recorder
from ..runtime.sinks.angles import AngleReader
from ..runtime.sinks.fanout import Fanout
from ..runtime.sinks.opening import open_sink
from ..runtime.sinks.sink import Sink
from .common import err, out
from .live_view import LiveView, health_lines

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_REPORT_US = 1_000_000


@dataclass(frozen=True, slots=True)
class LiveOptions:
    """What `thenar run --glove` was asked for; `frames` None: until a signal comes."""

    sinks: tuple[str, ...]
    preshape: str | None
    record: Path | None
    full_scan: bool
    status: bool
    frames: int | None


def run_live(system: System, options: LiveOptions) -> None:
    """Run until a signal comes, or so many frames are published."""
    viewed = sys.stdout.isatty() and not options.sinks
    with ExitStack() as stack:
        stop = stack.enter_context(ended_by_signals())
        sinks = [_opened(name, stack) for name in options.sinks or (() if viewed else ("jsonl:-",))]
        fanout = Fanout(sinks)
        recorder = stack.enter_context(_recorder(system, options.record)) if options.record else None
        sources = stack.enter_context(system.sources(full_scan=options.full_scan))
        view = stack.enter_context(LiveView(out())) if viewed else None
        teller = Teller(system, options, fanout, sources, view, stop)
        loop = LiveLoop(sources, system.recognizer(), teller.tell, recorder)
        loop.run(stop, options.frames)
    sources.raise_settings()
    _say_what_came_of_it(loop.frames, fanout, recorder)


@contextmanager
def ended_by_signals() -> Iterator[Event]:
    """Yield an event that SIGINT, SIGTERM and SIGHUP set; a second SIGINT interrupts as usual."""
    stop = Event()

    def end(number: int, _frame: FrameType | None) -> None:
        stop.set()
        signal.signal(number, before[signal.Signals(number)])

    before = {number: signal.signal(number, end) for number in _ENDING}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class Teller:
    """Tells every moment of the loop to the sinks and the view, and once a second how the glove fares."""

    def __init__(
        self,
        system: System,
        options: LiveOptions,
        fanout: Fanout,
        sources: Sources,
        view: LiveView | None,
        stop: Event,
    ) -> None:
        self._fanout, self._sources, self._view, self._stop = fanout, sources, view, stop
        self._status = options.status
        self._selector = None if options.preshape is None else _selector(system, options.preshape)
        self._angles = None if system.calibration is None else AngleReader(system.sensor_names, system.calibration)
        self._health = Health(system.build)
        self._report: HealthReport | None = None

    def tell(self, moment: Moment) -> None:
        """Publish one moment; end the run where a device can never work as it is told to."""
        grasp, glove = moment.grasp, moment.glove
        preshape = None if self._selector is None else self._selector.update(grasp)
        fresh = glove is not None and moment.codes is not None
        angles = self._angles.angles(glove.sensors) if self._angles and glove and fresh else None
        self._fanout.publish(grasp, preshape, angles)
        self._health.update(grasp, moment.switches, glove.time_us if glove else None, moment.codes)
        if self._report is None or grasp.time_us - self._report.time_us >= _REPORT_US:
            self._look()
        if self._view is not None:
            self._view.show(grasp, self._sources.health, health_lines(self._report) if self._status else ())

    def _look(self) -> None:
        self._report = self._health.report(now_us(), self._sources.health())
        if self._status:
            self._fanout.health(self._report)
        # A reader of our only output that went away (`| head`) wants no more.
        told = self._fanout.reports()
        nobody = bool(told) and self._view is None and all(report.error for report in told)
        if self._sources.failed or nobody:
            self._stop.set()


def _opened(name: str, stack: ExitStack) -> Sink:
    sink = open_sink(name)
    stack.callback(sink.close)
    return sink


def _selector(system: System, name: str) -> PreshapeSelector:
    table = load_preshapes(name)
    if lacking := table.check(system.build.grasps):
        err().print(f"thenar: {lacking}")
    return PreshapeSelector(table)


def _recorder(system: System, path: Path) -> Recorder:
    session = Session(
        thenar=version("thenar"),
        switches=system.switch_names,
        sensors=system.sensor_names,
        build=system.build.manifest.checksum,
        harness=harness_to_toml(system.harness),
        calibration=system.calibration,
        policy=system.policy,
    )
    return Recorder(path, session)


def _say_what_came_of_it(frames: int, fanout: Fanout, recorder: Recorder | None) -> None:
    click.echo(f"{frames} frames", err=True)
    for report in fanout.reports():
        if report.lost or report.error:
            why = f": {report.error}" if report.error else ""
            click.echo(f"{report.where}: {report.sent} frames sent, {report.lost} lost{why}", err=True)
    if recorder is not None:
        failed = f"; {recorder.failure}" if recorder.failure else ""
        click.echo(f"{recorder.path}: {recorder.messages} messages{failed}", err=True)

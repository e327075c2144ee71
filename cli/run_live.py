"""`thenar run --glove`: the live loop with its sinks, its view, and its recording."""

import errno
import os
import sys
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import click

from thenar.runtime.harness.writing import harness_to_toml
from thenar.runtime.live.loop import LiveLoop
from thenar.runtime.live.system import System
from thenar.runtime.preshape.loading import load_preshapes
from thenar.runtime.preshape.selector import PreshapeSelector
from thenar.runtime.recording.session import Session
from thenar.runtime.recording.writer import Recorder
from thenar.runtime.sinks.angles import AngleReader
from thenar.runtime.sinks.fanout import Fanout
from thenar.runtime.sinks.opening import open_sink
from thenar.runtime.sinks.sink import Sink

from .common import err, out
from .ending import ended_by_signals
from .live_view import LiveView
from .teller import Teller, say


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
    if sys.stdout is None and not options.sinks:
        raise click.UsageError("stdout is closed: name a --sink to send grasps to")
    viewed = sys.stdout is not None and sys.stdout.isatty() and "jsonl:-" not in options.sinks
    with ExitStack() as stack:
        stop = stack.enter_context(ended_by_signals())
        # Whatever can be wrong with what was asked for is, before a device is opened and a file is made.
        recognizer, sources = system.recognizer(), system.sources(full_scan=options.full_scan)
        selector = None if options.preshape is None else _selector(system, options.preshape)
        angles = None if system.calibration is None else AngleReader(system.sensor_names, system.calibration)
        sinks = [_opened(name, stack) for name in options.sinks or (() if viewed else ("jsonl:-",))]
        fanout = Fanout(sinks)
        recorder = stack.enter_context(_recorder(system, options.record)) if options.record else None
        stack.enter_context(sources)
        view = stack.enter_context(LiveView(out())) if viewed else None
        teller = Teller(system, fanout, sources, view, stop, selector, angles, recorder, status=options.status)
        loop = LiveLoop(sources, recognizer, teller.tell, recorder)
        loop.run(stop, options.frames)
    sources.raise_settings()
    _say_what_came_of_it(loop.frames, fanout, recorder)
    if _spoilt(fanout, recorder):
        click.get_current_context().exit(1)


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
    say(f"{frames} frame{'s' * (frames != 1)}")
    for report in fanout.reports():
        if report.lost or report.error:
            why = f": {report.error}" if report.error else ""
            dropped = f", {report.dropped} readers dropped" if report.dropped else ""
            say(f"{report.where}: {report.sent} frames sent, {report.lost} lost{dropped}{why}")
    if recorder is not None:
        failed = f"; {recorder.failure}" if recorder.failure else ""
        say(f"{recorder.path}: {recorder.messages} messages{failed}")


def _spoilt(fanout: Fanout, recorder: Recorder | None) -> bool:
    """Return whether something that was asked for did not come about, by more than a reader's leaving."""
    gone = os.strerror(errno.EPIPE)
    return bool(recorder and recorder.failure) or any(one.over and one.error != gone for one in fanout.reports())

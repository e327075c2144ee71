"""`thenar run`: recognise grasps live on a glove, or in recorded frames."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from functools import partial
from io import UnsupportedOperation
from itertools import islice
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, TextIO

import click

from thenar.runtime.names import of_device

from .consoles import Live, Printed, Text, bar, grid
from .options import LazyOption
from .parameters import Number, OutputFile, existing_file, existing_folder, overwrite_flag, refuse, web_options
from .printing import out, say
from .replaying import replay_recording, replay_set, say_what_was_lost, selecting, spoilt

if TYPE_CHECKING:
    from thenar.runtime import Build, Glove
    from thenar.runtime.policy import Policy
    from thenar.runtime.published import DeviceHealth, HealthReport, LiveGrasp, OutputTrouble, Quarantined
    from thenar.runtime.web.live import LivePage
    from thenar.runtime.web.server import Server


# A drawing of the live view that waited for longer is not shown.
_VIEW_US = 500_000
# Lines, or drawings of the live view, that wait for a slow reader.
_MOST_WAITING = 1024
_REDRAW_S = 0.1
_STYLES = {"ok": "bold green", "changing": "bold cyan", "degraded": "bold yellow", "unknown": "bold red"}
_SHOWN = 6


def _sinks_help() -> str:
    from thenar.runtime.sinks import SINKS
    from thenar.runtime.sinks.base import PACES

    kinds = "; ".join(f"{kind.spelling}, {kind.help}" for kind in SINKS.values())
    return (
        f"Where grasps are sent: {kinds}. {PACES} sends every frame, on change and HZ times a second, or on change "
        "alone. Repeatable."
    )


@click.command("run")
@click.argument("build", metavar="BUILD", type=existing_folder)
@click.option("--glove", metavar="glove.toml", type=existing_file, help="The harness of the glove to run on.")
@click.option(
    "--replay", metavar="FILE", type=existing_file, help="Recorded frames: a .grasps set, or the .mcap of a live run."
)
@click.option("--sink", "sinks", metavar="SINK", multiple=True, cls=LazyOption, describe=_sinks_help)
@click.option(
    "--preshape", metavar="NAME", help="Preshapes to send with grasps: barrett_bh8, parallel_gripper or a .toml file."
)
@click.option(
    "--record", metavar="FILE.mcap", type=OutputFile(".mcap"), help="Record the raw frames and the predictions."
)
@overwrite_flag
@web_options
@click.option("--status", is_flag=True, help="Report the glove's health to all sinks, once a second.")
@click.option("--frames", metavar="N", type=click.IntRange(1), help="Stop after N frames.")
@click.option("--lead", type=Number(0), help="Lead in score units that a new grasp type needs.")
@click.option("--dwell-ms", type=Number(0, 10_000), help="Time for which a new grasp type must keep the lead.")
@click.option("--max-lost", type=Number(0, 1), help="Share of the build's weight that may be missing.")
@click.option("--no-quarantine", is_flag=True, help="Use switches even if they are stuck or chatter.")
@click.option(
    "--lag-ms", type=Number(0, 10_000), help="Time after which the state of a segment is final.  [default: 150]"
)
def command(
    build: Path,
    glove: Path | None,
    replay: Path | None,
    sinks: tuple[str, ...],
    preshape: str | None,
    record: Path | None,
    web: str | None,
    web_token: str | None,
    status: bool,
    frames: int | None,
    **deciding: Any,
) -> None:
    """Recognise grasps: live on the glove that --glove describes, or in the recorded frames of --replay.

    Live, a terminal shows the grasp and its confidence; a pipe or a file gets JSON lines, on change and ten times a
    second. A replay gives one line per frame. Devices may be disconnected and connected again: missing inputs make the
    state "degraded", or "unknown" if too few are left.
    SIGINT, SIGTERM and SIGHUP end a run cleanly, with exit code 0.

    \b
    Example:
        thenar run build/ --glove glove.toml --status
        thenar run build/ --glove glove.toml --sink tcp:7777 --preshape barrett_bh8 --record run.mcap
        thenar run build/ --glove glove.toml --web
        thenar run build/ --replay run.mcap | head -3
        thenar run build/ --replay set.grasps --sink jsonl:grasps.jsonl --preshape parallel_gripper
    """
    if (glove is None) == (replay is None):
        raise click.UsageError("name either a glove to run on (--glove) or recorded frames (--replay)")
    from thenar.runtime import Build

    _refuse_idle(replay)
    loaded = Build.load(build)
    policy = _policy(deciding)
    if replay is None:
        if sys.stdout is None and not sinks:
            raise click.UsageError("stdout is closed: name a --sink to send grasps to")
        viewed = sys.stdout is not None and sys.stdout.isatty() and "jsonl:-" not in sinks
        asked: dict[str, Any] = {"preshapes": preshape, "record": record, "status": status}
        asked |= {"sinks": sinks or (() if viewed else ("jsonl:-",)), "policy": policy}
        server = None
        if web is not None:
            from thenar.runtime.web.server import Server

            server = Server("live", web, token=web_token)
        _run_live(loaded, glove, viewed, server, build, frames, **asked)
    elif replay.suffix == ".mcap":
        selector = selecting(loaded, preshape, segments=True)
        replay_recording(loaded, replay, sinks, selector, frames, policy)
    else:
        replay_set(loaded, replay, sinks, selecting(loaded, preshape, segments=False), frames)


_LIVE = ("record", "web", "web_token", "status")
_POLICY = ("lead", "dwell_ms", "max_lost", "no_quarantine", "lag_ms")


def _refuse_idle(replay: Path | None) -> None:
    """Raise UsageError for an option that would have no effect."""
    if click.get_current_context().params["web"] is None:
        refuse("without --web", "web_token")
    if replay is not None and replay.suffix == ".mcap":
        refuse("for a recording", *_LIVE)
    elif replay is not None:
        alone = "for a set of grasps, each row of which is classified alone"
        refuse(alone, *_LIVE, *_POLICY)


def _policy(asked: dict[str, Any]) -> "Policy | None":
    """Return the usual policy with the given values in it, or None if there are none."""
    from msgspec.structs import replace

    from thenar.runtime.policy import Policy

    given: dict[str, Any] = {"quarantine": False} if asked.pop("no_quarantine") else {}
    for name, value in asked.items():
        if value is not None:
            milliseconds = name.endswith("_ms")
            given[name.replace("_ms", "_us")] = round(1000 * value) if milliseconds else value
    usual = Policy()
    return replace(usual, **{"hold_us": max(usual.hold_us, given.get("dwell_us", 0)), **given}) if given else None


def _run_live(
    build: "Build",
    harness: Path | None,
    viewed: bool,
    server: "Server | None",
    folder: Path,
    frames: int | None,
    *,
    status: bool,
    **asked: Any,
) -> None:
    """Run until a signal arrives, or the given number of frames is published."""
    from thenar.runtime import Glove

    from . import ended_by_signals

    with _unblocked("stderr"), _unblocked("stdout", _VIEW_US) if viewed else nullcontext():
        with ExitStack() as stack:
            stop = stack.enter_context(ended_by_signals())
            if server is not None:
                stack.enter_context(server)
            glove = Glove(build, str(harness), stop=stop, status=status, **asked)
            for lacking in filter(None, (glove.system.unread, glove.lacking)):
                say(f"thenar: {lacking}")
            page = None
            if server is not None:
                from thenar.runtime.web.live import LivePage, shell_message

                server.publish("shell", shell_message(glove.system.harness.name, folder, build.manifest))
                page = LivePage(server, glove, folder)
                say(f"thenar: the page is at {server.url}")
            stack.enter_context(glove)
            view = stack.enter_context(LiveView(out())) if viewed else None
            recorder = glove.recorder
            _look_on(glove, view, page, frames)
        reports = glove.reports()
        say(f"{glove.frames} frame{'s' * (glove.frames != 1)}")
        say_what_was_lost(reports)
        incomplete = ""
        if recorder is not None:
            incomplete = "; ".join(filter(None, (recorder.lost, recorder.failure)))
            say("; ".join(filter(None, (f"{recorder.path}: {recorder.messages} messages", incomplete))))
    if incomplete or spoilt(reports):
        click.get_current_context().exit(1)


def _look_on(glove: "Glove", view: "LiveView | None", page: "LivePage | None", frames: int | None) -> None:
    """Let the glove run, and check its health once a second."""
    from . import notify

    said, health = dict[str, str](), None
    notify(b"READY=1")
    for moment in islice(glove, frames):
        if page is not None:
            page.show(moment)
        if glove.health is not health and glove.health is not None:
            health = glove.health
            if health.switch_hz or health.glove_hz:
                notify(b"WATCHDOG=1")
            if view is None:
                _say_news(glove, health, said)
                gone = [report.gone for report in glove.reports()]
                if glove.recorder is None and page is None and gone and all(gone):  # by `| head`
                    return
        if view is not None:
            view.show(moment.grasp, glove.devices, health)


def _say_news(glove: "Glove", health: "HealthReport", said: dict[str, str]) -> None:
    """Print the state of devices, outputs and quarantined inputs on stderr whenever it changes."""
    from thenar.runtime.live.sources import NOT_YET

    news = {device.name: device.error or "connected" for device in health.devices}
    news |= {output.name: output.what for output in health.outputs}
    news |= {wrong.name: wrong.what for wrong in health.quarantined}
    # Devices are always reported.
    news |= {name: "works again" for name in said if name not in news}
    for name, state in news.items():
        if said.get(name) != state and state != NOT_YET:
            say(of_device(name, state))
            said[name] = state


class LiveView(Live):
    """Draws the newest grasp ten times a second, in place, on a console whose stream keeps nobody waiting."""

    _due_s = 0.0

    def show(
        self, grasp: "LiveGrasp", devices: "Callable[[], Sequence[DeviceHealth]]", health: "HealthReport | None" = None
    ) -> None:
        """Draw this if it is time; the devices are queried then."""
        if monotonic() < self._due_s:
            return
        self._due_s = monotonic() + _REDRAW_S
        wrong: tuple[Quarantined | OutputTrouble, ...] = ()
        if health is not None:
            wrong = (*health.quarantined, *health.outputs)
        self.update(drawn(grasp, devices(), wrong))


def drawn(
    grasp: "LiveGrasp",
    devices: "Sequence[DeviceHealth]",
    wrong: "Sequence[Quarantined | OutputTrouble]" = (),
) -> Printed:
    """Return the view of one moment."""
    table = grid(2)
    table.add_row("grasp", Text(grasp.grasp, _STYLES[grasp.health]))
    table.add_row("", f"{bar(grasp.probability)} {grasp.probability:5.1%}")
    table.add_row("this frame", f"{grasp.candidate}, ahead by {grasp.margin} steps")
    table.add_row("segment", _segment(grasp))
    table.add_row("health", Text(grasp.health, _STYLES[grasp.health]))
    if grasp.lost:
        more = f" and {len(grasp.lost) - _SHOWN} more" if len(grasp.lost) > _SHOWN else ""
        table.add_row("missing", ", ".join(grasp.lost[:_SHOWN]) + more)
    for one in wrong:
        table.add_row(one.name, Text(one.what, "yellow"))
    table.add_row("age", f"switches {_ms(grasp.switch_age_us)}, glove {_ms(grasp.glove_age_us)}")
    table.add_row("frame", str(grasp.number))
    for device in devices:
        table.add_row(device.name, Text(device.error, "red") if device.error else "connected")
    return table


def _segment(grasp: "LiveGrasp") -> str:
    """Return "3, PMF: held, 1.2 s"."""
    if grasp.segment_us is None:
        return f"none, {grasp.segment} so far"
    return f"{grasp.segment}, {grasp.segment_type}: {grasp.state}, {(grasp.time_us - grasp.segment_us) / 1e6:.1f} s"


def _ms(age_us: int | None) -> str:
    return "none yet" if age_us is None else f"{age_us / 1000:.1f} ms"


class _UnblockedStream:
    """Writes to the descriptor of a stream on a separate thread; what its reader does not take in time is lost.

    It writes past the stream, whose lock a hanging write would hold when the program ends.
    """

    def __init__(self, stream: TextIO, longest_us: int | None) -> None:
        from thenar.runtime.writer_thread import WriterThread

        self._stream, self._file, self._longest_us = stream, stream.fileno(), longest_us
        self.thread = WriterThread("notices", _MOST_WAITING)

    def write(self, text: str) -> int:
        data = text.encode(self._stream.encoding, self._stream.errors or "strict")
        self.thread.put(partial(_write_all, self._file, data), self._longest_us)
        return len(text)

    def flush(self) -> None:
        """Do nothing: the thread writes at once."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _write_all(file: int, data: bytes) -> None:
    with suppress(OSError):  # nobody can read it: the terminal was closed, or the disk is full
        while data:
            data = data[os.write(file, data) :]


@contextmanager
def _unblocked(name: str, longest_us: int | None = None) -> Iterator[None]:
    """Let nothing that is printed on sys.`name` wait for its reader; what waits for more than `longest_us` is lost.

    If the reader hangs at the end, the stream stays so: the rest of the program can end.
    """
    stream = getattr(sys, name)
    try:
        ours = _UnblockedStream(stream, longest_us)
    except (AttributeError, UnsupportedOperation):  # closed, or held in memory
        yield
        return
    stream.flush()
    setattr(sys, name, ours)
    try:
        yield
    finally:
        if ours.thread.close():
            setattr(sys, name, stream)

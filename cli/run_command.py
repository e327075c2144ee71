"""`thenar run`: the runtime's recogniser, live on a glove or on recorded frames."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from .common import existing_file, existing_folder, output_file

if TYPE_CHECKING:
    from thenar.runtime.live.policy import Policy


@click.command("run")
@click.argument("build", metavar="BUILD", type=existing_folder)
@click.option("--glove", metavar="glove.toml", type=existing_file, help="The harness of the glove to run on.")
@click.option(
    "--replay", metavar="FILE", type=existing_file, help="Recorded frames: a .grasps set, or the .mcap of a live run."
)
@click.option(
    "--period-us",
    type=click.IntRange(1),
    default=10_000,
    show_default=True,
    help="Time from one row of a .grasps set to the next.",
)
@click.option(
    "--sink",
    "sinks",
    metavar="SINK",
    multiple=True,
    help="Where grasps go: jsonl:FILE (- is stdout), unix:PATH, tcp:127.0.0.1:PORT, ros:/NAMESPACE, on this machine; "
    "tcp-public:ADDRESS:PORT and ros:/NAMESPACE?public let others read. May be repeated.",
)
@click.option(
    "--preshape", metavar="NAME", help="Preshapes to send along: barrett_bh8, parallel_gripper or a .toml file."
)
@click.option("--record", metavar="FILE.mcap", type=output_file, help="Record the raw frames, and what came of them.")
@click.option("--full-scan", is_flag=True, help="Read all ports in every scan, even when the rest cannot matter.")
@click.option("--status", is_flag=True, help="Once a second, how the glove fares: in the view, and to all sinks.")
@click.option("--frames", metavar="N", type=click.IntRange(1), help="Stop after so many frames.")
@click.option("--lead", type=click.FloatRange(0), help="By how much a new grasp type must lead, in score units.")
@click.option("--dwell-ms", type=click.FloatRange(0, 10_000), help="For how long it must lead.")
@click.option("--max-lost", type=click.FloatRange(0, 1), help="Share of the build's weight that may be missing.")
@click.option(
    "--error-rate", type=click.FloatRange(0, 1), help="Decide by a sequential test of this error rate instead."
)
@click.option(
    "--spacing-ms", type=click.FloatRange(0, 10_000), help="Frames that the sequential test takes are so far apart."
)
def command(
    build: Path,
    glove: Path | None,
    replay: Path | None,
    period_us: int,
    sinks: tuple[str, ...],
    preshape: str | None,
    record: Path | None,
    full_scan: bool,
    status: bool,
    frames: int | None,
    lead: float | None,
    dwell_ms: float | None,
    max_lost: float | None,
    error_rate: float | None,
    spacing_ms: float | None,
) -> None:
    """Recognise grasps: on the glove that --glove describes, or in the frames that --replay holds.

    Live, a terminal shows the grasp and how far to trust it; into a pipe or a file goes one JSON line a frame. Devices
    may come and go: what is missing makes the answer "degraded", and "unknown" when too little is left. SIGINT, SIGTERM
    and SIGHUP end a run cleanly, with exit code 0.

    \b
    Example:
        thenar run build/ --glove glove.toml --status
        thenar run build/ --glove glove.toml --sink unix:/run/grasps --preshape barrett_bh8 --record run.mcap
        thenar run build/ --replay run.mcap | head -3
        thenar run build/ --replay set.grasps
    """
    if (glove is None) == (replay is None):
        raise click.UsageError("name a glove to run on (--glove) or frames to run through (--replay), one of them")
    if record is not None and record.suffix != ".mcap":
        raise click.BadParameter(f"{record.name}: a recording ends in .mcap", param_hint="--record")
    from thenar.runtime.build import Build

    _refuse_idle(glove, replay)
    loaded = Build.load(build)
    if replay is not None and replay.suffix != ".mcap":
        from .run_replay import replay_set

        replay_set(loaded, replay, period_us)
        return
    policy = _policy(
        {
            "lead": lead,
            "dwell_us": _us(dwell_ms),
            "max_lost": max_lost,
            "error_rate": error_rate,
            "spacing_us": _us(spacing_ms),
        }
    )
    if replay is not None:
        from .run_replay import replay_recording

        replay_recording(loaded, replay, policy)
        return
    from thenar.runtime.harness.loading import load_harness
    from thenar.runtime.live.system import System

    from .run_live import LiveOptions, run_live

    system = System.of(loaded, load_harness(str(glove)), policy)
    run_live(system, LiveOptions(sinks, preshape, record, full_scan, status, frames))


_LIVE = ("sinks", "preshape", "record", "full_scan", "status", "frames")
_POLICY = ("lead", "dwell_ms", "max_lost", "error_rate", "spacing_ms")


def _refuse_idle(glove: Path | None, replay: Path | None) -> None:
    """Raise UsageError about an option that would change nothing here."""
    if glove is not None:
        _refuse("on a glove", "period_us")
    elif replay is not None and replay.suffix == ".mcap":
        _refuse("for a recording, which says when its frames came", "period_us", *_LIVE)
    else:
        _refuse("for a set of grasps, each row of which is recognised by itself", *_LIVE, *_POLICY)
    if click.get_current_context().params["error_rate"] is not None:
        _refuse("beside --error-rate, whose test decides by itself", "lead", "dwell_ms")
    else:
        _refuse("without --error-rate", "spacing_ms")


def _refuse(where: str, *names: str) -> None:
    context = click.get_current_context()
    for option in context.command.params:
        if option.name in names and context.get_parameter_source(option.name) is not ParameterSource.DEFAULT:
            raise click.UsageError(f"{option.opts[0]} changes nothing {where}: leave it out")


def _us(ms: float | None) -> int | None:
    return None if ms is None else round(1000 * ms)


def _policy(asked: dict[str, Any]) -> "Policy | None":
    """Return the usual policy with what was `asked` for in its place; None if nothing was."""
    from thenar.runtime.live.policy import Policy

    given = {name: value for name, value in asked.items() if value is not None}
    if not given:
        return None
    usual = Policy()
    return replace(usual, **{"hold_us": max(usual.hold_us, given.get("dwell_us", 0)), **given})

"""`thenar run`: the runtime's recogniser, live on a glove or on recorded frames."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from .common import existing_file, existing_folder, output_file

if TYPE_CHECKING:
    from ..runtime.live.policy import Policy


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
    help="Where grasps go: jsonl:FILE (- is stdout), unix:PATH, tcp:127.0.0.1:PORT, ros:/NAMESPACE. May be repeated.",
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
) -> None:
    """Recognise grasps: on the glove that --glove describes, or in the frames that --replay holds.

    Live, a terminal shows the grasp and how far to trust it; into a pipe or a file goes one JSON line a frame. Devices
    may come and go: what is missing makes the answer "degraded", and "unknown" when too little is left. SIGINT, SIGTERM
    and SIGHUP end a run cleanly, with exit code 0.

    \b
    Examples:
        thenar run build/ --glove glove.toml --status
        thenar run build/ --glove glove.toml --sink unix:/run/grasps --preshape barrett_bh8 --record run.mcap
        thenar run build/ --replay run.mcap | head -3
        thenar run build/ --replay set.grasps
    """
    if (glove is None) == (replay is None):
        raise click.UsageError("name a glove to run on (--glove) or frames to run through (--replay), one of them")
    from ..runtime.build import Build

    loaded = Build.load(build)
    if replay is not None and replay.suffix != ".mcap":
        from .run_replay import replay_set

        replay_set(loaded, replay, period_us)
        return
    asked = {"lead": lead, "dwell_ms": dwell_ms, "max_lost": max_lost, "error_rate": error_rate}
    policy = _policy(**asked) if any(value is not None for value in asked.values()) else None
    if replay is not None:
        from .run_replay import replay_recording

        replay_recording(loaded, replay, policy)
        return
    from ..runtime.harness.loading import load_harness
    from ..runtime.live.system import System
    from .run_live import LiveOptions, run_live

    system = System.of(loaded, load_harness(str(glove)), policy)
    run_live(system, LiveOptions(sinks, preshape, record, full_scan, status, frames))


def _policy(
    *, lead: float | None, dwell_ms: float | None, max_lost: float | None, error_rate: float | None
) -> "Policy":
    """Return the usual policy with what was asked for in its place."""
    from ..runtime.live.policy import Policy

    usual = Policy()
    dwell_us = usual.dwell_us if dwell_ms is None else round(dwell_ms * 1000)
    return Policy(
        lead=usual.lead if lead is None else lead,
        dwell_us=dwell_us,
        hold_us=max(usual.hold_us, dwell_us),
        max_lost=usual.max_lost if max_lost is None else max_lost,
        error_rate=error_rate,
    )

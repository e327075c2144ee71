"""`thenar run`: the runtime's recogniser, one JSON line a frame."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click
import msgspec

from .common import existing_file, existing_folder

if TYPE_CHECKING:
    from ..compiler.recordings.graspset import GraspSet
    from ..runtime.build import Build


class Line(msgspec.Struct, frozen=True):
    """One line of output: a recognition, and the grasp type that was recorded."""

    time_us: int
    grasp: str
    probability: float
    margin: int
    degraded: bool
    recorded: str


@click.command("run")
@click.argument("build", metavar="BUILD", type=existing_folder)
@click.option("--replay", metavar="SET.grasps", type=existing_file, required=True, help="Recorded frames to recognise.")
@click.option(
    "--period-us", type=click.IntRange(1), default=10_000, show_default=True, help="Time from one frame to the next."
)
def command(build: Path, replay: Path, period_us: int) -> None:
    """Recognise recorded frames, as fast as they can be read: one JSON line each on stdout, the rate on stderr.

    \b
    Example:
        thenar run build/ --replay set.grasps | head -3
    """
    from ..compiler.recordings.graspset import GraspSet
    from ..runtime.build import Build

    loaded, grasp_set = Build.load(build), GraspSet.load(replay)
    stdout = sys.stdout.buffer
    correct = 0
    for line in _replayed(loaded, grasp_set, period_us):
        correct += line.grasp == line.recorded
        stdout.write(msgspec.json.encode(line) + b"\n")
    stdout.flush()
    rows = len(grasp_set)
    click.echo(f"{correct} of {rows} frames recognised as recorded ({correct / max(rows, 1):.1%})", err=True)


def _replayed(build: "Build", grasp_set: "GraspSet", period_us: int) -> Iterator[Line]:
    from ..compiler.build.select import select_inputs
    from ..runtime.recognizer import Frame, Recognizer

    recognizer = Recognizer(build)
    bits, codes = select_inputs(grasp_set, build.manifest)
    for row, (switches, joints) in enumerate(zip(bits, codes, strict=True)):
        found = recognizer.recognise(Frame(row * period_us, switches, joints))
        yield Line(
            time_us=found.time_us,
            grasp=found.grasp,
            probability=round(found.probability, 6),
            margin=found.margin,
            degraded=found.degraded,
            recorded=str(grasp_set.grasps[row]),
        )

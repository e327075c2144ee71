"""`thenar segment`: find when each grasp began and ended."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from thenar.compiler.text import counted

from .parameters import Number, OutputFile, existing_file, existing_folder, keep_apart, overwrite_flag
from .printing import echo, json_flag, out, progress, show, table, warning, write_picture

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thenar.compiler.artifact.timeline import FoundSegment

_SHOWN = 20


@click.command("segment")
@click.argument("recordings", metavar="FILE", type=existing_file)
@click.option("-b", "--build", type=existing_folder, required=True, help="The build that recognises.")
@click.option("-o", "--output", type=OutputFile(".csv"), help="Write the segments as a table.")
@click.option(
    "--lag-ms",
    type=Number(min=0, max=10_000),
    help="Decide live, with this lag. [default: from the whole recording, which is exact]",
)
@click.option("--picture", type=OutputFile(".svg", ".png"), help="Draw the segments below the true ones.")
@click.option("--transitions", type=OutputFile(".json"), help="Count which type follows which, as JSON.")
@overwrite_flag
@json_flag
def command(
    recordings: Path,
    build: Path,
    output: Path | None,
    lag_ms: float | None,
    picture: Path | None,
    transitions: Path | None,
) -> None:
    """Find when each grasp of FILE begins and ends: whole movements (.grasps), or a recording (.mcap) of the inputs of
    BUILD.

    Each segment is one row: start and end in seconds, grasp type, and the mean probability of that type in its frames.
    Between segments nothing is held. If FILE holds the true labels, they are drawn above and F1 is printed.

    \b
    Example:
        thenar segment movements.grasps -b build/ -o segments.csv
        thenar segment run.mcap -b build/ -o segments.csv --lag-ms 150
        thenar segment movements.grasps -b build/ --picture timeline.svg --transitions graph.json
    """
    from thenar.compiler.artifact.timeline import as_csv, draw, overlap_f1, segment
    from thenar.compiler.movements.transitions import Transitions
    from thenar.runtime.files import write_atomically

    keep_apart(recordings, output, picture, transitions)
    with progress("finding segments") as report:
        found = segment(build, recordings, None if lag_ms is None else round(1000 * lag_ms), report, warning)
    if picture is not None:
        write_picture(picture, partial(draw, found))
    if transitions is not None:
        sequences = ([part.type for part in timeline.segments()] for timeline in found)
        write_atomically(transitions, Transitions.of(sequences, found[0].types).to_json())
    if output is not None:
        write_atomically(output, as_csv(found))
    segments = [one for timeline in found for one in timeline.segments()]
    seconds, f1 = sum(len(one.states) * one.tick_us for one in found) / 1e6, overlap_f1(found)
    summary = {"segments": segments, "streams": len(found), "seconds": seconds, "f1": f1}
    show(summary, lambda _: _print(segments, f"{seconds:,.1f} s of {counted(len(found), 'stream')}", f1))


def _print(segments: "Sequence[FoundSegment]", length: str, f1: "Sequence[float] | None") -> None:
    grid = table(("start s", "end s", "type", "confidence", "stream"), ("start s", "end s", "confidence"))
    for one in segments[:_SHOWN]:
        stream = one.subject if one.session == "1" else f"{one.subject} {one.session}"
        grid.add_row(f"{one.start_s:.2f}", f"{one.end_s:.2f}", one.type, f"{one.confidence:.3f}", stream)
    if segments:
        out().print(grid)
    more = len(segments) - _SHOWN
    if more > 0:
        echo(f"and {more:,} more: list them all with -o FILE.csv or --json")
    echo(f"{counted(len(segments), 'segment')} in {length}")
    if f1 is not None:
        echo("F1 at overlaps of 10, 25 and 50 %: " + ", ".join(f"{100 * score:.1f}" for score in f1))

"""`thenar info`: summarise a .grasps file."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from thenar.compiler.text import INDEPENDENT, counted, inputs_read, trials_of_frames
from thenar.runtime.published import NONE

from .common import existing_file, json_flag, keep_apart, out, overwrite_flag, picture_file, progress, show, table
from .lines import echo

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.compiler.recordings.summary import JointRange, Summary


@click.command("info")
@click.argument("grasps", type=existing_file)
@click.option("--plot", type=picture_file, help="Also draw the summary to this .png or .svg file.")
@overwrite_flag
@json_flag
def command(grasps: Path, plot: Path | None) -> None:
    """Summarise GRASPS, a .grasps file: counts, balance, and odd columns and rows.

    A trial is one recorded grasp or rest, a frame one reading. Rests count in no accuracy.

    \b
    Example:
        thenar info set.grasps
        thenar info set.grasps --plot set.png
    """
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.compiler.recordings.summary import summarise

    keep_apart(grasps, plot)
    grasp_set = GraspSet.load(grasps)
    with progress(f"comparing the rows of {grasps.name}"):
        summary = summarise(grasp_set)
    if plot is not None:
        with progress(f"drawing {plot.name}"):
            _draw(grasp_set, plot)
    show(summary, _print, grasps)


def _draw(grasp_set: "GraspSet", path: Path) -> None:
    from thenar.compiler.recordings.picture import draw
    from thenar.runtime.files import write_atomically

    write_atomically(path, draw(grasp_set, path.suffix.lower()[1:]))


def _print(summary: "Summary", path: Path) -> None:
    echo(
        f"{path}: {trials_of_frames(summary.frames, summary.trials, summary.rests)}, "
        f"{counted(len(summary.grasps), 'grasp type')} ({summary.taxonomy}); "
        f"subjects {len(summary.subjects)}, objects {len(summary.objects)}, "
        f"{inputs_read(len(summary.switches), len(summary.taxels), len(summary.joints))}"
    )
    if summary.none or summary.seconds is not None:
        echo(f"movements {summary.movements}{'' if summary.seconds is None else f', {summary.seconds:.1f} s'}")
    if summary.simulated:
        echo(f"simulated: {summary.simulated}")
    if summary.independent:
        echo(INDEPENDENT)
    _print_counts(summary)
    for kind, ranges in (("taxel", summary.taxels), ("joint", summary.joints)):
        _print_ranges(kind, ranges)
    for warning in summary.warnings:
        echo(f"warning: {warning.message}")


def _print_counts(summary: "Summary") -> None:
    grasps = table(("grasp type", "frames", "share"), ("frames", "share"), "Grasp types")
    for grasp, frames in summary.grasps.items():
        grasps.add_row(grasp, str(frames), f"{frames / summary.frames:.1%}")
    if summary.none:
        grasps.add_row(NONE, str(summary.none), f"{summary.none / summary.frames:.1%}")
    out().print(grasps)
    echo(f"balance (rarest type over commonest): {summary.balance:.2f}")
    for what, counts in (("subjects", summary.subjects), ("objects", summary.objects)):
        echo(f"{what}: " + ", ".join(f"{name} ({frames})" for name, frames in counts.items()))


def _print_ranges(kind: str, ranges: "Sequence[JointRange]") -> None:
    if not ranges:
        return
    numbers = ("least", "largest", "distinct codes")
    lines = table((kind, "unit", *numbers), numbers, f"{kind.capitalize()}s")
    for each in ranges:
        ends = ("-" if end is None else f"{end:g}" for end in (each.least, each.largest))
        lines.add_row(each.name, each.unit, *ends, str(each.codes))
    out().print(lines)

"""`thenar info`: summarise a .grasps file."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from thenar.compiler.text import INDEPENDENT, counted, inputs_read, trials_of_frames
from thenar.runtime.published import NONE

from .parameters import existing_file
from .printing import echo, json_flag, out, progress, show, table

if TYPE_CHECKING:
    from thenar.compiler.recordings.summary import Summary


@click.command("info")
@click.argument("grasps", type=existing_file)
@json_flag
def command(grasps: Path) -> None:
    """Summarise GRASPS, a .grasps file: counts, balance, and odd columns and rows.

    A trial is one recorded grasp or rest, a frame one reading. Rests count in no accuracy.

    \b
    Example:
        thenar info set.grasps
    """
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.compiler.recordings.summary import summarise

    grasp_set = GraspSet.load(grasps)
    with progress(f"comparing the rows of {grasps.name}"):
        summary = summarise(grasp_set)
    show(summary, _print, grasps)


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
    counts = [*summary.grasps.items()]
    counts += [(NONE, summary.none)] if summary.none else []
    rows = ((name, str(frames), f"{frames / summary.frames:.1%}") for name, frames in counts)
    out().print(table(("grasp type", "frames", "share"), ("frames", "share"), "Grasp types", rows))
    echo(f"balance (rarest type over commonest): {summary.balance:.2f}")
    for what, people in (("subjects", summary.subjects), ("objects", summary.objects)):
        echo(f"{what}: " + ", ".join(f"{name} ({frames})" for name, frames in people.items()))
    for kind, ranges in (("taxel", summary.taxels), ("joint", summary.joints)):
        if ranges:
            numbers = ("least", "largest", "distinct codes")
            grid = table((kind, "unit", *numbers), numbers, f"{kind.capitalize()}s")
            for line in ranges:
                ends = ("-" if end is None else f"{end:g}" for end in (line.least, line.largest))
                grid.add_row(line.name, line.unit, *ends, str(line.codes))
            out().print(grid)
    for warning in summary.warnings:
        echo(f"warning: {warning.message}")

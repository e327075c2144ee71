"""`thenar compare`: two builds on the same trials."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from .parameters import existing_file, existing_folder
from .printing import echo, json_flag, out, progress, show, table

if TYPE_CHECKING:
    from thenar.compiler.artifact.comparing import BuildComparison

_SHOWN = 20


@click.command("compare")
@click.argument("a", metavar="BUILD_A", type=existing_folder)
@click.argument("b", metavar="BUILD_B", type=existing_folder)
@click.argument("recordings", metavar="SET.grasps", type=existing_file)
@json_flag
def command(a: Path, b: Path, recordings: Path) -> None:
    """Compare two builds on the trials of SET.grasps: how much better BUILD_B is, with a 95 % interval, and where.

    The builds may read different sensors; the set must have all of them. Trials that a build was trained on are left
    out; if there are no others, the first line says so.

    \b
    Example:
        thenar compare build/ smaller/ later.grasps
    """
    from thenar.compiler.artifact.comparing import compare_builds
    from thenar.compiler.recordings.graspset import GraspSet

    with progress("comparing") as report:
        found = compare_builds(a, b, GraspSet.load(recordings), report)
    show(found, _print, (str(a), str(b)))


def _print(found: "BuildComparison", names: tuple[str, str]) -> None:
    rates = [
        f"{100 * count / found.trials:.1f} % [{100 * low:.1f}, {100 * high:.1f}]"
        for count, (low, high) in zip((found.a, found.b), found.ends, strict=True)
    ]
    echo(f"{found.trials:,} {found.of}: {names[0]} {rates[0]}, {names[1]} {rates[1]}")
    points, low, high = (f"{100 * share:+.1f}" for share in (found.difference, found.low, found.high))
    counts = f"{found.better} trials better, {found.worse} worse, p {found.p:.2g}"
    echo(f"difference: {points} points [{low}, {high}], {counts}")
    numbers = ("trials", "first, %", "second, %", "points")
    grid = table(("type", *numbers), numbers)
    for each in found.types:
        first, second = (100 * count / each.trials for count in (each.a, each.b))
        grid.add_row(each.grasp, str(each.trials), f"{first:.1f}", f"{second:.1f}", f"{second - first:+.1f}")
    out().print(grid)
    for one in found.changed[:_SHOWN]:
        echo(f"trial {one.trial} of {one.subject}, {one.object}: {one.recorded}, first {one.a}, second {one.b}")
    if len(found.changed) > _SHOWN:
        echo(f"and {len(found.changed) - _SHOWN} more: --json lists them all")

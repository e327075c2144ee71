"""`thenar info`: what a .grasps file holds."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from thenar.compiler.text import INDEPENDENT

from .common import existing_file, json_flag, keep_apart, out, overwrite_flag, picture_file, progress, show, table
from .lines import echo

if TYPE_CHECKING:
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.compiler.recordings.summary import JointRange, Summary


@click.command("info")
@click.argument("grasps", type=existing_file)
@click.option("--plot", type=picture_file, help="Also draw it: a .png or .svg file to write.")
@overwrite_flag
@json_flag
def command(grasps: Path, plot: Path | None) -> None:
    """Tell what GRASPS, a .grasps file, holds: counts, balance, odd columns and rows, and how separable it is.

    The ceiling is the rate of the best possible memory: no classifier that sees only these inputs is right more often
    on these rows. The neighbour rate is that of frames by the nearest frame of another trial, with joints and taxels
    in standard deviations.

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
    taxels = f"taxels {len(summary.taxels)}, " if summary.taxels else ""
    echo(
        f"{path}: {summary.rows} grasps of {len(summary.grasps)} types ({summary.taxonomy}); "
        f"subjects {len(summary.subjects)}, objects {len(summary.objects)}, "
        f"switches {len(summary.switches)}, {taxels}joints {len(summary.joints)}"
    )
    if summary.simulated:
        echo(f"simulated: {summary.simulated}")
    if summary.independent:
        echo(INDEPENDENT)
    _print_counts(summary)
    for what, ranges in (("taxel", summary.taxels), ("joint", summary.joints)):
        _print_ranges(what, ranges)
    _print_separability(summary)
    for warning in summary.warnings:
        echo(f"warning: {warning.message}")


def _print_counts(summary: "Summary") -> None:
    grasps = table(("grasp type", "rows", "share"), ("rows", "share"), "Grasp types")
    for grasp in summary.grasps:
        grasps.add_row(grasp.name, str(grasp.rows), f"{grasp.rows / summary.rows:.1%}")
    out().print(grasps)
    echo(f"balance (rarest type over commonest): {summary.balance:.2f}")
    for what, counts in (("subjects", summary.subjects), ("objects", summary.objects)):
        echo(f"{what}: " + ", ".join(f"{count.name} ({count.rows})" for count in counts))


def _print_ranges(what: str, ranges: "tuple[JointRange, ...]") -> None:
    if not ranges:
        return
    numbers = ("least", "largest", "distinct codes")
    joints = table((what, "unit", *numbers), numbers, f"{what.capitalize()}s")
    for joint in ranges:
        ends = ("-" if end is None else f"{end:g}" for end in (joint.least, joint.largest))
        joints.add_row(joint.name, joint.unit, *ends, str(joint.codes))
    out().print(joints)


def _print_separability(summary: "Summary") -> None:
    numbers = ("distinct frames", "ceiling", "nearest neighbour", "over rows")
    lines = table(("inputs", *numbers), numbers, "Separability")
    for line in summary.separability:
        rate = "-" if line.neighbour_rate is None else f"{line.neighbour_rate:.1%}"
        lines.add_row(line.inputs, str(line.distinct_frames), f"{line.ceiling:.1%}", rate, str(line.neighbour_rows))
    out().print(lines)

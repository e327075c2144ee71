"""`thenar draw`: draw the glove, palm up."""

from functools import partial
from pathlib import Path

import click

from .options import hand_of, layout_option
from .parameters import existing_file, keep_apart, overwrite_flag, picture_file
from .printing import echo, write_picture


@click.command("draw")
@click.argument("grasps", type=existing_file, required=False)
@click.option("-o", "--output", type=picture_file, required=True, help="The picture to write: an .svg or .png file.")
@overwrite_flag
@layout_option
@click.option("--per-grasp", is_flag=True, help="Draw one hand per grasp type of GRASPS, all on one scale.")
@click.option(
    "--kept",
    multiple=True,
    type=click.Path(exists=True, path_type=Path),
    metavar="PATH",
    help="Draw what a placement, a build or a list of names keeps; several are drawn side by side.",
)
def command(
    grasps: Path | None,
    output: Path,
    layout: Path | None,
    per_grasp: bool,
    kept: tuple[Path, ...],
) -> None:
    """Draw a glove palm up, each switch as a circle: your own with --layout, else the glove of the shipped scenes.

    Without GRASPS: all its switches, or with --kept those that placements keep, numbered in order. With GRASPS, a
    .grasps file with the glove's switches: how often each closed. In an .svg file, hovering over a circle names the
    switch.

    \b
    Example:
        thenar draw -o glove.svg
        thenar draw set.grasps --layout layout.toml --per-grasp -o contacts.png
        thenar draw --kept placement.json --kept build/ -o kept.svg
    """
    if grasps is None and per_grasp:
        raise click.UsageError("--per-grasp needs recordings: name a .grasps file as GRASPS")
    if grasps is not None and kept:
        raise click.UsageError("--kept draws the glove itself: leave GRASPS out")
    for source in (grasps, layout, *kept):
        keep_apart(source, output)
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.simulator.handmaps import draw as handpanels

    from .kept import kept_names

    hand = hand_of(layout)
    if grasps is not None:
        picture = handpanels.contacts(hand, GraspSet.load(grasps), per_grasp)
    elif kept:
        picture = handpanels.kept(hand, [(path.resolve().stem, kept_names(path)) for path in kept])
    else:
        picture = handpanels.all_switches(hand)
    write_picture(output, partial(handpanels.draw, picture))
    hands = len(picture.panels)
    echo(f"{output}: {hands} hand{'s' if hands > 1 else ''}")

"""`thenar draw`: draw the glove, palm up."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .options import hand_of, layout_option
from .parameters import existing_file, keep_apart, overwrite_flag, picture_file
from .printing import echo, progress, write_picture

if TYPE_CHECKING:
    from thenar.compiler.hand import HandShape
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.simulator.handmaps.draw import Picture


def _titled_paths(_context: click.Context, _option: click.Parameter, given: tuple[str, ...]) -> list[tuple[str, Path]]:
    """Return title and path of each [NAME=]PATH; without a NAME, the title is the file's name."""
    found = []
    for text in given:
        title, is_named, rest = text.partition("=")
        if not is_named or Path(text).exists():
            title, rest = Path(text).resolve().stem, text
        if not title or not rest:
            raise click.BadParameter(f"'{text}' is not NAME=PATH")
        if not Path(rest).exists():
            raise click.BadParameter(f"There is no file or folder '{rest}'.")
        found.append((title, Path(rest)))
    return found


@click.command("draw")
@click.argument("grasps", type=existing_file, required=False)
@click.option("-o", "--output", type=picture_file, required=True, help="The picture to write: an .svg or .png file.")
@overwrite_flag
@layout_option
@click.option("--numbers", is_flag=True, help="Label each switch with its number in the set, from 0.")
@click.option("--per-grasp", is_flag=True, help="Draw one hand per grasp type of GRASPS, all on one scale.")
@click.option("--place", "choose", is_flag=True, help="Draw the switches that `thenar place` would keep for GRASPS.")
@click.option(
    "--prune", type=click.IntRange(min=0), default=0, metavar="S", help="With --place: pruning as in `thenar place`."
)
@click.option(
    "--kept",
    multiple=True,
    callback=_titled_paths,
    metavar="[NAME=]PATH",
    help="Draw what a placement, a build or a list of names keeps; several are drawn side by side.",
)
def command(
    grasps: Path | None,
    output: Path,
    layout: Path | None,
    numbers: bool,
    per_grasp: bool,
    choose: bool,
    prune: int,
    kept: list[tuple[str, Path]],
) -> None:
    """Draw a glove palm up, each switch as a circle: your own with --layout, else the glove of the shipped scenes.

    Without GRASPS: all its switches, or with --kept those that placements keep, numbered in order. With GRASPS, a
    .grasps file with the glove's switches: how often each closed, or with --place the switches worth keeping, for each
    subject and for all rows pooled. In an .svg file, hovering over a circle names the switch.

    \b
    Example:
        thenar draw --numbers -o glove.svg
        thenar draw set.grasps --layout layout.toml --per-grasp -o contacts.png
        thenar draw set.grasps --place -o kept.svg
        thenar draw --kept A=a.json --kept build/ -o kept.svg
    """
    _check_options(grasps, numbers, per_grasp, choose, prune, bool(kept))
    for source in (grasps, layout, *(path for _, path in kept)):
        keep_apart(source, output)
    hand = hand_of(layout)
    if grasps is None:
        _write(_without_grasps(hand, numbers, kept), output)
        return
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.simulator.handmaps.draw import contacts

    grasp_set = GraspSet.load(grasps)
    _write(_placements(hand, grasp_set, prune) if choose else contacts(hand, grasp_set, per_grasp), output)


def _check_options(
    grasps: Path | None, numbers: bool, per_grasp: bool, choose: bool, prune: int, some_kept: bool
) -> None:
    if grasps is None and (per_grasp or choose):
        raise click.UsageError("--per-grasp and --place need recordings: name a .grasps file as GRASPS")
    if grasps is not None and (some_kept or numbers):
        raise click.UsageError("--kept and --numbers draw the glove itself: leave GRASPS out")
    if numbers and some_kept:
        raise click.UsageError("--kept already numbers the kept switches: leave out --numbers")
    if per_grasp and choose:
        raise click.UsageError("--per-grasp draws contacts and --place draws kept switches: give one of them")
    if prune and not choose:
        raise click.UsageError("--prune needs --place")


def _without_grasps(hand: "HandShape", numbers: bool, kept: list[tuple[str, Path]]) -> "Picture":
    from thenar.compiler.placement.drawing import kept_names
    from thenar.simulator.handmaps import draw as handpanels

    if not kept:
        return handpanels.all_switches(hand, numbers)
    return handpanels.kept(hand, [(title, kept_names(path)) for title, path in kept])


def _placements(hand: "HandShape", grasp_set: "GraspSet", prune: int) -> "Picture":
    """Return a hand for each subject and one for all rows pooled, or one hand if there is only one subject."""
    from thenar.compiler.placement.placement import place_by_subject
    from thenar.simulator.handmaps.draw import kept

    hand.numbers_of(grasp_set.element_names)  # rejects a foreign set before any tree is grown
    with progress("growing a tree of each hand") as report:
        return kept(hand, [(title, list(found.names)) for title, found in place_by_subject(grasp_set, prune, report)])


def _write(picture: "Picture", path: Path) -> None:
    from thenar.simulator.handmaps.draw import draw

    write_picture(path, partial(draw, picture))
    hands = len(picture.panels)
    echo(f"{path}: {hands} hand{'s' if hands > 1 else ''}")

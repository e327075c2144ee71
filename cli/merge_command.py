"""`thenar merge`: merge several .grasps files of one glove."""

from pathlib import Path

import click
from msgspec import Struct

from thenar.compiler.text import trials_of_frames

from .common import OutputFile, existing_file, json_flag, keep_apart, overwrite_flag, progress, show
from .lines import echo


class Merged(Struct, frozen=True):
    """The written set, and its counts."""

    output: str
    sets: int
    frames: int
    trials: int
    rests: int
    subjects: int
    sessions: int


@click.command("merge")
@click.argument("sets", metavar="SET.grasps...", type=existing_file, nargs=-1, required=True)
@click.option("-o", "--output", type=OutputFile(".grasps"), required=True, help="The .grasps file to write.")
@overwrite_flag
@click.option(
    "--each",
    type=click.Choice(["subject", "session", "object"]),
    help="Treat each file as a separate subject, session or object, named after the file.",
)
@json_flag
def command(sets: tuple[Path, ...], output: Path, each: str | None) -> None:
    """Merge SETs of one glove: the same switches and joints, and one taxonomy, or taxonomies of your own.

    A trial found in two of the files stops the merge, because its rows would be mistaken for frames of one grasp;
    --each keeps the files distinct.

    \b
    Example:
        thenar merge anna.grasps ben.grasps -o all.grasps
        thenar merge monday.grasps friday.grasps -o anna.grasps --each session
    """
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.compiler.recordings.merging import merge

    keep_apart(*sets, output)
    with progress(f"merging {len(sets)} sets"):
        merged = merge({str(path): GraspSet.load(path) for path in sets}, each)  # type: ignore[arg-type]
    merged.save(output)
    trials, subjects, sessions = (
        len({*column.tolist()}) for column in (merged.trial_ids, merged.subjects, merged.sessions)
    )
    written = Merged(str(output), len(sets), len(merged), trials, merged.rests, subjects, sessions)
    show(written, _print, merged.simulated)


def _print(merged: Merged, simulated: str) -> None:
    echo(
        f"{merged.output}: {trials_of_frames(merged.frames, merged.trials, merged.rests)} from {merged.sets} sets; "
        f"subjects {merged.subjects}, sessions {merged.sessions}"
    )
    if simulated:
        echo(f"simulated: {simulated}")

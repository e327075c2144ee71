"""`thenar split`: split a .grasps file by subject, object or session."""

from pathlib import Path
from typing import TYPE_CHECKING

import click
from msgspec import Struct

from thenar.compiler.text import trials_of_frames

from .common import OutputFolder, existing_file, json_flag, progress, show
from .lines import echo

if TYPE_CHECKING:
    from thenar.compiler.recordings.graspset import GraspSet


class Part(Struct, frozen=True):
    """A written file: its subject, object or session, and its numbers of frames, trials, and rests among these."""

    name: str
    output: str
    frames: int
    trials: int
    rests: int


@click.command("split")
@click.argument("grasps", metavar="SET.grasps", type=existing_file)
@click.option(
    "--by", type=click.Choice(["subject", "object", "session"]), required=True, help="Write one file for each."
)
@click.option("-o", "--output", metavar="DIR", type=OutputFolder(), required=True, help="Folder to write the files to.")
@click.option("--overwrite", is_flag=True, help="Replace files of the same names; other files stay.")
@json_flag
def command(grasps: Path, by: str, output: Path, overwrite: bool) -> None:
    """Split SET.grasps into one file per subject, object or session; either all files are written or none.

    \b
    Example:
        thenar split set.grasps --by subject -o people/
    """
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.compiler.recordings.merging import split_into

    grasp_set = GraspSet.load(grasps)
    with progress(f"splitting {grasps.name}"):
        files = split_into(grasp_set, by, output, overwrite=overwrite)  # type: ignore[arg-type]
    column = getattr(grasp_set, f"{by}s")
    parts = [_part(name, path, grasp_set.rows(column == name)) for name, path in files.items()]
    show(parts, _print, by)


def _part(name: str, path: Path, found: "GraspSet") -> Part:
    return Part(name, str(path), len(found), found.n_trials, found.rests)


def _print(parts: list[Part], by: str) -> None:
    for part in parts:
        echo(f"{part.output}: {by} {part.name}, {trials_of_frames(part.frames, part.trials, part.rests)}")

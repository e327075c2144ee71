"""`thenar split`: a .grasps file into one for each subject, object or session."""

from pathlib import Path

import click
from msgspec import Struct

from .common import OutputFolder, existing_file, json_flag, progress, show
from .lines import echo


class Part(Struct, frozen=True):
    """A file that was written: the subject, object or session that it holds, and its number of grasps."""

    name: str
    output: str
    grasps: int


@click.command("split")
@click.argument("grasps", metavar="SET.grasps", type=existing_file)
@click.option("--by", type=click.Choice(["subject", "object", "session"]), required=True, help="What a file is of.")
@click.option(
    "-o", "--output", metavar="DIR", type=OutputFolder(), required=True, help="The folder to write files into."
)
@click.option("--overwrite", is_flag=True, help="Replace files of the same names; other files stay.")
@json_flag
def command(grasps: Path, by: str, output: Path, overwrite: bool) -> None:
    """Split SET.grasps: one file for each subject, object or session, all of them written or none.

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
    parts = [Part(name, str(path), int((column == name).sum())) for name, path in files.items()]
    show(parts, _print, by)


def _print(parts: list[Part], by: str) -> None:
    for part in parts:
        echo(f"{part.output}: {by} {part.name}, {part.grasps} grasps")

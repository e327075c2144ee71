"""`thenar split`: split a .grasps file by subject, object or session."""

from pathlib import Path
from typing import Any

import click

from thenar.compiler.text import trials_of_frames

from .parameters import OutputFolder, existing_file
from .printing import echo, json_flag, progress, show


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
    parts = []
    for name, path in files.items():
        part = grasp_set.rows(column == name)
        counts = {"frames": len(part), "trials": part.n_trials, "rests": part.rests}
        parts.append({"name": name, "output": str(path), **counts})
    show(parts, _print, by)


def _print(parts: list[dict[str, Any]], by: str) -> None:
    for part in parts:
        size = trials_of_frames(part["frames"], part["trials"], part["rests"])
        echo(f"{part['output']}: {by} {part['name']}, {size}")

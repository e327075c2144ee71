"""`thenar merge`: merge several .grasps files of one glove."""

from pathlib import Path

import click

from thenar.compiler.text import trials_of_frames

from .parameters import OutputFile, existing_file, keep_apart, overwrite_flag
from .printing import echo, json_flag, progress, show, warning


@click.command("merge")
@click.argument("sets", metavar="SET.grasps...", type=existing_file, nargs=-1, required=True)
@click.option("-o", "--output", type=OutputFile(".grasps"), required=True, help="The .grasps file to write.")
@overwrite_flag
@click.option(
    "--each",
    type=click.Choice(["subject", "session", "object"]),
    help="Treat each file as a separate subject, session or object, named after the file.",
)
@click.option("--edits", type=existing_file, help="Apply the edits of trials that thenar studio logged in this file.")
@json_flag
def command(sets: tuple[Path, ...], output: Path, each: str | None, edits: Path | None) -> None:
    """Merge SETs of one glove: the same switches and joints, and one taxonomy, or taxonomies of your own.

    A trial found in two of the files stops the merge, because its rows would be mistaken for frames of one grasp;
    --each keeps the files distinct.

    \b
    Example:
        thenar merge anna.grasps ben.grasps -o all.grasps
        thenar merge monday.grasps friday.grasps -o anna.grasps --each session
        thenar merge anna.grasps --edits edits.jsonl -o clean.grasps
    """
    from thenar.compiler.recordings.edits import apply_edits, read_edits
    from thenar.compiler.recordings.graspset import GraspSet

    keep_apart(*sets, output)
    logged, damaged = ([], "") if edits is None else read_edits(edits)
    with progress(f"merging {len(sets)} sets"):
        merged, _, unused = apply_edits(
            {str(path): GraspSet.load(path) for path in sets},
            logged,
            each,  # type: ignore[arg-type]
        )
    for sentence in filter(None, (damaged, *unused)):
        warning(sentence)
    merged.save(output)
    columns = {"trials": merged.trial_ids, "subjects": merged.subjects, "sessions": merged.sessions}
    counts = {name: len({*column.tolist()}) for name, column in columns.items()}
    size = {"frames": len(merged), "trials": counts["trials"], "rests": merged.rests}
    written = {"output": str(output), "sets": len(sets), **size, **counts}

    def people(_: object) -> None:
        echo(
            f"{output}: {trials_of_frames(**size)} from {len(sets)} sets; "
            f"subjects {counts['subjects']}, sessions {counts['sessions']}"
        )
        if merged.simulated:
            echo(f"simulated: {merged.simulated}")

    show(written, people)

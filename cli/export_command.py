"""`thenar export`: convert a .grasps file into a table for other programs."""

from pathlib import Path

import click

from .parameters import OutputFile, existing_file, keep_apart, overwrite_flag
from .printing import echo, json_flag, progress, show


@click.command("export")
@click.argument("grasps", type=existing_file)
@click.option(
    "-o",
    "--output",
    type=OutputFile(".csv", ".csv.gz", ".tsv", ".tsv.gz", ".arff", ".parquet"),
    required=True,
    help="The table to write: .csv or .tsv (also with .gz), .arff or .parquet.",
)
@overwrite_flag
@click.option("--codes", is_flag=True, help="Write the joints' integer codes, not values in their units.")
@click.option("--columns", type=OutputFile(".toml"), help="Also write the columns.toml that imports the table again.")
@json_flag
def command(grasps: Path, output: Path, codes: bool, columns: Path | None) -> None:
    """Export GRASPS, a .grasps file, as CSV, as Parquet, or as ARFF for Weka.

    With --columns, the table imports again as the same set: a table alone does not say what its codes mean, or that its
    grasps were simulated. An ARFF holds inputs and grasp types alone, and is not imported.

    \b
    Example:
        thenar export set.grasps -o table.csv --columns columns.toml
        thenar export set.grasps -o table.arff
    """
    from thenar.compiler.recordings.export import export
    from thenar.compiler.recordings.graspset import GraspSet

    keep_apart(grasps, output, columns)
    grasp_set = GraspSet.load(grasps)
    with progress(f"exporting {grasps.name}"):
        export(grasp_set, output, codes, columns)
    columns_file = None if columns is None else str(columns)
    counts = {"trials": grasp_set.n_trials, "frames": len(grasp_set)}
    show({"output": str(output), "columns": columns_file, **counts}, lambda _: echo(f"{output}: {grasp_set.size}"))

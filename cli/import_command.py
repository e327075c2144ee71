"""`thenar import`: a table of labelled grasps, or recordings, into a .grasps file."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from .common import (
    OutputFile,
    existing_file,
    json_flag,
    keep_apart,
    out,
    overwrite_flag,
    progress,
    show,
    table,
    warning,
)
from .lines import echo

if TYPE_CHECKING:
    from thenar.compiler.recordings.importer import ImportReport


@click.command("import")
@click.argument("tables", metavar="TABLE", type=existing_file, nargs=-1, required=True)
@click.option("-o", "--output", type=OutputFile(".grasps"), required=True, help="The .grasps file to write.")
@overwrite_flag
@click.option("--columns", type=existing_file, help="columns.toml: what each column of the table is.")
@json_flag
def command(tables: tuple[Path, ...], output: Path, columns: Path | None) -> None:
    """Import TABLE (.csv, .csv.gz, .arff, .arff.gz or .npz) as labelled grasps.

    Missing or malformed cells and unknown labels stop the import, naming their rows and columns; what is merely odd
    (constant switches, rows that two subjects share, ...) is counted in warnings.

    Recordings of `thenar record` (.mcap) say themselves what is in them; several, of several subjects, become one set.

    \b
    Example:
        thenar import trials.csv.gz -o set.grasps --columns columns.toml
        thenar import anna.mcap ben.mcap -o set.grasps
    """
    keep_apart(*tables, columns, output)
    from thenar.compiler.recordings.mcap_recording import import_files

    with progress(f"importing {', '.join(table.name for table in tables)}"):
        grasp_set, report = import_files(tables, columns)
    grasp_set.save(output)
    show(report, _print, output)


def _print(report: "ImportReport", output: Path) -> None:
    for finding in report.warnings:
        warning(finding.message)
    if report.coding:
        numbers = ("step", "largest error", "rms error", "values before", "after")
        coding = table(("joint", "unit", *numbers), numbers, "Coding")
        for cost in report.coding:
            errors = (f"{cost.step:g}", f"{cost.largest_error:.3g}", f"{cost.rms_error:.3g}")
            coding.add_row(cost.joint, cost.unit, *errors, str(cost.distinct_before), str(cost.distinct_after))
        out().print(coding)
    echo(
        f"{output}: {report.rows} grasps of {report.grasp_types} types ({report.taxonomy}); "
        f"subjects {report.subjects}, objects {report.objects}, switches {report.switches}, joints {report.joints}"
    )

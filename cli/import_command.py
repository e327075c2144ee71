"""`thenar import`: convert a table of labelled grasps, or recordings, into a .grasps file."""

import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click

from thenar.compiler.text import counted, inputs_read, trials_of_frames

from .parameters import OutputFile, existing_file, keep_apart, overwrite_flag, overwrites
from .printing import echo, json_flag, out, progress, show, table, wants_json, warning

if TYPE_CHECKING:
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.compiler.recordings.importer import ImportReport
    from thenar.compiler.recordings.propose import ColumnProposal


def _existing(context: click.Context, argument: click.Parameter, given: tuple[str, ...]) -> tuple[Path, ...]:
    """Return the paths, each of which is there, or is a pattern of files: a path with fields in braces."""
    is_there = click.Path(exists=True)
    return tuple(
        Path(each if "{" in each else os.fsdecode(is_there.convert(each, argument, context))) for each in given
    )


@click.command("import")
@click.argument("tables", metavar="TABLE", type=click.Path(), callback=_existing, nargs=-1, required=True)
@click.option("-o", "--output", type=OutputFile(".grasps"), required=True, help="The .grasps file to write.")
@overwrite_flag
@click.option("--columns", type=existing_file, help="columns.toml: the meaning of each column of the table.")
@click.option("--stream", is_flag=True, help="Import recordings as a row with its time every 10 ms, not one per trial.")
@click.option("-y", "--yes", is_flag=True, help="Accept the detected columns without asking.")
@json_flag
def command(tables: tuple[Path, ...], output: Path, columns: Path | None, stream: bool, yes: bool) -> None:
    """Import TABLE (.csv, .xlsx, .parquet, .h5, .mat, .mot, .c3d, .bag, a rosbag2, ...) as labelled grasps.

    Without --columns, the command detects the meaning of each column, shows it with reasons, and writes it next to the
    output, to set.columns.toml for set.grasps, for you to correct; on a terminal it then asks whether to continue.

    One file per trial: TABLE is a pattern whose fields in braces say what the path says, a column each; * is any text.
    For a folder the command proposes the pattern. Quote patterns, and name fields as keys of columns.toml: label,
    subject, object, session, trial.

    Further TABLEs hold more of the same trials: columns, or segments (start, end, label) of the first one's rows.
    Malformed cells and unknown labels stop the import; merely odd data are counted in warnings.

    Recordings of `thenar record` (.mcap) describe themselves; several, also of several subjects, become one set. With
    --stream they become whole movements: a grasp counts as held while the hand stays as it was captured.

    \b
    Example:
        thenar import glove.csv -o set.grasps
        thenar import trials.csv.gz -o set.grasps --columns columns.toml
        thenar import 'data/{label}/{subject}_{trial}.csv' -o set.grasps
        thenar import 'bags/{subject}_{trial}' segments.csv -o set.grasps
        thenar import anna.mcap ben.mcap -o movements.grasps --stream
    """
    keep_apart(*tables, columns, output)
    from thenar.compiler.recordings.bags import is_folder, is_recording
    from thenar.compiler.recordings.mcap_recording import import_files

    if len(tables) == 1 and tables[0].is_dir() and not is_folder(tables[0]):
        tables = (_pattern(tables[0]),)
    if columns is None and not stream and not all(map(is_recording, tables)):
        grasp_set, report = _found(tables, output, yes)
    else:
        with progress(f"importing {', '.join(table.name for table in tables)}") as report_files:
            grasp_set, report = import_files(tables, columns, stream, report_files)
    grasp_set.save(output)
    show(report, _print, output)


def _pattern(folder: Path) -> Path:
    """Return the pattern of the tables in a folder, and say what it is."""
    from thenar.compiler.recordings.trial_files import propose_pattern

    pattern, remarks = propose_pattern(folder)
    for remark in remarks:
        echo(remark, err=wants_json())
    return pattern


def _found(tables: tuple[Path, ...], output: Path, yes: bool) -> "tuple[GraspSet, ImportReport]":
    """Import `tables` of the same trials with the detected columns, if the user agrees."""
    from thenar.compiler.recordings import TableError
    from thenar.compiler.recordings.importer import import_table
    from thenar.compiler.recordings.propose import propose_file

    with progress(f"reading {', '.join(table.name for table in tables)}") as report_files:
        read, proposal = propose_file(tables[0], report_files, tables[1:])
    asked = not yes and os.isatty(0) and not wants_json()
    if not wants_json():
        _print_proposal(proposal)
    if proposal.lacks and asked and click.confirm("Is each row a separate trial?"):
        proposal = proposal.independent()
    written = _write(proposal.toml(), output.with_suffix(".columns.toml"), asked)
    echo(f"{written}: the detected columns", err=wants_json())
    words = ["thenar", "import", *map(str, tables), "-o", str(output), *["--overwrite"] * output.exists()]
    again = shlex.join([*words, "--columns", str(written)])
    if proposal.lacks:
        raise TableError(f"{proposal.lacks}: do so in {written}, then run: {again}")
    if asked and not click.confirm("Import with these columns?"):
        raise TableError(f"nothing was imported: correct {written}, then run: {again}")
    if not yes and not asked:
        raise TableError(f"nobody confirmed the columns on a terminal: review {written}, then run: {again}")
    with progress(f"importing {tables[0].name}"):
        return import_table(read, proposal.columns)


def _write(text: str, path: Path, asked: bool) -> Path:
    """Write the detected columns to `path`; replace others there only if the user agrees. Return the path."""
    from thenar.compiler.recordings import TableError
    from thenar.runtime.files import write_atomically

    kept = os.path.lexists(path) and not (path.is_file() and path.read_bytes() == text.encode())
    replace = overwrites(click.get_current_context()) or (asked and kept and click.confirm(f"Replace {path}?"))
    if kept and not replace:
        raise TableError(f"{path} holds other columns than those detected: add --columns {path} or --overwrite")
    write_atomically(path, text.encode())
    return path


def _print_proposal(proposal: "ColumnProposal") -> None:
    from thenar.compiler.recordings.propose import listed

    for remark in proposal.remarks:
        echo(remark)
    rows = table(("columns", "read as", "why"), title="Detected columns")
    for role in proposal.roles:
        rows.add_row(listed(role.columns), role.role, role.reason)
    out().print(rows)


def _print(report: "ImportReport", output: Path) -> None:
    for finding in report.warnings:
        warning(finding.message)
    for note in report.notes:
        echo(note)
    if rounded := [cost for cost in report.coding if cost.rounds]:
        worst = max(rounded, key=lambda cost: cost.largest_error / abs(cost.step))
        error = f"at most {worst.largest_error:.3g} {worst.unit} of {worst.joint}, in steps of {abs(worst.step):g}"
        echo(f"{counted(len(rounded), 'joint')} rounded to codes, {error}: --json lists all")
    echo(
        f"{output}: {trials_of_frames(report.frames, report.trials, report.rests)}, "
        f"{counted(report.grasp_types, 'grasp type')} ({report.taxonomy}); "
        f"subjects {report.subjects}, objects {report.objects}, "
        f"{inputs_read(report.switches, report.taxels, report.joints)}"
    )

"""`thenar stability`: every hard case, the truth it is held against, and the error."""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .common import json_flag, output_file, print_json, progress

if TYPE_CHECKING:
    from thenar.stability.report import Report

# What a run, and a page, import sooner or later: better to say at once that it is not there than once in each case.
_NEEDED = ("mpmath", "joblib", "scipy", "sklearn")
_NEEDED_FOR_A_PAGE = ("jinja2", "matplotlib")


def _known(_: click.Context, __: click.Parameter, cases: tuple[str, ...]) -> tuple[str, ...]:
    """Return the cases asked for in the order of the catalogue, each once; all of them where none is named."""
    from thenar.runtime.names import nearest
    from thenar.stability.report import NAMES

    for case in cases:
        if case not in NAMES:
            raise click.BadParameter(f"there is no case {case!r}{nearest(case, NAMES)}; --list shows them all")
    return tuple(name for name in NAMES if not cases or name in cases)


@click.command("stability")
@click.argument("cases", nargs=-1, metavar="[CASE]...", callback=_known)
@click.option("--full", is_flag=True, help="Try more and harder inputs, such as 10,000 rounds of boosting: minutes.")
@click.option("--list", "listing", is_flag=True, help="Only list the cases, and what could go wrong in each.")
@click.option(
    "--jobs", type=click.IntRange(min=1), help="Worker processes; they change no result.  [default: all cores]"
)
@click.option(
    "-o", "--output", type=output_file, metavar="PAGE.html", help="Write a page with table and pictures there."
)
@json_flag
def command(
    cases: tuple[str, ...], full: bool, listing: bool, jobs: int | None, output: Path | None, as_json: bool
) -> int:
    """Run the hard cases: what could go wrong with the numbers, the truth they are held against, and the worst error.

    Without a CASE, all of them. The truth is worked out again at 60 digits, independently of the product, or is a fact
    that must hold exactly. Exits with 1 if an error exceeds its bound. A run of all cases, and a page, also show Weka's
    own answers under two settings of its JVM, where java and Weka 3.6 are installed.

    \b
    Example:
        thenar stability
        thenar stability --full -o stability.html
        thenar stability separable weights
    """
    if listing:
        if output is not None or full:
            raise click.UsageError("--list only lists: leave out --output and --full")
        _list(cases, as_json=as_json)
        return 0
    for name in (*_NEEDED, *(_NEEDED_FOR_A_PAGE if output is not None else ())):
        # Not imported: how matplotlib is, compiler/pictures.py says.
        if find_spec(name) is None:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    return _run(cases, full=full, jobs=jobs or -1, output=output, as_json=as_json)


def _run(cases: tuple[str, ...], *, full: bool, jobs: int, output: Path | None, as_json: bool) -> int:
    from thenar.stability.report import NAMES, Report, run
    from thenar.stability.weka import beside_weka

    with progress("hard cases") as report:
        found = run(cases, full=full, jobs=jobs, progress=report)
    with progress("beside Weka"):
        beside = beside_weka() if cases == NAMES or output is not None else None
    result = Report(full, found, beside, all(case.holds for case in found))
    if output is not None:
        _write(result, jobs, output)
    if as_json:
        print_json(result)
    else:
        from .stability_tables import print_report

        print_report(result)
    return 0 if result.holds else 1


def _write(result: "Report", jobs: int, path: Path) -> None:
    from thenar.runtime.files import write_atomically
    from thenar.stability.shown.figures import figures, measure
    from thenar.stability.shown.page import page

    with progress("pictures") as report:
        measured = measure(full=result.full, jobs=jobs, progress=report)
        pictures = figures(measured, result.beside)
    write_atomically(path, page(result, pictures).encode())


def _list(cases: tuple[str, ...], *, as_json: bool) -> None:
    from thenar.stability.report import listed

    found = listed(cases)
    if as_json:
        print_json(found)
    else:
        from .stability_tables import print_list

        print_list(found)

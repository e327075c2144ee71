"""What the sub-commands share: paths, the `--json` flag, consoles, and a progress bar for work longer than a second."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import msgspec
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

existing_file = click.Path(exists=True, dir_okay=False, path_type=Path)
existing_folder = click.Path(exists=True, file_okay=False, path_type=Path)
any_path = click.Path(path_type=Path)

json_flag = click.option("--json", "as_json", is_flag=True, help="Print one JSON document for machines instead.")


def out() -> Console:
    """Return the console for results. Wide tables are not cut when piped into a file."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=200)


def err() -> Console:
    """Return the console for warnings and progress."""
    return Console(stderr=True, highlight=False)


def print_json(result: Any) -> None:
    """Print `result` (msgspec struct, dataclass or builtin) as one indented JSON document on stdout."""
    click.echo(msgspec.json.format(msgspec.json.encode(result), indent=2))


@contextmanager
def progress(what: str) -> Iterator[Callable[[int, int], None]]:
    """Yield report(done, total), which draws a bar on stderr when that is a terminal and nothing otherwise."""
    console = err()
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)

"""What is printed: lines, tables, JSON, and a progress bar for work longer than a second.

All of it is safe for terminals and encodings, whatever the names in it hold.
"""

import re
import sys
from collections.abc import Callable, Container, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

import click
import msgspec

from thenar.drivers.names import shown

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.table import Table
    from rich.text import TextType

_JSON = "thenar.json"
Found = TypeVar("Found")
Rest = ParamSpec("Rest")
# Left unescaped by JSON, but perhaps unsafe for a terminal or an encoding.
_DOUBTFUL = re.compile(r"[^\n -~]")

json_flag = click.option(
    "--json",
    is_flag=True,
    expose_value=False,
    callback=lambda context, _option, wanted: context.meta.update({_JSON: wanted}),
    help="Print one JSON document for machines instead.",
)


def echo(text: str, *, err: bool = False) -> None:
    """Print `text` and a newline on stdout, or with `err` on stderr."""
    # By default, click writes UTF-8 to a stream that is ASCII.
    click.echo(shown(text), file=sys.stderr if err else sys.stdout)


def json_shown(text: str, encoding: str) -> str:
    """Return the JSON document `text`, with JSON escapes for characters without a glyph or outside `encoding`."""
    return _DOUBTFUL.sub(lambda found: _in_json(found[0], encoding), text)


def _in_json(letter: str, encoding: str) -> str:
    with suppress(UnicodeEncodeError):
        letter.encode(encoding)
        if letter.isprintable():
            return letter
    units = letter.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[at]:02x}{units[at + 1]:02x}" for at in range(0, len(units), 2))


def say(line: str) -> None:
    """Print a line on stderr, if that is still open: the terminal may have been closed."""
    with suppress(OSError):
        echo(line, err=True)


def say_page(url: str) -> None:
    """Print the address of the page."""
    echo(f"thenar: the page is at {url}", err=True)


def out() -> "Console":
    """Return the console for results; its lines are 200 characters wide outside a terminal."""
    console = _console()
    return console if console.is_terminal else _console(width=200)


def err() -> "Console":
    """Return the console for warnings and progress."""
    return _console(stderr=True)


def warning(sentence: str) -> None:
    """Print a warning on stderr."""
    echo(f"warning: {sentence}", err=True)


def _console(stderr: bool = False, width: int | None = None) -> "Console":
    from .consoles import SafeConsole  # a run without a terminal needs no rich

    # Names of the user's columns and files may hold brackets and colons: they are not markup.
    return SafeConsole(stderr=stderr, width=width, highlight=False, markup=False, emoji=False)


def wants_json() -> bool:
    """Return whether --json was given."""
    return bool(click.get_current_context().meta[_JSON])


def print_json(result: Any) -> None:
    """Print `result` (msgspec struct, dataclass or builtin) as one indented JSON document on stdout."""
    text = _json(result).decode()
    click.echo(json_shown(text, getattr(sys.stdout, "encoding", None) or "utf-8"), file=sys.stdout)


def show(
    found: Found, people: Callable[Concatenate[Found, Rest], None], *rest: Rest.args, **named: Rest.kwargs
) -> None:
    """Print `found` as JSON if --json is given, otherwise by `people`."""
    if wants_json():
        print_json(found)
    else:
        people(found, *rest, **named)


def write_json(path: Path, found: Any) -> None:
    """Write `found` as one indented JSON document."""
    from thenar.runtime.files import write_atomically

    write_atomically(path, _json(found) + b"\n")


def write_picture(path: Path, draw: Callable[[str], bytes]) -> None:
    """Write the picture that `draw` returns for "svg" or "png", the ending of `path`."""
    from thenar.runtime.files import write_atomically

    with progress(f"drawing {path.name}"):
        data = draw(path.suffix.lower()[1:])
    write_atomically(path, data)


def _json(found: Any) -> bytes:
    return msgspec.json.format(msgspec.json.encode(found), indent=2)


def table(
    columns: Iterable[str],
    numbers: Container[str] = (),
    title: "TextType | None" = None,
    rows: "Iterable[Iterable[RenderableType]]" = (),
) -> "Table":
    """Return a table of these columns, with `numbers` aligned right."""
    from .consoles import WholeTable

    made = WholeTable(title=title)
    for column in columns:
        is_number = column in numbers
        made.add_column(column, justify="right" if is_number else "left", no_wrap=is_number, overflow="fold")
    for row in rows:
        made.add_row(*row)
    return made


@contextmanager
def progress(what: str, *, lines: bool = False) -> Iterator[Callable[[int, int], None]]:
    """Yield report(done, total), which draws a bar on stderr if that is a terminal, and does nothing otherwise; with
    `lines`, for work of minutes, it prints a line for each step then.
    """
    console = err()
    if lines and not console.is_terminal:
        echo(f"{what} ...", err=True)
        yield lambda done, total: echo(f"{what}: {done} of {total} steps", err=True)
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def of_device(name: str, state: str) -> str:
    """Return `state` as a sentence about the device `name`, naming its port only once."""
    kind, _, port = name.partition(" at ")
    return f"{kind if port and port in state else name}: {state}"

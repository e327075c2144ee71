"""What is printed: lines, tables, JSON, and a progress bar for work longer than a second.

All of it is safe for terminals and encodings, whatever the names in it hold.
"""

import re
import sys
from collections.abc import Callable, Container, Iterable, Iterator
from contextlib import contextmanager, suppress
from json import dumps
from pathlib import Path
from time import monotonic
from typing import Any, Concatenate, ParamSpec, TypeVar

import click
import msgspec

from thenar.drivers.names import shown

from .consoles import Console, Live, Table, Text, bar

_JSON = "thenar.json"
_REDRAW_S = 0.1
Found = TypeVar("Found")
Rest = ParamSpec("Rest")
# Left unescaped by msgspec, but perhaps unsafe for a terminal or an encoding.
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


def say(line: str) -> None:
    """Print a line on stderr, if that is still open: the terminal may have been closed."""
    with suppress(OSError):
        echo(line, err=True)


def out() -> Console:
    """Return the console for results; its lines are 200 characters wide outside a terminal."""
    console = Console()
    return console if console.is_terminal else Console(width=200)


def err() -> Console:
    """Return the console for warnings and progress."""
    return Console(stderr=True)


def warning(sentence: str) -> None:
    """Print a warning on stderr."""
    echo(f"warning: {sentence}", err=True)


def wants_json() -> bool:
    """Return whether --json was given."""
    return bool(click.get_current_context().meta[_JSON])


def print_json(result: Any) -> None:
    """Print `result` (msgspec struct, dataclass or builtin) as one indented JSON document on stdout, in ASCII."""
    text = _DOUBTFUL.sub(lambda found: dumps(found[0])[1:-1].replace("\x7f", "\\u007f"), _json(result).decode())
    click.echo(text, file=sys.stdout)


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
    title: str | None = None,
    rows: Iterable[Iterable[str | Text]] = (),
) -> Table:
    """Return a table of these columns, with `numbers` aligned right."""
    made = Table(list(columns), numbers, title)
    for row in rows:
        made.add_row(*row)
    return made


@contextmanager
def progress(what: str, *, lines: bool = False) -> Iterator[Callable[[int, int], None]]:
    """Yield report(done, total), which draws a bar on stderr if that is a terminal, and does nothing otherwise; with
    `lines`, for work of minutes, it prints a line for each step then.
    """
    console, began_s, drawn_s = err(), monotonic(), 0.0
    if lines and not console.is_terminal:
        echo(f"{what} ...", err=True)
        yield lambda done, total: echo(f"{what}: {done} of {total} steps", err=True)
        return

    def report(done: int, total: int) -> None:
        nonlocal drawn_s
        now_s = monotonic()
        if now_s - drawn_s > _REDRAW_S:
            drawn_s, passed_s = now_s, now_s - began_s
            left = f", {passed_s * (total - done) / done:.0f} s left" if done else ""
            live.update(f"{what} {bar(done / max(total, 1))} {done}/{total} {passed_s:.0f} s{left}")

    with Live(console) as live:
        live.update(f"{what} ...")
        yield report

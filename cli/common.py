"""Shared by the sub-commands: types of options, and what is printed: lines, tables, JSON, and progress.

What is printed is safe for terminals and encodings, whatever the names in it hold.
"""

import math
import os
import re
import signal
import sys
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from copy import copy
from dataclasses import replace
from pathlib import Path
from threading import Event, Thread
from types import FrameType
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

import click
import msgspec
from click.shell_completion import CompletionItem
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.measure import Measurement
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.segment import Segment
from rich.table import Column, Table
from rich.text import Text, TextType

from thenar.drivers.names import shortened, shown

if TYPE_CHECKING:
    from thenar.runtime.harness.wiring import Harness

Found = TypeVar("Found")
Rest = ParamSpec("Rest")
Command = TypeVar("Command", bound=Callable[..., Any])

_LONGEST_METAVAR = 30
_UNBOUNDED, _READABLE = 10_000, 24
_JSON, _OVERWRITE = "thenar.json", "thenar.overwrite"
# Left unescaped by JSON, but perhaps unsafe for a terminal or an encoding.
_DOUBTFUL = re.compile(r"[^\n -~]")
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
WEB_ADDRESS = "127.0.0.1:8080"


class OutputFile(click.Path):
    """A file to write, in an existing folder: the one rule for all commands, checked before any work.

    Its name ends in one of `endings`, which selects the format. An existing file is replaced only with
    `overwrite_flag`, unless the command `goes_on` in it.
    """

    def __init__(self, *endings: str, goes_on: bool = False) -> None:
        super().__init__(dir_okay=False, writable=True, path_type=Path)
        self.endings, self.goes_on = endings, goes_on

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path. Raises BadParameter if the rule forbids it."""
        from thenar.runtime.files import is_special

        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if not path.name:
            self.fail("The output file needs a name.", param, ctx)
        if not path.name.lower().endswith(self.endings):
            self.fail(f"{path.name}: the name of the output file must end in {_either(self.endings)}.", param, ctx)
        if not path.parent.is_dir():
            self.fail(f"There is no folder '{path.parent}' to write '{path.name}' into: create it first.", param, ctx)
        if not os.access(path.parent, os.W_OK):
            self.fail(f"Folder '{path.parent}' is not writable: name another, or change its permissions.", param, ctx)
        if is_special(path):
            self.fail(f"'{path}' is a device or a pipe: name a file.", param, ctx)
        if path.exists() and not (self.goes_on or overwrites(ctx)):
            self.fail(f"{path} already exists: add --overwrite to replace it, or name another file.", param, ctx)
        return path


class OutputFolder(click.Path):
    """A folder to write, created if needed; its writer decides whether thenar may replace its content.

    A `fresh` folder must be empty, unless `overwrite_flag` is given.
    """

    def __init__(self, *, fresh: bool = False) -> None:
        super().__init__(file_okay=False, writable=True, path_type=Path)
        self._fresh = fresh

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path. Raises BadParameter if no folder can be created there."""
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if not str(value):
            self.fail("The output folder needs a name.", param, ctx)
        above = next(parent for parent in (path, *path.absolute().parents) if parent.exists())
        if not above.is_dir():
            self.fail(f"'{above}' is not a folder, so nothing can be written below it: name another.", param, ctx)
        if not os.access(above, os.W_OK):
            self.fail(f"Folder '{above}' is not writable: name another, or change its permissions.", param, ctx)
        if self._fresh and above == path and any(path.iterdir()) and not overwrites(ctx):
            self.fail(f"{path} is not empty: add --overwrite to replace files in it, or name another.", param, ctx)
        return path


class Number(click.FloatRange):
    """A finite number, optionally within a range."""

    def _describe_range(self) -> str:
        # click's own describes an unlimited range as "x<=None".
        return super()._describe_range() if (self.min, self.max) != (None, None) else ""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number. Raises BadParameter for nan, inf, and numbers outside the range."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


def overwrites(context: click.Context | None) -> bool:
    """Return whether existing files may be replaced."""
    return context is not None and bool(context.meta.get(_OVERWRITE))


def _either(names: Sequence[str]) -> str:
    """Return "a, b or c"."""
    return " or ".join(filter(None, (", ".join(names[:-1]), names[-1])))


class OneOf(click.Choice[str]):
    """One name of a kind; the names are read when first needed, not when a command is defined.

    `otherwise` is a sentence added to the error for an unknown name.
    """

    def __init__(self, kind: str, names: Callable[[], Iterable[str]], otherwise: str = "") -> None:
        self.kind, self._names, self.case_sensitive, self._otherwise = kind, names, True, otherwise

    @property
    def choices(self) -> tuple[str, ...]:  # type: ignore[override]
        """The names."""
        return tuple(self._names())

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the name. Raises BadParameter, with the most similar names, if it is unknown."""
        from thenar.runtime.names import nearest

        if value not in self.choices:
            near = nearest(str(value), self.choices)
            others = "" if "did you mean" in near else f": choose one of {', '.join(self.choices)}"
            self.fail(f"there is no {self.kind} {shortened(repr(value))}{others or near}.{self._otherwise}", param, ctx)
        return value

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        """Return the names if they fit a line of help, else the kind."""
        names = "|".join(self.choices)
        return f"[{names}]" if len(names) <= _LONGEST_METAVAR else self.kind.upper()


class ListOf(click.ParamType[tuple[str, ...]]):
    """Several names of a kind, separated by commas; where `none` is allowed, it means the empty list."""

    def __init__(self, kind: str, names: Callable[[], Iterable[str]], *, none: bool = False) -> None:
        self.name, self._one, self._none = f"{kind}s", OneOf(kind, names), none

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, ...]:
        """Return the names, each once, in the order given. Raises BadParameter for a wrong one."""
        if isinstance(value, tuple):
            return value
        if self._none and value == "none":
            return ()
        return tuple(self._one.convert(part, param, ctx) for part in comma_separated(value))

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        """Return the placeholder that shows how to write the list."""
        return f"{self._one.kind.upper()},..."

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Complete the name after the last comma."""
        before, comma, last = incomplete.rpartition(",")
        return [CompletionItem(f"{before}{comma}{item.value}") for item in self._one.shell_complete(ctx, param, last)]


existing_file = click.Path(exists=True, dir_okay=False, path_type=Path)
existing_folder = click.Path(exists=True, file_okay=False, path_type=Path)
picture_file = OutputFile(".svg", ".png")
seed_range = click.IntRange(0, 2**63 - 1)

json_flag = click.option(
    "--json",
    is_flag=True,
    expose_value=False,
    callback=lambda context, _option, wanted: context.meta.update({_JSON: wanted}),
    help="Print one JSON document for machines instead.",
)

# Eager: the file's own check must know whether it may be replaced.
overwrite_flag = click.option(
    "--overwrite",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=lambda context, _option, wanted: context.meta.update({_OVERWRITE: wanted}),
    help="Replace existing files.",
)


def jobs_option(what: str = "Worker processes. The result does not depend on it.") -> Callable[[Command], Command]:
    """Return the option --jobs; its value is -1 for all cores."""
    return click.option(
        "--jobs",
        type=click.IntRange(min=1),
        callback=lambda _context, _option, jobs: jobs or -1,
        help=f"{what}  [default: all cores]",
    )


def _work_there(context: click.Context, _: click.Parameter, address: str | None) -> None:
    """Let the cluster at `address` do the work of the command."""
    if address is None:
        return
    if not all(address.partition("://")):
        raise click.BadParameter(f"{shortened(repr(address))} is not an address such as tcp://10.0.0.5:8786")
    from thenar.compiler.cluster import dask_cluster

    context.with_resource(dask_cluster(address))


dask_option = click.option(
    "--dask",
    expose_value=False,
    callback=_work_there,
    metavar="ADDRESS",
    help="Work on the cluster of this Dask scheduler, such as tcp://host:8786.",
)


def _token(_context: click.Context, _option: click.Parameter, wanted: bool) -> str | None:
    from thenar.runtime.web.guard import new_token

    return new_token() if wanted else None


web_token_option = click.option(
    "--web-token",
    is_flag=True,
    callback=_token,
    help="Show the page only to those with its full address; required if other machines can reach it.",
)


def web_options(command: Command) -> Command:
    """Add --web and --web-token: the address of a page, and the token that it needs, or None."""
    option = click.option(
        "--web",
        is_flag=False,
        flag_value=WEB_ADDRESS,
        metavar="[ADDRESS]",
        help=f"Show a page in the browser.  [{WEB_ADDRESS}]",
    )
    return option(web_token_option(command))


def comma_separated(text: str) -> tuple[str, ...]:
    """Return the comma-separated parts of `text`, each once, in the order given."""
    return tuple(dict.fromkeys(part.strip() for part in text.split(",")))


def keep_apart(*paths: Path | None) -> None:
    """Raise UsageError if two of the `paths` of a command are the same file: writing one would destroy the other."""
    seen = set()
    for path in filter(None, paths):
        if path.resolve() in seen:
            raise click.UsageError(
                f"{path} is named twice, and writing it would destroy the other: name two different files"
            )
        seen.add(path.resolve())


def check_devices(harness: "Harness", path: Path) -> None:
    """Raise UsageError if the `harness` in `path` names no device: there would be nothing to read."""
    if not (harness.cyberglove or harness.buses or harness.spi or harness.streams):
        takes = "add a [cyberglove], a [[bus]], an [[spi]] or a [[stream]]"
        raise click.UsageError(f"{path.name} names no device: {takes}")


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


class _Console(Console):
    """A console that escapes control characters in names; styles are rich's."""

    def render_str(self, text: str, **options: Any) -> Text:
        # Escaped before it is measured, so that column widths fit.
        return super().render_str(shown(text), **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(shown(segment.text), segment.style)


def out() -> Console:
    """Return the console for results; its lines are 200 characters wide outside a terminal."""
    console = _console()
    return console if console.is_terminal else _console(width=200)


def err() -> Console:
    """Return the console for warnings and progress."""
    return _console(stderr=True)


def warning(sentence: str) -> None:
    """Print a warning on stderr."""
    echo(f"warning: {sentence}", err=True)


def _console(stderr: bool = False, width: int | None = None) -> Console:
    # Names of the user's columns and files may hold brackets and colons: they are not markup.
    return _Console(stderr=stderr, width=width, highlight=False, markup=False, emoji=False)


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


class _Whole(Table):
    """A table that truncates nothing: one that is too wide is split into several, each with the first column."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the lines of each part."""
        room = options.max_width - 1
        parts: list[list[Column]] = [[]]
        for column in self.columns:
            used = [self._width(each, console, options) for each in (*parts[-1], column)]
            if len(used) > 2 and sum(used) > room:
                parts.append([self.columns[0]])
            parts[-1].append(column)
        for number, columns in enumerate(parts):
            part = self._part(columns)
            part.title = self.title if number == 0 else None
            yield from Table.__rich_console__(part, console, options)

    def _part(self, columns: Sequence[Column]) -> "_Whole":
        part = copy(self)
        part.columns = [replace(column, _index=index) for index, column in enumerate(columns)]
        return part

    def _width(self, column: Column, console: Console, options: ConsoleOptions) -> int:
        """Return the width that a column needs with one line: words wrap, but not to one word per line."""
        needed = Measurement.get(console, options.update_width(_UNBOUNDED), self._part([column]))
        most = needed.maximum if column.no_wrap else max(needed.minimum, min(needed.maximum, _READABLE))
        return most - 1


def table(
    columns: Iterable[str],
    numbers: Container[str] = (),
    title: TextType | None = None,
    rows: Iterable[Iterable[RenderableType]] = (),
) -> Table:
    """Return a table of these columns, with `numbers` aligned right."""
    made = _Whole(title=title)
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


@contextmanager
def ended_by_signals() -> Iterator[Event]:
    """Yield an event that SIGINT, SIGTERM and SIGHUP set; a second SIGINT interrupts as usual.

    A signal that the parent process ignores (`nohup`) stays ignored.
    """
    stop = Event()

    def end(number: int, _frame: FrameType | None) -> None:
        signal.signal(number, before[signal.Signals(number)])
        # In a thread, because this handler may interrupt code that holds the lock of `stop`.
        Thread(target=stop.set, name="thenar end", daemon=True).start()

    heard = [number for number in _ENDING if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, end) for number in heard}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

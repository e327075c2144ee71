"""What the sub-commands share: paths, the `--json` flag, consoles, and a progress bar for work longer than a second."""

import os
from collections.abc import Callable, Container, Iterable, Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

import click
import msgspec
from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.segment import Segment
from rich.table import Table
from rich.text import Text, TextType

from thenar.drivers.names import shortened

from .lines import echo, echo_json, shown

if TYPE_CHECKING:
    from thenar.runtime.harness.wiring import Harness

Found = TypeVar("Found")
Rest = ParamSpec("Rest")
Command = TypeVar("Command", bound=Callable[..., Any])

_JSON = "thenar.json"


class _OutputFile(click.Path):
    """A file to write: no folder, in a folder that is there, so that no long work ends in an error."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        from thenar.runtime.files import is_special

        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if not path.name:
            self.fail("A file to write needs a name.", param, ctx)
        if not path.parent.is_dir():
            self.fail(f"There is no folder '{path.parent}' to write '{path.name}' into: make it first.", param, ctx)
        if not os.access(path.parent, os.W_OK):
            self.fail(f"Nothing may be written into folder '{path.parent}'.", param, ctx)
        if is_special(path):
            self.fail(f"'{path}' is a device or a pipe: name a file.", param, ctx)
        return path


class _PictureFile(_OutputFile):
    """A picture to write, of a kind that can be drawn."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        path = super().convert(value, param, ctx)
        if path.suffix.lower() not in (".png", ".svg"):
            self.fail(f"{path.name}: a picture ends in .png or .svg", param, ctx)
        return path


class Listed(click.Choice[str]):
    """One of the names of a registry, which is read when it is first needed and not when a command is defined."""

    def __init__(self, names: Callable[[], Iterable[str]]) -> None:
        self._names, self.case_sensitive = names, True

    @cached_property
    def choices(self) -> tuple[str, ...]:  # type: ignore[override]
        """The names."""
        return tuple(self._names())


existing_file = click.Path(exists=True, dir_okay=False, path_type=Path)
existing_folder = click.Path(exists=True, file_okay=False, path_type=Path)
any_path = click.Path(path_type=Path)
output_file = _OutputFile(dir_okay=False, writable=True, path_type=Path)
picture_file = _PictureFile(dir_okay=False, writable=True, path_type=Path)

json_flag = click.option(
    "--json",
    is_flag=True,
    expose_value=False,
    callback=lambda context, _option, wanted: context.meta.update({_JSON: wanted}),
    help="Print one JSON document for machines instead.",
)


def jobs_option(what: str = "Worker processes. The result does not depend on it.") -> Callable[[Command], Command]:
    """Return the option --jobs, which is -1 for all cores."""
    return click.option(
        "--jobs",
        type=click.IntRange(min=1),
        callback=lambda _context, _option, jobs: jobs or -1,
        help=f"{what}  [default: all cores]",
    )


def parted(text: str) -> tuple[str, ...]:
    """Return what stands between the commas of `text`, each once, in the order given."""
    return tuple(dict.fromkeys(part.strip() for part in text.split(",")))


def serial_port(context: click.Context, parameter: click.Parameter, text: str) -> str:
    """Return `text` if it is a port, by the rule that holds for those in files."""
    from thenar.drivers.ports import port_fault

    if fault := port_fault(text):
        raise click.BadParameter(f"{shortened(repr(text))} {fault}")
    return text


def keep_apart(*paths: Path | None) -> None:
    """Raise UsageError if two of the `paths` of one command are the same file: writing one would destroy the other."""
    seen = set()
    for path in filter(None, paths):
        if path.resolve() in seen:
            raise click.UsageError(
                f"{path} is named twice: what is written there would replace what is read or written"
            )
        seen.add(path.resolve())


def check_devices(harness: "Harness", path: Path) -> None:
    """Raise UsageError if the `harness` in `path` names no device: whatever is done with it would come to nothing."""
    if harness.cyberglove is None and not harness.scanners and not harness.buses:
        raise click.UsageError(f"{path.name} names no device: it takes a [cyberglove], a [[scanner]] or a [[bus]]")


class _Console(Console):
    """A console that escapes whatever a name might order a terminal to do; styles are rich's own."""

    def render_str(self, text: str, **options: Any) -> Text:
        # Escaped before it is measured, so that columns are as wide as what is in them.
        return super().render_str(shown(text), **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(shown(segment.text), segment.style)


def out() -> Console:
    """Return the console for results. Wide tables are not cut when piped into a file."""
    console = _console()
    return console if console.is_terminal else _console(width=200)


def err() -> Console:
    """Return the console for warnings and progress."""
    return _console(stderr=True)


def warning(sentence: str) -> None:
    """Print a warning on stderr."""
    echo(f"warning: {sentence}", err=True)


def _console(stderr: bool = False, width: int | None = None) -> Console:
    # The names of the user's columns and files may hold brackets and colons, which are no markup.
    return _Console(stderr=stderr, width=width, highlight=False, markup=False, emoji=False)


def wants_json() -> bool:
    """Return whether --json was given."""
    return bool(click.get_current_context().meta[_JSON])


def print_json(result: Any) -> None:
    """Print `result` (msgspec struct, dataclass or builtin) as one indented JSON document on stdout."""
    echo_json(_json(result).decode())


def show(
    found: Found, people: Callable[Concatenate[Found, Rest], None], *rest: Rest.args, **named: Rest.kwargs
) -> None:
    """Print `found` as JSON where --json asks for that, otherwise by `people`."""
    if wants_json():
        print_json(found)
    else:
        people(found, *rest, **named)


def write_json(path: Path, found: Any) -> None:
    """Write `found` as one indented JSON document."""
    from thenar.runtime.files import write_atomically

    write_atomically(path, _json(found) + b"\n")


def _json(found: Any) -> bytes:
    return msgspec.json.format(msgspec.json.encode(found), indent=2)


def table(columns: Iterable[str], numbers: Container[str] = (), title: TextType | None = None) -> Table:
    """Return a table of these columns, of which `numbers` are on the right."""
    made = Table(title=title)
    for column in columns:
        made.add_column(column, justify="right" if column in numbers else "left")
    return made


@contextmanager
def progress(what: str) -> Iterator[Callable[[int, int], None]]:
    """Yield report(done, total), which draws a bar on stderr when that is a terminal and nothing otherwise."""
    console = err()
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
    """Return `state` as a sentence about the device `name`, whose port is not named twice."""
    kind, _, port = name.partition(" at ")
    return f"{kind if port and port in state else name}: {state}"

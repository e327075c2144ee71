"""Types of options, and options that several commands share."""

import math
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.core import ParameterSource

from thenar.drivers.names import shortened

if TYPE_CHECKING:
    from thenar.runtime.harness.wiring import Harness

Command = TypeVar("Command", bound=Callable[..., Any])
_LONGEST_METAVAR = 30
_OVERWRITE = "thenar.overwrite"
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
            *others, last = self.endings
            either = f"{', '.join(others)} or {last}" if others else last
            self.fail(f"{path.name}: the name of the output file must end in {either}.", param, ctx)
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
    """A folder to write, created if needed; its writer decides whether thenar may replace its content."""

    def __init__(self) -> None:
        super().__init__(file_okay=False, writable=True, path_type=Path)

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


existing_file = click.Path(exists=True, dir_okay=False, path_type=Path)
existing_folder = click.Path(exists=True, file_okay=False, path_type=Path)
picture_file = OutputFile(".svg", ".png")
seed_range = click.IntRange(0, 2**63 - 1)

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


def _token(_context: click.Context, _option: click.Parameter, wanted: bool) -> str | None:
    if not wanted:
        return None
    from thenar.runtime.web.guard import new_token

    return new_token()


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


def refuse(where: str, *names: str) -> None:
    """Raise UsageError for a given parameter that has no effect `where`."""
    context = click.get_current_context()
    for option in context.command.params:
        if option.name in names and context.get_parameter_source(option.name) is not ParameterSource.DEFAULT:
            raise click.UsageError(f"{max(option.opts, key=len)} has no effect {where}: leave it out")


add_type_option = click.option(
    "--add-type",
    metavar="NAME",
    multiple=True,
    help="A grasp type that BUILD does not know, to be taught by three trials of it; repeatable.",
)


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

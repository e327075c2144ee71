"""The group of sub-commands, and how errors end: in a sentence and an exit code, also unexpected ones.

Each sub-command is loaded only when it is called. If the reader of a pipe goes away (`| head`), the command ends
silently with click's exit code 1.
"""

import os
import re
import sys
import tempfile
import traceback
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor
from importlib import import_module

import click

from thenar.drivers.errors import ThenarError
from thenar.drivers.extras import missing
from thenar.drivers.names import shortened

from .printing import echo

# In the order of work.
GROUPS = {
    "Data": ("import", "simulate", "info", "draw", "merge", "split", "export"),
    "Choose and measure": ("place", "studio", "evaluate", "frontier", "stability"),
    "Build": ("compile", "adapt", "compare", "verify", "spec", "firmware"),
    "Live": ("doctor", "calibrate", "record", "wear", "run", "monitor", "segment", "teach", "emulate", "service"),
}
COMMANDS = tuple(name for names in GROUPS.values() for name in names)

_PARAMETER = re.compile("``([a-z_]+)``")
_WHOLE = 1000  # letters: longer than any first sentence


class _LazyGroup(click.Group):
    """Sub-command NAME is `command` in the module `NAME_command` of this package."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] not in COMMANDS and not args[0].startswith("-") and not ctx.resilient_parsing:
            from thenar.runtime.names import nearest

            raise click.UsageError(f"No such command {shortened(repr(args[0]))}{nearest(args[0], COMMANDS)}.")
        return super().resolve_command(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands by group, with the first sentence of each one's help."""
        width = max(map(len, COMMANDS))
        for title, names in GROUPS.items():
            found = [(name.ljust(width), self.get_command(ctx, name)) for name in names]
            with formatter.section(title):
                formatter.write_dl([(name, each.get_short_help_str(_WHOLE)) for name, each in found if each])

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = import_module(f".{cmd_name}_command", __package__).command
        return command


@click.group(cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="thenar")
def thenar() -> None:
    """Find the few switches that a sensor glove needs, and build the recogniser that runs on them.

    \b
    Example, from a table to a running recogniser:
        thenar import table.csv -o set.grasps --columns columns.toml
        thenar evaluate set.grasps
        thenar frontier set.grasps -o frontier/
        thenar compile set.grasps -o build/
        thenar verify build/ set.grasps
        thenar run build/ --replay set.grasps
        thenar firmware build/ --target avr328p -o firmware/
    """


def run_group(arguments: Sequence[str]) -> int:
    """Run `thenar` with `arguments` and return its exit code; report a user's mistake in one sentence on stderr."""
    if arguments[:1] == ["help"]:
        arguments = [*arguments[1:2], "--help"]
    try:
        code = thenar.main(list(arguments), prog_name="thenar", standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as help_wanted:
        help_wanted.show()
        return 2
    except click.Abort:
        raise KeyboardInterrupt from None
    except KeyboardInterrupt:
        raise
    except BaseException as fault:
        # The reader of standard output has gone, such as `head`: click wraps the streams, in a class that was renamed.
        if isinstance(fault, SystemExit) and type(sys.stdout).__name__.endswith("PacifyFlushWrapper"):
            return 1
        echo(f"thenar: {_sentence(fault, arguments)}", err=True)
        return 2
    return code if isinstance(code, int) else 0


def _sentence(fault: BaseException, arguments: Sequence[str]) -> str:
    """Return the sentence that reports an error."""
    match fault:
        case click.ClickException():
            return fault.format_message()
        case ThenarError() | BrokenExecutor():
            # Parameters of the library, ``have``, are options of commands.
            return _PARAMETER.sub(lambda found: f"--{found[1].replace('_', '-')}", str(fault))
        case OSError():
            reason = fault.strerror or str(fault)
            return f"{fault.filename}: {reason}" if fault.filename else reason
        case MemoryError():
            return f"not enough memory ({fault}): use fewer rows or columns"
        case ModuleNotFoundError():
            return missing(fault.name or "", *arguments[:1])
    return _kept(fault)


def _kept(fault: BaseException) -> str:
    """Write the traceback of an unexpected error to a file that only its owner can read; return the message, with the
    module that raised it: it may be that of another package.
    """
    *_, (frame, _) = traceback.walk_tb(fault.__traceback__)
    what = f"unexpected {type(fault).__name__} in {frame.f_globals.get('__name__')}: this is a bug"
    try:
        descriptor, path = tempfile.mkstemp(prefix="thenar-", suffix=".txt")
        with os.fdopen(descriptor, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write("".join(traceback.format_exception(fault)))
    except OSError as reason:
        return f"{what}, and its traceback could not be written ({reason.strerror}); please report it"
    return f"{what}; please report it with the file {path}, which holds the traceback"

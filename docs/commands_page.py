"""A mkdocs hook that adds the page of all commands, what `--help` prints, and the table of a recipe's choices."""

import click
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from thenar.cli.choices import choices
from thenar.cli.group import COMMANDS, thenar

PAGE = "reference/all-commands.md"
BEFORE = """# All commands and options

This page is made from the commands themselves: `thenar COMMAND --help` prints the same. The rules that all of them
follow are described in [the command line](commands.md).

## The recipe

`compile`, `place` and `evaluate` share these choices, and `thenar.compiler.Recipe` has them as fields. If you change
one, its part and all later parts are computed again: placement and limits, training, tables, rates.

"""


def help_of(name: str) -> str:
    """Return the output of `thenar NAME --help`, 88 columns wide."""
    command = thenar.get_command(click.Context(thenar), name)
    assert command is not None
    context = click.Context(command, info_name=f"thenar {name}", terminal_width=88, max_content_width=88)
    return command.get_help(context)


def recipe_table() -> str:
    """Return the table of all choices of a recipe."""
    lines = ["| option | parameter | part | default | range | what it is |", "|---|---|---|---|---|---|"]
    for choice in choices().values():
        ends = ["" if end is None else f"{end:g}" for end in (choice.least, choice.most)]
        span = ", ".join(map(str, choice.names)) or (" to ".join(ends) if any(ends) else "")
        default = choice.usual or ("" if choice.default in (None, (), {}) else choice.default)
        # Settings of a trainer have an option each.
        option = "" if choice.kind is dict else f"`--{choice.option.replace('_', '-')}`"
        lines.append(f"| {option} | `{choice.name}` | {choice.part} | {default} | {span} | {choice.help} |")
    return "\n".join(lines)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the page; called by mkdocs."""
    sections = [f"\n## {name}\n\n```text\n{help_of(name)}\n```\n" for name in COMMANDS]
    files.append(File.generated(config, PAGE, content=BEFORE + recipe_table() + "\n" + "".join(sections)))
    return files

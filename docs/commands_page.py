"""A mkdocs hook that adds the page of all commands: what `--help` prints, taken from click."""

import click
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from thenar.cli.group import COMMANDS, thenar

PAGE = "reference/all-commands.md"
BEFORE = """# All commands and options

This page is made from the commands themselves: `thenar COMMAND --help` prints the same. The rules that all of them
follow are described in [the command line](commands.md).
"""


def help_of(name: str) -> str:
    """Return the output of `thenar NAME --help`, 88 columns wide."""
    command = thenar.get_command(click.Context(thenar), name)
    assert command is not None
    context = click.Context(command, info_name=f"thenar {name}", terminal_width=88, max_content_width=88)
    return command.get_help(context)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the page; called by mkdocs."""
    sections = [f"\n## {name}\n\n```text\n{help_of(name)}\n```\n" for name in COMMANDS]
    files.append(File.generated(config, PAGE, content=BEFORE + "".join(sections)))
    return files

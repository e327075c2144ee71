"""The templates of a board's firmware, filled in."""

from importlib.metadata import version
from textwrap import fill

from thenar.firmware_templates.rendering import render


def text(file: str, /, **values: object) -> str:
    """Return the text of `file`, a template of firmware_templates/avr without its ".j2", with its origin."""
    template = f"avr/{file}.j2"
    return render(template, origin=f"thenar {version('thenar')}, template {template}.", **values)


def pair(file: str, /, **values: object) -> dict[str, str]:
    """Return name -> text of the header and the source called `file`."""
    return {f"{file}.{end}": text(f"{file}.{end}", **values) for end in "hc"}


def wrapped(words: str, indent: int) -> str:
    """Return what is to stand in a comment of C after `indent` columns, broken into lines of at most 120 of them."""
    blanks = " " * indent
    return fill(words, 117, initial_indent=blanks, subsequent_indent=blanks, break_on_hyphens=False).lstrip()

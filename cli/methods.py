"""Placement methods on the command line: lists of their names, and what there is in the help texts."""

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from thenar.compiler.placement.methods.base import Method


def method_names(_: click.Context, __: click.Parameter, text: str | None) -> tuple[str, ...] | None:
    """Return the names in `text`, parted by commas; "none" names none. Raises MemberError for a wrong name."""
    from thenar.compiler.placement.methods.base import METHODS

    if text is None:
        return None
    names = dict.fromkeys(name.strip() for name in text.split(",") if name.strip() and name.strip() != "none")
    return tuple(METHODS.named(name).name for name in names)


class WithMethods(click.Command):
    """A command whose help ends with all placement methods."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write each method's name and what it does."""
        from thenar.compiler.placement.methods.base import METHODS

        super().format_epilog(ctx, formatter)
        with formatter.section("Placement methods"):
            formatter.write_dl([(name, f"{method.help}{_remarks(method)}.") for name, method in METHODS.items()])


def _remarks(method: "Method") -> str:
    """Return what a user has to know besides, in brackets."""
    remarks = [] if method.ours else ["rival"]
    remarks += [f"pip install {method.install}"] if method.install else []
    return f" ({'; '.join(remarks)})" if remarks else ""

"""Options of several commands: the placement methods and the trainers, read from their registries."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from .common import parted

if TYPE_CHECKING:
    from thenar.compiler.placement.methods.base import Method
    from thenar.compiler.trainers.base import Setting


def method_names(_: click.Context, __: click.Parameter, text: str | None) -> tuple[str, ...] | None:
    """Return the names in `text`, parted by commas; "none" names none. Raises MemberError for a wrong name."""
    from thenar.compiler.placement.methods.base import METHODS

    if text is None:
        return None
    return tuple(METHODS.named(name).name for name in parted(text) if name not in ("", "none"))


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


def trainer_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--trainer` and an option for each setting of a trainer."""
    from thenar.compiler.trainers.base import TRAINERS

    settings = {setting.name: setting for trainer in TRAINERS.values() for setting in trainer.settings}
    for setting in reversed(settings.values()):
        command = _option(setting)(command)
    names = ", ".join(f"{trainer.name} ({trainer.what})" for trainer in TRAINERS.values())
    choice = click.Choice(list(TRAINERS))
    return click.option(
        "--trainer", type=choice, default="logitboost", show_default=True, help=f"What makes the model: {names}."
    )(command)


def asked_settings(context: click.Context, asked: dict[str, Any]) -> dict[str, Any]:
    """Take what `trainer_options` added out of `asked`; return the trainer, and its settings that are no defaults.

    Raises UsageError for a setting that is given to a trainer that takes none of that name.
    """
    from thenar.compiler.trainers.base import TRAINERS

    trainer = asked.pop("trainer")
    own = {setting.name: setting.default for setting in TRAINERS[trainer].settings}
    found: dict[str, Any] = {"trainer": trainer}
    for name in {setting.name for each in TRAINERS.values() for setting in each.settings}:
        value = asked.pop(name)
        if name in own:
            found |= {} if value == own[name] else {name: value}
        elif context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE:
            raise click.UsageError(f"--{name.replace('_', '-')} is no setting of --trainer {trainer}: leave it out.")
    return found


def _option(setting: "Setting") -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    least = setting.least
    kind: click.ParamType[Any] = click.INT if setting.kind is int else click.FLOAT
    if least is not None:
        kind = click.IntRange(int(least)) if setting.kind is int else click.FloatRange(least)
    name, shown = f"--{setting.name.replace('_', '-')}", setting.default is not None
    return click.option(name, setting.name, type=kind, default=setting.default, show_default=shown, help=setting.what)

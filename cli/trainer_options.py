"""The options of commands that train: which trainer, and the settings of every one, read from the registry."""

from collections.abc import Callable, Collection
from typing import Any

import click

from thenar.compiler.trainers.base import TRAINERS, Setting


def trainer_options(command: Callable[..., Any], without: Collection[str] = ()) -> Callable[..., Any]:
    """Add `--trainer` and an option for each setting of a trainer, `without` those that the command has itself."""
    settings = {setting.name: setting for trainer in TRAINERS.values() for setting in trainer.settings}
    for setting in reversed([setting for name, setting in settings.items() if name not in without]):
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


def _option(setting: Setting) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    least = setting.least
    kind: click.ParamType[Any] = click.INT if setting.kind is int else click.FLOAT
    if least is not None:
        kind = click.IntRange(int(least)) if setting.kind is int else click.FloatRange(least)
    name, shown = f"--{setting.name.replace('_', '-')}", setting.default is not None
    return click.option(name, setting.name, type=kind, default=setting.default, show_default=shown, help=setting.what)

"""Options of several commands: the placement methods and the trainers, read from their registries."""

from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .common import Listed, existing_file, parted

if TYPE_CHECKING:
    from thenar.compiler.hand import HandShape
    from thenar.compiler.placement.methods.base import Method
    from thenar.compiler.trainers.base import Setting


layout_option = click.option(
    "--layout", type=existing_file, help="Your glove: a drawing (.svg) or a list (.toml) of where its switches lie."
)


def hand_of(layout: Path | None) -> "HandShape":
    """Return the glove in the file `layout`, else the one that thenar draws. Raises MapError."""
    if layout is None:
        from thenar.simulator.handmaps.handmap import hand_map

        return hand_map()
    from thenar.compiler.layouts import load_layout

    return load_layout(layout)


def fitted_hand(layout: Path | None, names: Sequence[str], length_mm: float | None) -> "HandShape | None":
    """Return the hand with the switches `names`; None where nobody knows where they lie.

    Raises UsageError for a length that cannot be given to it, MapError for a layout without one of them.
    """
    hand = hand_of(layout)
    if layout is not None and length_mm is not None:
        raise click.UsageError("--hand-length: the switches of a --layout lie where it says; leave one of them out")
    if layout is not None:
        hand.numbers_of(names)
    elif length_mm is not None and hand.fitted(names) is None:
        raise click.UsageError(
            "--hand-length is of the hand that thenar draws, and these switches are not on it: give a --layout instead"
        )
    return hand.fitted(names, length_mm)


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


def _names() -> Iterable[str]:
    from thenar.compiler.trainers.base import TRAINERS

    return TRAINERS


class _TrainerOption(click.Option):
    """Its help, which is only made when it is asked for, says what each trainer is."""

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        from thenar.compiler.trainers.base import TRAINERS

        names = ", ".join(f"{trainer.name} ({trainer.what})" for trainer in TRAINERS.values())
        self.help = f"What makes the model: {names}."
        return super().get_help_record(ctx)


trainer_option = click.option(
    "--trainer", type=Listed(_names), default="logitboost", show_default=True, cls=_TrainerOption
)


class Training(WithMethods):
    """A command with `trainer_option`: an option for each setting of a trainer follows it, without those that the
    command has itself. The trainers are imported when the options are asked for, not when the command is defined.
    """

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Return the options of the command, and those of the trainers."""
        params = super().get_params(ctx)
        names = [param.name for param in params]
        place = names.index("trainer") + 1
        return [*params[:place], *(each for each in self._settings if each.name not in names), *params[place:]]

    @cached_property
    def _settings(self) -> tuple[click.Option, ...]:
        from thenar.compiler.trainers.base import TRAINERS

        settings = {setting.name: setting for trainer in TRAINERS.values() for setting in trainer.settings}
        return tuple(map(_option, settings.values()))


def asked_settings(context: click.Context, asked: dict[str, Any]) -> dict[str, Any]:
    """Take what the options of a `Training` command say of the trainer out of `asked`; return the trainer, and its
    settings that are no defaults.

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


def _option(setting: "Setting") -> click.Option:
    least = setting.least
    kind: click.ParamType[Any] = click.INT if setting.kind is int else click.FLOAT
    if least is not None:
        kind = click.IntRange(int(least)) if setting.kind is int else click.FloatRange(least)
    decls, shown = [f"--{setting.name.replace('_', '-')}", setting.name], setting.default is not None
    return click.Option(decls, type=kind, default=setting.default, show_default=shown, help=setting.what)

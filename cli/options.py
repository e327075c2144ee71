"""Options shared by several commands: the placement methods and the trainers, read from their registries."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from thenar.runtime.recipe import AUTO

from .choices import Choice, choices
from .parameters import Command, ListOf, Number, OneOf, comma_separated, existing_file
from .printing import warning

if TYPE_CHECKING:
    from thenar.compiler.glove.prices import Part
    from thenar.compiler.hand import HandShape
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.compiler.trainers.base import Setting
    from thenar.runtime.harness.wiring import GloveWiring
    from thenar.runtime.recipe import Recipe

    Sections = dict[str, list[tuple[str, str]]]


def _methods() -> Iterable[str]:
    from thenar.compiler.placement.methods.base import METHODS

    return METHODS


def _trainers() -> Iterable[str]:
    from thenar.compiler.trainers.base import TRAINERS

    return TRAINERS


method_name = OneOf("method", _methods)
method_list = ListOf("method", _methods, none=True)


def _names(_: click.Context, __: click.Parameter, text: str | None) -> tuple[str, ...]:
    return () if text is None else comma_separated(text)


# Fields of a recipe: those that limit a placement, and all that it depends on but the inputs.
LIMITS = ("have", "never", "apart_mm", "at_most_taxels", "budget_us", "price")
CHOOSING = ("sensors", "placement", "keep", "levels", "keep_joints", "prune", *LIMITS, "robust")


def recipe_options(*names: str, **changes: Any) -> Callable[[Command], Command]:
    """Return a decorator that adds an option for each of these fields of a `Recipe`, in this order; `changes` replace
    properties of a `Choice`.
    """
    described = choices()

    def add(command: Command) -> Command:
        for name in reversed(names):
            command = _recipe_option(replace(described[name], **changes))(command)
        return command

    return add


def _recipe_option(choice: Choice) -> Callable[[Command], Command]:
    """Return the option for a field of a `Recipe`."""
    named = f"--{choice.option.replace('_', '-')}", choice.name
    usual = f"  [default: {choice.usual}]" if choice.usual else ""
    about: dict[str, Any] = {"help": f"{choice.help}{usual}", "metavar": choice.metavar}
    if choice.kind is bool:
        return click.option(*named, is_flag=True, **about)
    if choice.kind is tuple:
        return click.option(*named, callback=_names, **about)
    kind = _kind_of(choice)
    if choice.unit:
        about |= {"type": (kind, click.Choice([choice.unit])), "metavar": f"N {choice.unit}"}
        return click.option(*named, callback=lambda _context, _parameter, value: value and value[0], **about)
    if choice.kind is int and choice.names:
        about["callback"] = lambda _context, _parameter, value: int(value)
    default = choice.default if choice.default is None or not choice.names else str(choice.default)
    return click.option(*named, type=kind, default=default, show_default=default is not None, **about)


def _kind_of(choice: Choice) -> click.ParamType[Any]:
    """Return the type that converts the text of an option."""
    if choice.name == "placement":
        return method_name
    if choice.names:
        return click.Choice([str(name) for name in choice.names])
    if choice.kind is float:
        return Number(choice.least, choice.most, min_open=choice.open)
    least, most = (None if end is None else int(end) for end in (choice.least, choice.most))
    return click.IntRange(least, most)


glove_option = click.option(
    "--glove",
    type=existing_file,
    help="A glove.toml: the costs of its ports, for methods and limits that weigh them.  [default: MCP23017]",
)


prices_option = click.option(
    "--prices",
    type=existing_file,
    help="Parts and prices of the sensors, a .toml file; the cheaper of two alike is chosen, the bill lists the parts.",
)


def parts_of(grasp_set: "GraspSet", prices: Path | None) -> "Mapping[str, Part]":
    """Return the part for each sensor of a set by a file; none without a file."""
    from thenar.compiler.glove.prices import load_prices

    return {} if prices is None else load_prices(prices, (*grasp_set.element_names, *grasp_set.joint_names))


def prices_of(grasp_set: "GraspSet", prices: Path | None) -> dict[str, float]:
    """Return the price of each sensor of a set by a file; none without a file."""
    return {name: part.price for name, part in parts_of(grasp_set, prices).items()}


def terms_of(
    recipe: "Recipe", grasp_set: "GraspSet", layout: Path | None, glove: Path | None, prices: Path | None
) -> dict[str, Any]:
    """Return the costs and the limits under which a recipe chooses elements of a set: the arguments `ports` and
    `limits` of the library.

    Raises UsageError for files that the recipe does not use, and for a glove that lacks an element of the set.
    """
    from thenar.compiler.placement.constraints import Limits
    from thenar.compiler.placement.methods.base import METHODS
    from thenar.compiler.placement.ports import ports_of_whole_glove
    from thenar.runtime.harness.loading import load_harness
    from thenar.runtime.scanning.plan import unwired

    if layout is not None and recipe.apart_mm is None:
        raise click.UsageError("--layout gives positions for --apart-mm: add that")
    weighs = METHODS.named(recipe.placement).uses_ports or recipe.budget_us is not None
    if glove is not None and not weighs:
        weighing = ", ".join(name for name, method in METHODS.items() if method.uses_ports)
        raise click.UsageError(f"--glove gives the scan costs: use it with a --method that weighs them: {weighing}")
    harness = None if glove is None else load_harness(glove)
    if harness is not None and (lacking := unwired(harness, grasp_set.element_names)):
        raise click.UsageError(f"{glove} does not wire {min(lacking)!r} of the set: name the whole glove's glove.toml.")
    cyberglove = None if harness is None else harness.cyberglove
    warn_of_budget(recipe.budget_us, grasp_set.joint_names if recipe.keep_joints else (), cyberglove)
    priced = prices_of(grasp_set, prices)
    places = hand_of(layout).by_name if recipe.apart_mm else {}
    ports = ports_of_whole_glove(harness, grasp_set.element_names, len(grasp_set.taxel_columns))
    return {"ports": ports if weighs else None, "limits": Limits.of(recipe, grasp_set, places, cyberglove, priced)}


def warn_of_budget(budget_us: float | None, joints: Sequence[str], glove: "GloveWiring | None") -> None:
    """Warn about time that `--budget-us` cannot limit."""
    from thenar.compiler.placement.ports import record_times_us

    if budget_us is not None and joints and not record_times_us(joints, glove):
        warning(
            "--budget-us limits only the scan of switches and taxels: the reading time of joints is known only for a "
            "CyberGlove, and these joints are not one's"
        )


class LazyOption(click.Option):
    """An option whose help is only made when requested, by `describe`."""

    def __init__(self, *args: Any, describe: Callable[[], str], **named: Any) -> None:
        super().__init__(*args, **named)
        self._describe = describe

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """Return the option and its help."""
        self.help = self._describe()
        return super().get_help_record(ctx)


def _trainers_help() -> str:
    from thenar.compiler.trainers.base import TRAINERS

    names = ", ".join(f"{trainer.name} ({trainer.what})" for trainer in TRAINERS.values())
    chosen = f"{AUTO}: chosen by folds of the training rows, among those that take the given settings"
    return f"What trains the model: {names}; {chosen}."


def trainer_option(default: str) -> Callable[[Command], Command]:
    """Return the option --trainer; if its default is AUTO, so are the defaults of the settings."""
    kind = OneOf("trainer", lambda: (AUTO, *_trainers()))
    about: dict[str, Any] = {"default": default, "show_default": True, "describe": _trainers_help}
    return click.option("--trainer", type=kind, cls=LazyOption, **about)


class Described(click.Command):
    """A command whose help ends with `sections`, a title and names with descriptions each, read when requested."""

    def __init__(self, *args: Any, sections: "Callable[[], Sections]", **named: Any) -> None:
        super().__init__(*args, **named)
        self._sections = sections

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the sections."""
        super().format_epilog(ctx, formatter)
        for title, lines in self._sections().items():
            with formatter.section(title):
                formatter.write_dl(lines)


def _methods_by_number() -> "Sections":
    """Return all placement methods, by the option that sets how many they keep."""
    from thenar.compiler.placement.methods.base import METHODS

    sections: Sections = {}
    for takes, by_number in (("--prune S", False), ("--keep M", True)):
        lines = sections[f"Placement methods that take {takes}"] = list[tuple[str, str]]()
        for name, method in METHODS.items():
            if method.by_number == by_number:
                lines.append((name, f"{method.help}." if method.ours else f"{method.help} (baseline)."))
    return sections


class TrainingCommand(Described):
    """A command with `trainer_option`, followed by an option for each setting of a trainer that the command does not
    define itself. The trainers are imported when the options are needed, not when the command is defined.

    Its help ends with the placement methods. With `groups` it shows the options group by group, by title: the settings
    follow the trainer, and a last group holds the rest.
    """

    def __init__(self, *args: Any, groups: Mapping[str, tuple[str, ...]] | None = None, **named: Any) -> None:
        super().__init__(*args, sections=_methods_by_number, **named)
        self.groups = groups

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Return the options of the command, and those of the trainers."""
        params = super().get_params(ctx)
        names = [param.name for param in params]
        place = names.index("trainer") + 1
        self._auto = params[place - 1].default == AUTO
        return [*params[:place], *(each for each in self._settings if each.name not in names), *params[place:]]

    @cached_property
    def _settings(self) -> tuple[click.Option, ...]:
        from thenar.compiler.trainers.base import TRAINERS

        settings = {setting.name: setting for trainer in TRAINERS.values() for setting in trainer.settings}
        chosen = {name for trainer in TRAINERS.values() for tried in trainer.tried for name in tried if self._auto}
        return tuple(_option(setting, name in chosen) for name, setting in settings.items())

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options."""
        if self.groups is None:
            super().format_options(ctx, formatter)
            return
        params = {str(param.name): param for param in self.get_params(ctx) if isinstance(param, click.Option)}
        settings = tuple(str(each.name) for each in self._settings)
        groups = {title: names + settings * ("trainer" in names) for title, names in self.groups.items()}
        grouped = {name for names in groups.values() for name in names}
        rest = tuple(name for name in params if name not in grouped)
        for title, names in {**groups, "More": rest}.items():
            records = (params[name].get_help_record(ctx) for name in names if name in params)
            if lines := [record for record in records if record]:
                with formatter.section(title):
                    formatter.write_dl(lines)


def asked_settings(context: click.Context, asked: dict[str, Any]) -> dict[str, Any]:
    """Remove the trainer's options from `asked` and return the trainer and its given settings.

    Raises UsageError for a setting that the given trainer does not have.
    """
    from thenar.compiler.trainers.base import TRAINERS

    trainer = asked.pop("trainer")
    names = {setting.name for each in TRAINERS.values() for setting in each.settings}
    own = names if trainer == AUTO else {setting.name for setting in TRAINERS[trainer].settings}
    found: dict[str, Any] = {"trainer": trainer}
    for name in names:
        value = asked.pop(name)
        if name in own:
            found |= {} if value is None else {name: value}
        elif context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE:
            raise click.UsageError(f"--{name.replace('_', '-')} is not a setting of --trainer {trainer}: leave it out.")
    return found


def _option(setting: "Setting", chosen: bool) -> click.Option:
    ends = (setting.least, setting.most)
    kind: click.ParamType[Any] = Number(*ends)
    if setting.kind is int:
        low, high = (None if end is None else int(end) for end in ends)
        kind = click.INT if ends == (None, None) else click.IntRange(low, high)
    what, _, default = setting.what.partition("  [default: ")
    default = "chosen" if chosen else default.rstrip("]") if setting.default is None else str(setting.default)
    # Without a value, click treats the option as not given.
    shown = f"{what}  [default: {default}]" if default else what
    return click.Option([f"--{setting.name.replace('_', '-')}", setting.name], type=kind, help=shown)


layout_option = click.option("--layout", type=existing_file, help="Your glove's switch positions, a .toml file.")


def hand_of(layout: Path | None) -> "HandShape":
    """Return the glove in the file `layout`, or the one that thenar draws. Raises MapError."""
    if layout is None:
        from thenar.simulator.handmaps.handmap import hand_map

        return hand_map()
    from thenar.compiler.hand import load_layout

    return load_layout(layout)


def fitted_hand(layout: Path | None, names: Sequence[str], length_mm: float | None) -> "HandShape | None":
    """Return the hand with the switches `names`, or None if their positions are unknown.

    Raises UsageError for a length that does not apply, MapError for a layout that lacks one of the switches.
    """
    hand = hand_of(layout)
    if layout is not None and length_mm is not None:
        raise click.UsageError("--hand-length cannot scale the switches of a --layout: leave one of them out")
    if layout is not None:
        hand.numbers_of(names)
    elif length_mm is not None and hand.fitted(names) is None:
        raise click.UsageError(
            "--hand-length scales the hand that thenar draws, and these switches are not on it: use --layout instead"
        )
    return hand.fitted(names, length_mm)

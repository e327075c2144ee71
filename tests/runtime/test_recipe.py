"""The recipe: its fields say all that commands and documents need."""

import click
import msgspec
import pytest

from thenar.cli.choices import choices
from thenar.cli.group import thenar
from thenar.runtime.recipe import Recipe, changed


def test_every_choice_says_what_it_is() -> None:
    described = choices()
    assert tuple(described) == Recipe.__struct_fields__
    for choice in described.values():
        assert choice.help.endswith("."), choice.name
        assert choice.default == getattr(Recipe(), choice.name)
        assert choice.least is None or choice.most is None or choice.least < choice.most


@pytest.mark.parametrize("command", ["compile", "place", "evaluate"])
def test_commands_have_the_options_of_the_recipe(command: str) -> None:
    found = thenar.get_command(click.Context(thenar), command)
    assert found is not None
    params = {param.name: param for param in found.get_params(click.Context(found))}
    # Tables of an evaluation vary the inputs and stop before integers; its folds have more kinds.
    left_out = {
        "compile": {"settings"},
        "place": {"settings", "table_bits", "width", "refuse"},
        "evaluate": {"settings", "table_bits", "width", "refuse", "inputs", "by"},
    }[command]
    for name, choice in choices().items():
        if name in left_out:
            assert name not in params
            continue
        option = params[name]
        assert f"--{choice.option.replace('_', '-')}" in option.opts
        assert isinstance(option, click.Option)
        assert option.get_help_record(click.Context(found))


def test_a_recipe_read_from_a_file_obeys_the_ranges() -> None:
    for name, choice in choices().items():
        if choice.kind in (int, float) and not choice.names and choice.least is not None:
            below = {name: choice.kind(choice.least) - (0 if choice.open else 1)}
            if name != "seed":
                with pytest.raises(msgspec.ValidationError):
                    msgspec.convert(below, Recipe)
            assert msgspec.convert({name: choice.kind(choice.least + 1)}, Recipe, strict=False) or name in "refuse"


def test_other_names_are_settings_of_the_trainer() -> None:
    recipe = changed(Recipe(settings={"penalty": 1.0, "smoothness": 3.0}), {"prune": 13, "penalty": 2.0})
    assert (recipe.prune, recipe.settings) == (13, {"penalty": 2.0, "smoothness": 3.0})

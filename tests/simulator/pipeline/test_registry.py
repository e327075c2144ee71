"""The registry of effects."""

from pathlib import Path

import pytest

from thenar.simulator import effects
from thenar.simulator.pipeline.effect import EFFECTS


@pytest.mark.parametrize("name", EFFECTS)
def test_a_record_has_parameters_with_defaults_and_one_thing_that_makes_what_acts(name: str) -> None:
    effect = EFFECTS[name]
    assert effect.name == name
    assert sum(maker is not None for maker in (effect.prepare, effect.model, effect.together)) == 1
    # A scene may list it without saying more.
    effect.parameters()()


def test_every_module_of_effects_has_the_name_of_its_effect_and_an_order_of_its_own() -> None:
    modules = {path.stem for path in Path(effects.__path__[0]).glob("*.py")} - {"__init__"}
    assert modules == {name.replace(".", "_") for name in EFFECTS}
    assert len({effect.order for effect in EFFECTS.values()}) == len(EFFECTS)

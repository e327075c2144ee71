"""The registry of effects."""

from pathlib import Path

import pytest

from thenar.simulator import effects
from thenar.simulator.pipeline.effect import EFFECTS


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effects_record_has_default_parameters_and_one_factory(name: str) -> None:
    effect = EFFECTS[name]
    assert effect.name == name
    assert sum(maker is not None for maker in (effect.prepare, effect.model, effect.together)) == 1
    # A scene may list it without saying more.
    effect.parameters()()


def test_effect_modules_have_their_effects_name_and_unique_order() -> None:
    modules = {path.stem for path in Path(effects.__path__[0]).glob("*.py")} - {"__init__"}
    assert modules == {name.replace(".", "_") for name in EFFECTS}
    assert len({effect.order for effect in EFFECTS.values()}) == len(EFFECTS)

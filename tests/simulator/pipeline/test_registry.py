"""Effects by name."""

from pathlib import Path

import pytest

from thenar.simulator import effects
from thenar.simulator.errors import SceneError
from thenar.simulator.pipeline.effect import EffectParameters
from thenar.simulator.pipeline.registry import CONTACTS, NAMES, load


@pytest.mark.parametrize("name", NAMES)
def test_a_name_loads_the_module_that_says_it_is_that_effect(name: str) -> None:
    module = load(name)
    assert module.EFFECT.name == name
    assert issubclass(module.Parameters, EffectParameters)
    assert callable(module.model if name in CONTACTS else module.prepare)
    # A scene may list it without saying more.
    assert module.Parameters() == module.Parameters()


def test_every_module_of_effects_has_its_name_and_no_name_stands_twice() -> None:
    modules = {path.stem for path in Path(effects.__path__[0]).glob("*.py")} - {"__init__"}
    assert modules == {name.replace(".", "_") for name in NAMES}
    assert len(set(NAMES)) == len(NAMES)


@pytest.mark.parametrize(
    ("wrong", "words"), [("joint.nois", "did you mean 'joint.noise'"), ("zzz", "there are: hand.style, hand.posture")]
)
def test_another_name_is_refused_with_the_nearest_or_all(wrong: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        load(wrong)

import msgspec
import pytest

from thenar.simulator import load_scene
from thenar.simulator.playing.bench import cable_of
from thenar.simulator.scenes.scene import Scene

MESSAGE = bytes(range(256)) * 400


@pytest.fixture(scope="module")
def faulty() -> Scene:
    return load_scene("faulty-glove")


def only(scene: Scene, name: str) -> Scene:
    effects = tuple(each for each in scene.effects if not each.name.startswith("wire.") or each.name == name)
    return msgspec.structs.replace(scene, effects=effects)


def test_a_scene_without_wire_effects_has_no_bad_cable() -> None:
    assert cable_of(load_scene("quick"), 0) is None


def test_bytes_are_lost_at_the_scenes_rate(faulty: Scene) -> None:
    scene = only(faulty, "wire.lost_bytes")
    rate = next(dict(each.parameters)["rate"] for each in scene.effects if each.name == "wire.lost_bytes")
    cable = cable_of(scene, 0)
    assert cable is not None
    lost = len(MESSAGE) - len(cable(MESSAGE))
    assert 0.5 * rate < lost / len(MESSAGE) < 2 * rate


def test_one_bit_of_a_damaged_byte_is_turned_at_the_scenes_rate(faulty: Scene) -> None:
    scene = only(faulty, "wire.damaged_bytes")
    rate = next(dict(each.parameters)["rate"] for each in scene.effects if each.name == "wire.damaged_bytes")
    cable = cable_of(scene, 0)
    assert cable is not None
    turned = [a ^ b for a, b in zip(MESSAGE, cable(MESSAGE), strict=True) if a != b]
    assert all(bits.bit_count() == 1 for bits in turned)
    assert 0.5 * rate < len(turned) / len(MESSAGE) < 2 * rate


def test_every_line_has_draws_of_its_own_and_they_are_repeatable(faulty: Scene) -> None:
    first, again, other = (cable_of(faulty, line) for line in (0, 0, 1))
    assert first is not None
    assert again is not None
    assert other is not None
    damaged = first(MESSAGE)
    assert damaged == again(MESSAGE)
    assert damaged != other(MESSAGE)

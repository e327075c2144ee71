from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thenar.drivers.errors import SettingError
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.harness.wiring import ChipWiring
from thenar.runtime.sources.cyberglove import GloveDevice
from thenar.simulator import load_scene
from thenar.simulator.playing.bench import Bench, cable_of, levels_of
from thenar.simulator.scenes.scene import Scene


@pytest.mark.parametrize("sensors", [18, 22])
def test_the_glove_has_as_many_sensors_as_its_harness_says(sensors: int, tmp_path: Path) -> None:
    harness = parse_harness(f'[cyberglove]\nport = "x"\nsensors = {sensors}\n', "glove.toml")
    shown = bytes(range(1, sensors + 1))
    with Bench(harness, (), tmp_path) as bench:
        bench.show([], shown)
        assert bench.harness.cyberglove is not None
        device = GloveDevice(bench.harness.cyberglove)
        try:
            device.open()
            frame = device.read(5.0)
        finally:
            device.close()
        assert frame is not None
        assert frame.sensors == shown
        with pytest.raises(SettingError, match=f"{sensors} sensors need as many bytes"):
            bench.show([], bytes(range(1, sensors)))


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


NAMES = ("a", "b", "c")


def chip(closed: str) -> ChipWiring:
    return ChipWiring(kind="pcf8574", address=0x20, pins={"P0": "a", "P3": "b", "P7": "elsewhere"}, closed=closed)  # type: ignore[arg-type]


@given(st.lists(st.booleans(), min_size=3, max_size=3))
def test_closed_switches_pull_their_pins_to_the_level_of_closed(closed: list[bool]) -> None:
    numbers = {name: number for number, name in enumerate(NAMES)}
    shut = closed[0] << 0 | closed[1] << 3
    assert levels_of(chip("high"), closed, numbers) & 0xFF == shut
    assert ~levels_of(chip("low"), closed, numbers) & 0xFF == shut

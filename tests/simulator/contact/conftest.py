"""Planned grasps of both shipped taxonomies."""

import pytest

from thenar.simulator.body.condition import Condition
from thenar.simulator.contact.balance import Skin
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import sessions
from thenar.simulator.planning.postures import Postures

SCENES = ("kamakura", "cutkosky")


@pytest.fixture(scope="session")
def planned() -> dict[str, tuple[Condition, ...]]:
    """How the first subject of both shipped scenes holds every object."""
    scenes = {name: load_scene(name) for name in SCENES}
    return {name: sessions(scene, Postures.shipped(scene.taxonomy))[0].conditions for name, scene in scenes.items()}


@pytest.fixture(scope="session")
def by_grasp(planned: dict[str, tuple[Condition, ...]]) -> dict[str, Condition]:
    """The first condition of each of Kamakura's grasp types."""
    return {condition.grasp: condition for condition in reversed(planned["kamakura"])}


@pytest.fixture(scope="session")
def skin() -> Skin:
    """Skin as the effect's defaults make it."""
    return Skin(press_n_per_mm=3.0, soft_mm=0.5, drag_n_per_mm=1.5, friction=0.8)

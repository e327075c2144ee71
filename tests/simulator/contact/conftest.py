"""Planned grasps of both shipped taxonomies, and repetitions of them."""

from collections.abc import Callable

import numpy as np
import pytest

from thenar.simulator.body.condition import Condition
from thenar.simulator.contact.balance import Skin, SolverCase
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import sessions
from thenar.simulator.planning.postures import Postures

SCENES = ("kamakura", "cutkosky")


def _planned(scene_name: str) -> tuple[Condition, ...]:
    scene = load_scene(scene_name)
    return sessions(scene, Postures.shipped(scene.taxonomy))[0].conditions


def _case(condition: Condition, n: int = 3, seed: int = 1, share: float = 1.0) -> SolverCase:
    """Return n repetitions that vary by `share` of what shipped scenes vary; 0: just as planned."""
    draw, held = np.random.default_rng(seed), condition.held
    angles = held.posture_deg[:, None] + share * 1.5 * draw.normal(size=(20, n))
    numbers = held.pose[:, None] + share * draw.normal(size=(6, n)) * np.array([1.5] * 3 + [0.044] * 3)[:, None]
    return SolverCase(condition, np.radians(angles), numbers, held.grip_n * np.exp(share * 0.25 * draw.normal(size=n)))


@pytest.fixture(scope="session")
def planned() -> dict[str, tuple[Condition, ...]]:
    """How the first subject of both shipped scenes holds every object."""
    return {name: _planned(name) for name in SCENES}


@pytest.fixture(scope="session")
def by_grasp(planned: dict[str, tuple[Condition, ...]]) -> dict[str, Condition]:
    """The first condition of each of Kamakura's grasp types."""
    return {condition.grasp: condition for condition in reversed(planned["kamakura"])}


@pytest.fixture(scope="session")
def make_case() -> Callable[..., SolverCase]:
    """Return a function of condition, number of repetitions, seed and how far they vary."""
    return _case


@pytest.fixture(scope="session")
def skin() -> Skin:
    """Skin as the effect's defaults make it."""
    return Skin(press_n_per_mm=3.0, soft_mm=0.5, drag_n_per_mm=1.5, friction=0.8)

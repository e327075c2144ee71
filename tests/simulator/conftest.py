"""A hand round a bar, batches of it, settings and scenes, as small as can be."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import pytest
from msgspec.structs import asdict

from thenar.simulator.body.condition import Condition, Pad, PlannedGrasp, Thing
from thenar.simulator.body.hand import Hand, Size
from thenar.simulator.body.shapes import Cylinder
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.effect import EFFECTS, SceneSetting
from thenar.simulator.scenes.scene import ListedEffect, Recording, Scene, SceneGlove, SceneObject, Subject
from thenar.simulator.streams import Draw, DrawCounts, Site

BAR = Cylinder(diameter_mm=40.0, length_mm=120.0)
# Fingers bent round it, the thumb in opposition, order of DOF.
ROUND_IT_DEG = np.array([40.0, 20.0, 20.0, 20.0] + [0.0, 50.0, 45.0, 30.0] * 4)
# Below the palm, along the knuckles: 90 degrees about the hand's dorsal axis.
BESIDE_THE_PALM = np.array([95.0, 0.0, -34.0, 0.0, 0.0, np.pi / 2])
# The segments whose places bear taxels, where a scene lists an effect on them: what a serial line has time for.
PADS = ("thumb_distal", "index_distal", "index_proximal", "middle_distal")
# The tips of all digits press: the last of each digit's seven spheres.
TIPS = tuple(Pad(7 * digit + 6, 0.2) for digit in range(5))


def _condition(subject: str = "A", grasp: str = "PoS", thing: str = "bar", grip_n: float = 15.0) -> Condition:
    held = PlannedGrasp(ROUND_IT_DEG, BESIDE_THE_PALM, TIPS, grip_n)
    return Condition(subject, Hand(Size(185.0, 83.0)), grasp, Thing(thing, BAR, 0.1), held)


def _batch(repetitions: Iterable[int] = range(4), condition: Condition | None = None) -> Batch:
    numbers = np.array(list(repetitions), dtype=np.int64)
    # Trials follow from the repetition alone, as they do in a session.
    return Batch(condition or _condition(), numbers, 3 * numbers, np.tile(np.zeros(20), (len(numbers), 1)))


def _setting(**changes: object) -> SceneSetting:
    usual = {
        "seed": 7,
        "session_trials": 100,
        "threshold_n": 1.0,
        "period_us": 10_000,
        "first_us": -30_000,
        "hold_us": 250_000,
        "release_us": 40_000,
        "timed": False,
        "on_wire": False,
    }
    return SceneSetting(**(usual | changes))  # type: ignore[arg-type]


def _draw(effect: str, batch: Batch, seed: int = 7) -> Draw:
    condition = batch.condition
    site = Site(condition.subject, condition.grasp, condition.thing.name, batch.repetitions)
    return Draw(seed, effect, site, DrawCounts())


def _scene(effects: Sequence[str | tuple[str, dict[str, Any]]] = (), **changes: object) -> Scene:
    pairs = [(given, {}) if isinstance(given, str) else given for given in effects]
    ordered = sorted(pairs, key=lambda pair: EFFECTS[pair[0]].order)
    whole = ((name, asdict(EFFECTS[name].parameters()(**given))) for name, given in ordered)
    listed = tuple(ListedEffect(name, tuple(parameters.items())) for name, parameters in whole)
    usual = {
        "name": "small",
        "seed": 7,
        "taxonomy": "kamakura14",
        "objects": (SceneObject(name="bar", grasp="PoS", shape=BAR, mass_g=100.0),),
        "subjects": (Subject(name="A", hand_length_mm=185.0, hand_breadth_mm=83.0),),
        "repetitions": 8,
        "recording": Recording(lead_ms=30.0, hold_ms=250.0, release_ms=40.0),
        "glove": SceneGlove(taxels=PADS if any(name.startswith("taxel.") for name, _ in pairs) else ()),
    }
    return Scene(effects=listed, **(usual | changes))  # type: ignore[arg-type]


@pytest.fixture(scope="session")
def make_condition() -> Callable[..., Condition]:
    """Return a function of subject, grasp, thing (names) and grip_n."""
    return _condition


@pytest.fixture(scope="session")
def make_batch() -> Callable[..., Batch]:
    """Return a function of the repetitions' numbers and the condition."""
    return _batch


@pytest.fixture(scope="session")
def make_setting() -> Callable[..., SceneSetting]:
    """Return a function of whatever field of `SceneSetting` is to differ."""
    return _setting


@pytest.fixture(scope="session")
def make_draw() -> Callable[..., Draw]:
    """Return a function of an effect's name and a batch."""
    return _draw


@pytest.fixture(scope="session")
def make_scene() -> Callable[..., Scene]:
    """Return a function of effects, each a name or a name with parameters, and of whatever else is to differ."""
    return _scene

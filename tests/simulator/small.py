"""A hand round a bar, batches of it, settings and scenes, as small as can be."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from msgspec.structs import asdict

from thenar.simulator.body.condition import Condition, Pad, PlannedGrasp, Thing
from thenar.simulator.body.hand import Hand, Size
from thenar.simulator.body.shapes import Cylinder
from thenar.simulator.contact.model import Load
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.effect import EFFECTS, SceneSetting
from thenar.simulator.scenes.scene import ListedEffect, Recording, Scene, SceneGlove, SceneObject, Subject
from thenar.simulator.streams import Draw, Site

BAR = Cylinder(diameter_mm=40.0, length_mm=120.0)
# Fingers bent round it, the thumb in opposition, order of DOF.
ROUND_IT_DEG = np.array([40.0, 20.0, 20.0, 20.0] + [0.0, 50.0, 45.0, 30.0] * 4)
# Below the palm, along the knuckles: 90 degrees about the hand's dorsal axis.
BESIDE_THE_PALM = np.array([95.0, 0.0, -34.0, 0.0, 0.0, np.pi / 2])
# The segments whose places bear taxels, where a scene lists an effect on them: what a serial line has time for.
PADS = ("thumb_distal", "index_distal", "index_proximal", "middle_distal")
# The tips of all digits press: the last of each digit's seven spheres.
TIPS = tuple(Pad(7 * digit + 6, 0.2) for digit in range(5))


def make_condition(subject: str = "A", grasp: str = "PoS", thing: str = "bar", grip_n: float = 15.0) -> Condition:
    held = PlannedGrasp(ROUND_IT_DEG, BESIDE_THE_PALM, TIPS, grip_n)
    return Condition(subject, Hand(Size(185.0, 83.0)), grasp, Thing(thing, BAR, 0.1), held)


def make_batch(repetitions: Iterable[int] = range(4), condition: Condition | None = None) -> Batch:
    numbers = np.array(list(repetitions), dtype=np.int64)
    # Trials follow from the repetition alone, as they do in a session.
    return Batch(condition or make_condition(), numbers, 3 * numbers, np.tile(np.zeros(20), (len(numbers), 1)))


def make_setting(**changes: object) -> SceneSetting:
    """Return a setting in which the fields of `changes` differ."""
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


def make_draw(effect: str, batch: Batch, seed: int = 7) -> Draw:
    """Return the draw of an effect, by its name, for a batch."""
    condition = batch.condition
    site = Site(condition.subject, condition.grasp, condition.thing.name, batch.repetitions)
    return Draw(seed, effect, site, Counter())


def make_scene(effects: Sequence[str | tuple[str, dict[str, Any]]] = (), **changes: object) -> Scene:
    """Return a scene of effects, each a name or a name with parameters; the fields of `changes` differ."""
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


def make_load(condition: Condition, n: int = 3, seed: int = 1, share: float = 1.0) -> Load:
    """Return n repetitions that vary by `share` of what shipped scenes vary; 0: just as planned."""
    draw, held = np.random.default_rng(seed), condition.held
    angles = held.posture_deg[:, None] + share * 1.5 * draw.normal(size=(20, n))
    numbers = held.pose[:, None] + share * draw.normal(size=(6, n)) * np.array([1.5] * 3 + [0.044] * 3)[:, None]
    return Load(condition, angles.T, numbers.T, held.grip_n * np.exp(share * 0.25 * draw.normal(size=n)))

"""Grasps that are hard to bring to rest.

No contact, or all contact at one point or on one line; extreme sizes, masses and grips; hands of 1 % and 99 %.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from thenar.compiler.elementary import Floats
from thenar.simulator.body.condition import Condition, Pad, PlannedGrasp, Thing
from thenar.simulator.body.hand import Hand, Size
from thenar.simulator.body.shapes import Box, Cylinder, Shape, Sphere
from thenar.simulator.contact.model import Load
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import conditions_of
from thenar.simulator.planning.postures import Postures
from thenar.simulator.scenes.scene import SURVEYS

HAND = Hand(Size(185.0, 83.0))
# The 1st and 99th percentile; the smallest hand is a woman's, the largest a man's.
_ONE_IN_A_HUNDRED = 2.3263
_SMALLEST = 5e-324  # the smallest positive double
BAR = Cylinder(diameter_mm=40.0, length_mm=120.0)
# Fingers bent round a bar that lies along the knuckles, the thumb in opposition; the tips press.
_ROUND_IT_DEG = np.array([40.0, 20.0, 20.0, 20.0] + [0.0, 50.0, 45.0, 30.0] * 4)
_BESIDE_THE_PALM = np.array([95.0, 0.0, -34.0, 0.0, 0.0, np.pi / 2])
_TIPS = tuple(Pad(7 * digit + 6, 0.2) for digit in range(5))
_THUMB_TIP, _INDEX_TIP, _MIDDLE = 6, 13, 16
_FLAT = np.zeros(20)

Grasp = tuple[str, Load]  # a description of its difficulty, and a load of one repetition


def hard_grasps(full: bool) -> Iterator[Grasp]:
    """Yield the hard grasps, with many hands and objects only in the full run."""
    masses, grips = (0.0, _SMALLEST, 1e-9, 5.0, 1e3, 1e12), (0.0, _SMALLEST, 1e-9, 1e3, 1e12)
    yield from _touching()
    for size in (_SMALLEST, 1e-160, 1e-15, 1e-9, 1.0, 2000.0):
        yield f"a ball of {size:g} mm", held(Sphere(size))
        yield f"a disk {size:g} mm thick", held(Cylinder(40.0, size, 0.0))
        yield f"a card {size:g} mm thick", held(Box(80.0, 50.0, size, 0.0))
    yield from ((f"{mass:g} kg", held(mass_kg=mass)) for mass in masses)
    yield from ((f"a grip of {grip:g} N", held(grip_n=grip)) for grip in grips)
    # Hands of 1 % and 99 % of the usual size, with objects scaled in size and mass.
    for scale in (0.01, 0.99):
        hand = Hand(Size(185.0 * scale, 83.0 * scale))
        pose = _BESIDE_THE_PALM * ([scale] * 3 + [1.0] * 3)
        small = Cylinder(40.0 * scale, 120.0 * scale, 0.5 * scale)
        yield f"a hand of {scale:.0%}", held(small, 0.1 * scale**3, 15.0 * scale**2, hand, pose=pose)
    yield from planned(1 if full else 14)


def held(shape: Shape = BAR, mass_kg: float = 0.1, grip_n: float = 15.0, hand: Hand = HAND, **changes: object) -> Load:
    """Return a hand that holds `shape`; `changes` of posture_deg, pose, pads or down."""
    usual = {"posture_deg": _ROUND_IT_DEG, "pose": _BESIDE_THE_PALM, "pads": _TIPS}
    holds = PlannedGrasp(grip_n=grip_n, **(usual | changes))  # type: ignore[arg-type]
    return _load(Condition("A", hand, "PoS", Thing("thing", shape, mass_kg), holds))


def _load(condition: Condition) -> Load:
    target = condition.held
    return Load(condition, target.posture_deg[None], target.pose[None], np.array([target.grip_n]))


def _touching() -> Iterator[Grasp]:
    """Yield contacts that leave a degree of freedom, or coincide."""
    straight = HAND.spheres(HAND.skeleton(np.zeros((20, 1))))[..., 0]
    meeting_deg = _meeting()
    point = HAND.spheres(HAND.skeleton(np.radians(meeting_deg)[:, None]))[_INDEX_TIP, :, 0]
    beyond = straight[_MIDDLE] + [60.0, 0.0, 0.0]
    # Joints move until they rest, while the object is at rest from the start.
    yield "no contact, no weight", held(pose=_at([900.0, 0.0, 0.0]), mass_kg=0.0, grip_n=40.0)
    yield "no contact", held(pose=_at([900.0, 0.0, 0.0]))
    yield "no contact, no pressure", held(pose=_at([900.0, 0.0, 0.0]), grip_n=0.0, mass_kg=0.0)
    yield "no pads", held(pads=())
    yield "a ball at one fingertip", held(Sphere(60.0), pose=_at(beyond), posture_deg=_FLAT, pads=_TIPS[2:3])
    for name, off in (("in the middle of a bead", 0.0), ("next to a bead", 7.0)):
        pose = _at(point - [0.0, 0.0, off])
        bead = held(Sphere(8.0), pose=pose, posture_deg=meeting_deg, pads=_TIPS[:2])
        yield f"two fingertips at one point {name}", bead
    on_axis: dict[str, Any] = {"pose": _at(straight[_MIDDLE]), "posture_deg": _FLAT}
    yield "a ball whose middle is on a finger's axis", held(Sphere(30.0), **on_axis)
    yield "a bar on a finger's own axis", held(Cylinder(14.0, 90.0), **on_axis)
    under = straight[_MIDDLE] - [0.0, 0.0, 11.0]
    needle = np.concatenate([under, [0.0, 0.0, np.pi / 2]])
    yield "all contacts on one line", held(Cylinder(2.0, 200.0), pose=needle, posture_deg=_FLAT)
    yield "a flat hand on a flat object", held(Box(200.0, 200.0, 10.0), pose=_at(under), posture_deg=_FLAT)


def planned(every: int) -> Iterator[Grasp]:
    """Yield shipped grasps (each of `every`-th object) by the hands of 1 % and 99 % of ANSUR II."""
    scene = load_scene("kamakura")
    postures = Postures.shipped(scene.taxonomy)
    men, women = SURVEYS["ansur2"]
    for share, (length, breadth), normal in ((1, women, -_ONE_IN_A_HUNDRED), (99, men, _ONE_IN_A_HUNDRED)):
        size = Size(length.at(normal, (0.0, 300.0)), breadth.at(normal, (0.0, 300.0)))
        for item in scene.objects[::every]:
            target = postures.held(Hand(size), item.grasp, item.thing())
            condition = Condition("A", Hand(size), item.grasp, item.thing(), target)
            yield f"a hand of {share} %, {item.name}", _load(condition)


def shipped(repetitions: int) -> Iterator[Load]:
    """Yield the grasps of the shipped scene's first subject, varied by its effects."""
    scene, rng = load_scene("kamakura"), np.random.default_rng(14)
    for condition in conditions_of(scene, scene.subjects[0], Postures.shipped(scene.taxonomy)):
        target, n = condition.held, repetitions
        pose = target.pose + rng.normal(size=(n, 6)) * ([1.5] * 3 + [np.radians(2.5)] * 3)
        posture_deg = target.posture_deg + 1.5 * rng.normal(size=(n, 20))
        yield Load(condition, posture_deg, pose, target.grip_n * np.exp(0.25 * rng.normal(size=n)))


def _at(position: Floats | list[float]) -> Floats:
    return np.concatenate([position, np.zeros(3)])


def _meeting() -> Floats:
    """Return joint angles (20,) in degrees at which the tips of thumb and index coincide, by Gauss-Newton."""

    def apart(angles: Floats) -> Floats:
        centres = HAND.spheres(HAND.skeleton(angles))
        between: Floats = centres[_THUMB_TIP] - centres[_INDEX_TIP]
        return between

    angles = np.radians(_ROUND_IT_DEG)
    own = np.arange(8)  # the joints of thumb and index
    for _ in range(40):
        here = apart(angles[:, None])[:, 0]
        slopes = (apart(angles[:, None] + 1e-6 * np.eye(20)[:, own]) - here[:, None]) / 1e-6
        angles[own] -= np.linalg.lstsq(slopes, here)[0]
    degrees: Floats = np.degrees(angles)
    return degrees

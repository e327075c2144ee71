"""Grasps that are hard to bring to rest.

No contact, or all contact at one point or on one line; extreme sizes, masses and grips; hands of 1 % and 99 %.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from thenar.compiler.elementary import Floats
from thenar.simulator.body.condition import Condition, Pad, PlannedGrasp, Thing
from thenar.simulator.body.hand import Hand, Size
from thenar.simulator.body.shapes import Box, Cylinder, Shape, Sphere
from thenar.simulator.contact.balance import SolverCase
from thenar.simulator.contact.model import Load
from thenar.simulator.pipeline.scene_file import load_scene
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


class Grasp(NamedTuple):
    """A load of one repetition, and a description of its difficulty."""

    name: str
    load: Load


def held(shape: Shape = BAR, mass_kg: float = 0.1, grip_n: float = 15.0, hand: Hand = HAND, **changes: object) -> Grasp:
    """Return a hand that holds `shape`; `changes` of posture_deg, pose, pads or down."""
    usual = {"posture_deg": _ROUND_IT_DEG, "pose": _BESIDE_THE_PALM, "pads": _TIPS}
    holds = PlannedGrasp(grip_n=grip_n, **(usual | changes))  # type: ignore[arg-type]
    condition = Condition("A", hand, "PoS", Thing("thing", shape, mass_kg), holds)
    return Grasp("", Load(condition, holds.posture_deg[None], holds.pose[None], np.array([grip_n])))


def hard(full: bool) -> Iterator[Grasp]:
    """Yield the hard grasps, with many hands and objects only in the full run."""
    masses, grips = (0.0, _SMALLEST, 1e-9, 5.0, 1e3, 1e12), (0.0, _SMALLEST, 1e-9, 1e3, 1e12)
    of_masses = ((f"{mass:g} kg", held(mass_kg=mass)) for mass in masses)
    of_grips = ((f"a grip of {grip:g} N", held(grip_n=grip)) for grip in grips)
    for name, grasp in (*_touching(), *_of_sizes(), *of_masses, *of_grips, *_of_hands()):
        yield Grasp(name, grasp.load)
    yield from planned(1 if full else 14)


def _touching() -> Iterator[tuple[str, Grasp]]:
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
    yield (
        "a ball whose middle is on a finger's axis",
        held(Sphere(30.0), pose=_at(straight[_MIDDLE]), posture_deg=_FLAT),
    )
    yield "a bar on a finger's own axis", held(Cylinder(14.0, 90.0), pose=_at(straight[_MIDDLE]), posture_deg=_FLAT)
    under = straight[_MIDDLE] - [0.0, 0.0, 11.0]
    needle = np.concatenate([under, [0.0, 0.0, np.pi / 2]])
    yield "all contacts on one line", held(Cylinder(2.0, 200.0), pose=needle, posture_deg=_FLAT)
    yield "a flat hand on a flat object", held(Box(200.0, 200.0, 10.0), pose=_at(under), posture_deg=_FLAT)


def _of_sizes() -> Iterator[tuple[str, Grasp]]:
    for size in (_SMALLEST, 1e-160, 1e-15, 1e-9, 1.0, 2000.0):
        yield f"a ball of {size:g} mm", held(Sphere(size))
        yield f"a disk {size:g} mm thick", held(Cylinder(40.0, size, 0.0))
        yield f"a card {size:g} mm thick", held(Box(80.0, 50.0, size, 0.0))


def _of_hands() -> Iterator[tuple[str, Grasp]]:
    """Yield hands of 1 % and 99 % of the usual size, with objects scaled in size and mass."""
    for scale in (0.01, 0.99):
        hand = Hand(Size(185.0 * scale, 83.0 * scale))
        pose = _BESIDE_THE_PALM * ([scale] * 3 + [1.0] * 3)
        small = Cylinder(40.0 * scale, 120.0 * scale, 0.5 * scale)
        yield f"a hand of {scale:.0%}", held(small, 0.1 * scale**3, 15.0 * scale**2, hand, pose=pose)


def planned(every: int) -> Iterator[Grasp]:
    """Yield shipped grasps (each of `every`-th object) by the hands of 1 % and 99 % of ANSUR II."""
    scene = load_scene("kamakura")
    postures = Postures.shipped(scene.taxonomy)
    men, women = SURVEYS["ansur2"]
    for share, hands, normal in ((1, women, -_ONE_IN_A_HUNDRED), (99, men, _ONE_IN_A_HUNDRED)):
        size = Size(hands.length.at(normal, (0.0, 300.0)), hands.breadth.at(normal, (0.0, 300.0)))
        for item in scene.objects[::every]:
            target = postures.held(Hand(size), item.grasp, item.thing())
            condition = Condition("A", Hand(size), item.grasp, item.thing(), target)
            load = Load(condition, target.posture_deg[None], target.pose[None], np.array([target.grip_n]))
            yield Grasp(f"a hand of {share} %, {item.name}", load)


def otherwise(load: Load, **changes: object) -> Load:
    """Return a load with changes in its condition's `PlannedGrasp`."""
    changed = replace(load.condition.held, **changes)  # type: ignore[arg-type]
    return replace(load, condition=replace(load.condition, held=changed))


def case_of(load: Load) -> SolverCase:
    """Return a load in the form of the quasistatic model."""
    return SolverCase(load.condition, load.posture_deg.T * (np.pi / 180.0), load.pose.T, load.grip_n)


def _at(position: Floats | list[float]) -> Floats:
    return np.concatenate([position, np.zeros(3)])


def _meeting() -> Floats:
    """Return joint angles (20,) in degrees at which the tips of thumb and index coincide, by Gauss-Newton."""
    angles = np.radians(_ROUND_IT_DEG)
    own = np.arange(8)  # the joints of thumb and index
    for _ in range(40):
        apart = _apart(angles[:, None])[:, 0]
        moved = angles[:, None] + 1e-6 * np.eye(20)[:, own]
        slopes = (_apart(moved) - apart[:, None]) / 1e-6
        angles[own] -= np.linalg.lstsq(slopes, apart)[0]
    degrees: Floats = np.degrees(angles)
    return degrees


def _apart(angles: Floats) -> Floats:
    centres = HAND.spheres(HAND.skeleton(angles))
    apart: Floats = centres[_THUMB_TIP] - centres[_INDEX_TIP]
    return apart

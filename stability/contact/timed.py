"""MuJoCo's balance at 60 digits, on slippery balls: how capsules meet a ball is known without MuJoCo."""

from collections.abc import Callable, Iterator

import mpmath
import numpy as np
from mpmath import mpf

from thenar.simulator.body.hand import CAPSULES, Hand
from thenar.simulator.body.shapes import Sphere
from thenar.simulator.contact.grip import GRAVITY
from thenar.simulator.contact.model import Contact, ContactModel, Load
from thenar.simulator.effects.contact_mujoco import Parameters

from ..finding import Finding, Worst
from ..reference.numbers import precisely
from .grasps import held
from .posed import digits
from .vectors import Vector, dot, length, plus

# MuJoCo takes no friction for less than this (mjMINMU).
_LEAST_FRICTION = 1e-5
SLIPPERY = Parameters(friction=_LEAST_FRICTION)


def findings(make: Callable[..., ContactModel], full: bool) -> Iterator[Finding]:
    """Hold what is returned as left on balls against what their contacts, weight and weld leave.

    Skin presses along the line from the nearest point of a capsule's axis to the ball's middle, and drags by at most
    the least friction there is: by so much of all forces may the two differ, roundings being far less.
    """
    left = Worst("mujoco: force left on a slippery ball", "60 digits", 1.0, "of the bound")
    for diameter_mm in range(40, 100, 5 if full else 20):
        load = held(Sphere(float(diameter_mm)), pose=np.array([95.0, 5.0, -15.0 - diameter_mm / 2, 0.0, 0.0, 0.0])).load
        (contact,) = make(SLIPPERY).solve([load])
        truth = float(length(left_on_ball(load, contact)))
        bound = _LEAST_FRICTION * float(contact.capsules_n.sum())
        left.see(abs(float(contact.residual_n[0]) - truth) / bound, f"a ball of {diameter_mm} mm")
    yield left.finding()


@precisely()
def left_on_ball(load: Load, contact: Contact) -> Vector:
    """Return the force on a ball that nothing balances: contacts along their normals, weight, the weld's spring."""
    condition, position = load.condition, [mpf(x) for x in contact.pose[0, :3].tolist()]
    left = [mpf(condition.thing.mass_kg) * mpf(GRAVITY) * mpf(x) for x in condition.held.down.tolist()]
    left = plus(left, plus(load.pose[0, :3].tolist(), position, -1), mpf(SLIPPERY.weld_n_per_m) / 1000)
    angles = [mpmath.radians(mpf(x)) for x in contact.posture_deg[0].tolist()]
    for axis, press in zip(_axes(condition.hand, angles), contact.capsules_n[0].tolist(), strict=True):
        away = plus(position, _nearest(*axis, position), -1)
        left = plus(left, away, mpf(press) / length(away))
    return left


def _axes(hand: Hand, angles: Vector) -> Iterator[tuple[Vector, Vector, mpf]]:
    """Yield every capsule's axis: where it begins, its direction, its length.

    A digit's ends in its last sphere of skin; the palm's run from their first to their last.
    """
    posed, palm = digits(hand, angles), hand.skeleton(np.zeros((20, 1)))
    for capsule in range(len(CAPSULES)):
        skin = hand.sphere_offsets[hand.sphere_capsules == capsule].tolist()
        digit, segment = divmod(capsule, 3)
        if digit < 5:
            end = mpf(skin[-1] if segment == 2 else hand.lengths[capsule].item())
            yield posed[digit].origins[segment], posed[digit].along[segment], end
        else:
            along = [mpf(x) for x in palm.frames[capsule, :, 0, 0].tolist()]
            origin = [mpf(x) for x in palm.origins[capsule, :, 0].tolist()]
            yield plus(origin, along, mpf(skin[0])), along, mpf(skin[-1]) - mpf(skin[0])


def _nearest(begin: Vector, along: Vector, end: mpf, point: Vector) -> Vector:
    return plus(begin, along, min(max(dot(plus(point, begin, -1), along), mpf(0)), end))

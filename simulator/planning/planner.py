"""Planned postures: joint angles and an object's pose such that the pads of a grasp type touch and nothing sinks in.

Least squares over 20 joint angles and 6 numbers of the object's pose, from the type's nominal posture (scipy, needed
for planning only: postures are kept as data).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..body.condition import Held, Pad, Thing
from ..body.hand import LIMITS_DEG, Hand
from ..body.pose import Pose, rotation_vector
from ..body.shapes import Shape
from ..errors import PlanError
from .misfit import Misfit
from .postures import FRICTION
from .prehension import Prehension

Floats = NDArray[np.float64]

TOLERANCE_MM = 4.0  # what the contact model still closes, or presses out
# How much of the push friction bears when pads do not push straight against each other: the sine of its angle.
BORNE = FRICTION / float(np.sqrt(1.0 + FRICTION * FRICTION))


@dataclass(frozen=True, slots=True)
class Plan:
    """A planned posture, and how good it is.

    cost       what the planner made as small as it could
    gap_mm     the widest gap under a pad
    sunk_mm    the deepest that any skin sinks in
    imbalance  what the pads' pushes leave unbalanced, over the grip force (friction bears it)
    """

    held: Held
    cost: float
    gap_mm: float
    sunk_mm: float
    imbalance: float

    def holds(self) -> bool:
        """Return whether every pad is near enough, no skin too deep in the object, and friction does the rest."""
        return self.excess() <= 1.0

    def excess(self) -> float:
        """Return the worst fault over what is tolerated of it."""
        return max(self.gap_mm / TOLERANCE_MM, self.sunk_mm / TOLERANCE_MM, self.imbalance / BORNE)


def plan(hand: Hand, grasp: str, prehension: Prehension, thing: Thing, near: Held | None = None) -> Plan:
    """Return a posture of `hand` that holds `thing`; `near` is one of a hand of nearly the same size to start from.

    Raises PlanError if the best one leaves a pad too far off, lets skin sink in too deep, or pushes the object away.
    """
    from threadpoolctl import threadpool_limits

    misfit = Misfit(hand, prehension, thing.shape)
    # Small matrices: more threads would take longer, and come to other last digits.
    with threadpool_limits(1):
        plans = [] if near is None else [_descend(misfit, _start_near(misfit, near))]
        if not any(one.holds() for one in plans):
            plans += [_descend(misfit, start) for start in _starts(misfit)]
    best = _best(plans)
    if not best.holds():
        raise PlanError(_refusal(hand, grasp, thing, best))
    return best


def measure(hand: Hand, held: Held, shape: Shape) -> tuple[float, float]:
    """Return the widest gap under a pad, and the deepest that any skin sinks in, in mm."""
    centres = hand.spheres(hand.skeleton(np.radians(held.posture_deg)[:, None]))
    gap = Pose.of(held.pose[:, None]).distance(shape, centres)[0][:, 0] - hand.sphere_radii
    return float(gap[[pad.sphere for pad in held.pads]].max()), float(-gap.min())


def _best(plans: Iterable[Plan]) -> Plan:
    """Return the plan of the least cost among those that hold; if none does, what comes nearest to holding."""
    return min(plans, key=lambda one: (not one.holds(), one.cost if one.holds() else one.excess()))


def _refusal(hand: Hand, grasp: str, thing: Thing, best: Plan) -> str:
    wrong = (
        (best.gap_mm / TOLERANCE_MM, f"leaves {best.gap_mm:.1f} mm under a pad (at most {TOLERANCE_MM:g})"),
        (best.sunk_mm / TOLERANCE_MM, f"lets skin sink in {best.sunk_mm:.1f} mm (at most {TOLERANCE_MM:g})"),
        (best.imbalance / BORNE, f"leaves {best.imbalance:.0%} of the push unbalanced (friction bears {BORNE:.0%})"),
    )
    return (
        f"a hand of {hand.size.length_mm:g} mm cannot hold {thing.name!r} with grasp type {grasp!r}: the best posture "
        f"{' and '.join(words for excess, words in wrong if excess > 1.0)}; take an object of another size, or another "
        "grasp type for it"
    )


def _start_near(misfit: Misfit, near: Held) -> Floats:
    """Return the candidate (26,) with a known posture's joint angles and object's pose."""
    known, start = Pose.of(near.pose[:, None]), Pose.of(misfit.start[:, None])
    turn = rotation_vector(np.einsum("ijn,kjn->ikn", known.rotation, start.rotation))
    return np.concatenate([np.radians(near.posture_deg), (known.position - start.position)[:, 0], turn[:, 0]])


def _starts(misfit: Misfit) -> Iterator[Floats]:
    """Yield candidates (26,): the nominal posture, and opener ones with the object further away."""
    away = np.array(misfit.prehension.away)
    away = away / np.linalg.norm(away)
    for further, opened in ((0.0, 1.0), (12.0, 0.8), (25.0, 0.55)):
        angles = misfit.nominal.reshape(5, 4).copy()
        angles[1:, 1:] *= opened
        yield np.concatenate([angles.ravel(), further * away, np.zeros(3)])


def _descend(misfit: Misfit, start: Floats) -> Plan:
    from scipy.optimize import least_squares

    def residuals(x: Floats) -> Floats:
        return misfit.residuals(x[:, None])[:, 0]

    def jacobian(x: Floats) -> Floats:
        return _jacobian(misfit, x)

    low, high = np.radians(LIMITS_DEG.T)
    bounds = (np.concatenate([low, np.full(6, -np.inf)]), np.concatenate([high, np.full(6, np.inf)]))
    found = least_squares(
        residuals,
        np.clip(start, bounds[0] + 1e-6, bounds[1] - 1e-6),
        jac=jacobian,
        bounds=bounds,
        x_scale=np.concatenate([np.full(20, 0.2), np.full(3, 5.0), np.full(3, 0.2)]),
        max_nfev=150,
        xtol=1e-6,
        ftol=1e-6,
    )
    return _finished(misfit, found.x, float(found.cost))


def _jacobian(misfit: Misfit, x: Floats) -> Floats:
    steps = np.concatenate([np.full(20, 1e-5), np.full(3, 1e-4), np.full(3, 1e-5)])
    moved = np.concatenate([x[:, None] + np.diag(steps), x[:, None] - np.diag(steps)], axis=1)
    values = misfit.residuals(moved)
    slopes: Floats = (values[:, :26] - values[:, 26:]) / (2 * steps)
    return slopes


def _finished(misfit: Misfit, x: Floats, cost: float) -> Plan:
    hand, prehension = misfit.hand, misfit.prehension
    centres = hand.spheres(hand.skeleton(x[:20, None]))
    pose = misfit.pose(x[20:, None])
    normal = pose.distance(misfit.shape, centres)[1]
    share, left = misfit.balance(normal[:, :, 0], centres[:, :, 0], pose.position[:, 0])
    pads = tuple(Pad(int(sphere), float(part)) for sphere, part in zip(misfit.pads, share, strict=True))
    numbers = np.concatenate([pose.position[:, 0], rotation_vector(pose.rotation)[:, 0]])
    down = np.array(prehension.down)
    held = Held(np.degrees(x[:20]), numbers, pads, prehension.grip_n, down / np.linalg.norm(down))
    return Plan(held, cost, *measure(hand, held, misfit.shape), float(np.linalg.norm(left)))

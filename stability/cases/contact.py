"""Hands and objects that are hard to bring to rest: singular, coincident, weightless, huge; and halved steps.

Mass is only a weight: a massless object is one without weight, held by skin and its soft spring.

A force matters only if it changes a switch. The shipped scenes spread the thresholds of switches around 1 N with a
standard deviation of 0.15 N (switch.threshold), because those of a real glove are no better known. So if halved steps
only get closer to the same rest, they may change no force on a segment by more than this; if the history of friction
differs, they may change no more switches than newly drawn thresholds would.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

import mpmath
import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats
from thenar.simulator.body.shapes import Box, Cylinder, Shape, Sphere, rotation, rotation_vector
from thenar.simulator.contact.balance import USUAL, Skin, SolverSettings
from thenar.simulator.contact.model import Contact, Load
from thenar.simulator.contact.settle import close
from thenar.simulator.effects import switch_threshold
from thenar.simulator.effects.contact_quasistatic import MOST_STEPS, USUAL_SKIN, Quasistatic
from thenar.simulator.pipeline.batch import SLID_OUT_MM

from ..checks.balance import Matrix, exactly, length, residuals, surface
from ..checks.rounds import ROUNDING
from ..finding import REFERENCE, Finding
from ..inputs.hard_grasps import Grasp, hard_grasps, shipped
from ..reference.numbers import precisely, turn

RULE = "the rule itself"

_TINY = (5e-324, 1e-200, 1e-155, 1e-149, 1e-15, 1e-12, 1e-9)
_THIN = 5e-324
_LOST_MM = mpf(10) ** -150  # the squares of smaller lengths underflow
_BARS = ((_THIN, 1.0, 0.0), (40.0, _THIN, 0.0), (40.0, 120.0, 0.5), (2000.0, 2000.0, 900.0))
_BOXES = ((80.0, 50.0, _THIN, 0.0), (9.0, 9.0, 9.0, 4.5), (200.0, 200.0, 10.0, 0.0))
SHAPES: tuple[Shape, ...] = (
    *(Sphere(size) for size in (_THIN, 1e-9, 8.0, 2000.0)),
    *(Cylinder(*sizes) for sizes in _BARS),
    *(Box(*sizes) for sizes in _BOXES),
)

_STATE = ("posture_deg", "pose", "forces_n", "capsules_n", "between_n")
_FIELDS = (*_STATE, "residual_n", "residual_nmm")
# Stiffness, soft depth, drag and friction at the limits of a scene.
_LIMITS = ((5e-324, 5.0, 1000.0, 2.0), (1000.0, 5e-324, 1e-300, 0.0), (1000.0, 5.0, 1000.0, 2.0), (1e-12,) * 4)

THRESHOLD_N = 1.0
SPREAD_N = switch_threshold.SD_N
_DRAWS = 20


def findings(full: bool) -> Iterator[Finding]:
    """Yield errors of surfaces and rotations, of rest, and of halved steps."""
    rng, more = np.random.default_rng(12), 200 if full else 20
    yield from _surfaces(rng, more)
    yield from _turns(rng, more)
    grasps = list(hard_grasps(full))
    yield _numbers(grasps)
    yield _nothing()
    yield from _balanced(grasps[:: 1 if full else 4])
    yield from _halved(full)


def points(shape: Shape, rng: np.random.Generator, n: int) -> Floats:
    """Return points (m, 3): the middle, faces, edges and corners, also with tiny offsets, and n around."""
    half = np.array(shape.extent_mm()) / 2
    corners = np.array(list(product((-1.0, 0.0, 1.0), repeat=3))) * half
    core = corners * (1.0 - getattr(shape, "edge_mm", 0.0) / np.maximum(half, 1e-300))
    hairs = np.array([hair * axis for hair in _TINY for axis in (*np.eye(3), -np.eye(3)[2], np.ones(3))])
    off = rng.choice(_TINY, (len(corners), 3)) * rng.choice([-1.0, 1.0], (len(corners), 3))
    around = rng.normal(size=(n, 3)) * (half + 10.0)
    return np.concatenate([corners, core, np.nextafter(corners, np.inf), core + off, hairs, around])


@precisely()
def _surfaces(rng: np.random.Generator, n: int) -> list[Finding]:
    """Compare distances and normals with exact values.

    The size of a side is halved exactly, subtracting its edge rounds once, and the distance beyond it once more: 2
    roundings of the size; so does the last difference. For a corner, squares, at most two sums and the root round by 3,
    the radius of a bar by 2.5 before: 9 roundings of the sum of the point's position and the object's size; and less
    than 1e-150 mm.

    A normal is a quotient by such a root, of relative error 2.5 and 1 for itself; that of a bar is the product of two:
    8 roundings of its length. In addition its direction is off by 4 roundings of that size, of two sides,
    over the distance of the point from the core inside the rounded edge.
    """
    distances = Finding.of("distance from a surface", REFERENCE, 9.0, "x 2^-53 of the size")
    normals = Finding.of("length of normals", REFERENCE, 8.0, "x 2^-53")
    ways = Finding.of("direction of normals", REFERENCE, 1.0, "of the bound")
    for shape in SHAPES:
        places = points(shape, rng, n)
        found, out = shape.distance(places[..., None])
        size = mpmath.fsum(shape.extent_mm())
        for place, distance, normal in zip(places.tolist(), found[:, 0].tolist(), exactly(out[..., 0]), strict=True):
            scale = size + mpmath.fsum(abs(mpf(x)) for x in place)
            truth, way = surface(shape, place)
            doubt = max(abs(mpf(distance) - truth) - _LOST_MM, mpf(0))
            distances.see(float(doubt / (ROUNDING * scale)), f"{shape} at {place}")
            normals.see(float(abs(length(normal) - 1) / ROUNDING), f"{shape} at {place}")
            gap = truth + (mpf(shape.diameter_mm) / 2 if isinstance(shape, Sphere) else mpf(shape.edge_mm))
            if gap > 2 * _LOST_MM:
                inexact = 0 if isinstance(shape, Sphere) else 4 * size / gap
                ways.see(float(length(normal - way) / (ROUNDING * (8 + inexact))), f"{shape} at {place}")
    return [distances, normals, ways]


def vectors(rng: np.random.Generator, n: int) -> Floats:
    """Return rotation vectors (m, 3) up to half a turn: zero, tiny, half turns and close to them, and n random ones."""
    axes = np.concatenate([np.eye(3), -np.eye(3), rng.normal(size=(max(n // 4, 3), 3))])
    axes /= np.sqrt(np.add.reduce(axes * axes, axis=1))[:, None]
    angles = (0.0, 5e-324, 1e-160, 1e-150, 9.9e-9, 1.01e-8, 1e-4, np.pi / 2, np.pi - 1e-8, np.nextafter(np.pi, 0.0))
    drawn = rng.normal(size=(n, 3))
    return np.concatenate([*(axes * angle for angle in angles), drawn])


@precisely()
def _turns(rng: np.random.Generator, n: int) -> list[Finding]:
    """Compare rotation matrices, and those of their rotation vectors, with exact values.

    The angle a <= pi is off by 2.5 roundings of itself, 8; sine and cosine add 2 ulp, so each is off by 10. The sine's
    part of an element counts 10 and 4 for its quotient and product. 1 - cos a rounds once: 11; over a^2 and times two
    components of the vector that is at most 2, with 6 roundings: 11 + 12. The last sum adds 1 rounding of at most 2: 40
    altogether.

    A rotation vector follows from sums of such elements. Of the four formulas for its quaternion the chosen one has a
    largest component of at least 1/2, so with an error of 40 and 4 roundings in each element none of its components is
    off by over 4 * 44 / (4 * 1/2) = 88; its angle, and so each rotated element, by twice that, plus the 40.
    """
    matrices = Finding.of("rotation matrices", REFERENCE, 40.0, "x 2^-53")
    back = Finding.of("matrices of rotation vectors", REFERENCE, 216.0, "x 2^-53")
    made = vectors(rng, n)
    found = rotation(made.T)
    again = rotation_vector(found).T
    for k, (there, once_more) in enumerate(zip(made, again, strict=True)):
        truth, at = _rotated(there), f"{there.tolist()}"
        matrices.see(float(abs(exactly(found[..., k]) - truth).max() / ROUNDING), at)
        back.see(float(abs(_rotated(once_more) - truth).max() / ROUNDING), at)
    return [matrices, back]


def _rotated(vector: Floats) -> Matrix:
    angle = length(exactly(vector))
    return np.array(turn(vector.tolist(), angle) if angle else turn((1, 0, 0), 0))


def _numbers(grasps: Sequence[Grasp]) -> Finding:
    """Count results that are not finite but reported as settled, with all skins."""
    wrong = Finding.of("quasistatic: finite, or not settled", RULE, 0.0, "results")
    for skin, tried in ((USUAL_SKIN, grasps), *((Skin(*limits), grasps[::8]) for limits in _LIMITS)):
        for (name, _), contact in zip(tried, Quasistatic(skin).solve([load for _, load in tried]), strict=True):
            # The residual of an abandoned repetition may be infinite.
            known = all(np.isfinite(getattr(contact, field)).all() for field in _STATE)
            residual = np.isfinite(contact.residual_n) & np.isfinite(contact.residual_nmm)
            wrong.see(float(not (known and (residual | ~contact.settled).all())), name)
    return wrong


def _nothing() -> Finding:
    """Count results that differ for equivalent loads.

    An object of zero or the smallest mass has no weight in any direction; no grip equals no pads, and almost equals
    the smallest grip.
    """
    wrong = Finding.of("quasistatic: no mass, no grip", RULE, 0.0, "results")
    grasps = dict(hard_grasps(full=False))
    weightless, gripless = grasps["0 kg"], grasps["a grip of 0 N"]
    pairs = (
        ("down is up", weightless, _otherwise(weightless, down=-weightless.condition.held.down)),
        ("down is ahead", weightless, _otherwise(weightless, down=np.array([1.0, 0.0, 0.0]))),
        ("the smallest mass", weightless, grasps[f"{5e-324:g} kg"]),
        ("no pads", gripless, _otherwise(gripless, pads=())),
        ("the smallest grip", gripless, grasps[f"a grip of {5e-324:g} N"]),
    )
    for what, *loads in pairs:
        fields = ([getattr(one, field) for one in Quasistatic().solve(loads)] for field in _FIELDS)
        wrong.see(float(not all(np.array_equal(*both) for both in fields)), what)
    return wrong


def _otherwise(load: Load, **changes: object) -> Load:
    """Return a load with changes in its condition's `PlannedGrasp`."""
    changed = replace(load.condition.held, **changes)  # type: ignore[arg-type]
    return replace(load, condition=replace(load.condition, held=changed))


def _balanced(grasps: Sequence[Grasp]) -> Iterator[Finding]:
    """Check the balance of forces at 60 digits for every grasp that quasistatic reports as settled.

    At rest the residuals must be below USUAL.rest_n and rest_nmm. Doubles place a sphere to some 1e-13 mm, so the
    residuals are off by about 5e-12 N on each of 50 spheres, at arms of 200 mm: less than a millionth of either.
    """
    forces = Finding.of("quasistatic at rest: force on the object", REFERENCE, USUAL.rest_n * (1 + 1e-6), "N")
    moments = Finding.of("quasistatic at rest: moment on the object", REFERENCE, USUAL.rest_nmm * (1 + 1e-6), "N mm")
    joints = Finding.of("quasistatic at rest: moment on a joint", REFERENCE, USUAL.rest_nmm * (1 + 1e-6), "N mm")
    for name, load in grasps:
        (rest,) = close([load], USUAL_SKIN, MOST_STEPS)
        # In the exact middle of an object the direction of a pad is arbitrary.
        pads = [pad.sphere for pad in load.condition.held.pads]
        hand = load.condition.hand
        away = hand.spheres(hand.skeleton(np.radians(load.posture_deg.T)))[pads, :, 0] - load.pose[0, :3]
        if rest.settled[0] and (np.abs(away).max(axis=1, initial=0.0) > 1e-9).all():
            for worst, residual in zip((forces, moments, joints), residuals(load, rest, USUAL_SKIN), strict=True):
                worst.see(residual, name)
    yield from (forces, moments, joints)


def _halved(full: bool) -> Iterator[Finding]:
    """Yield the changes of forces and of switches by halved steps: Newton's, and the limits of rest."""
    loads = list(shipped(4 if full else 1))
    rest = Quasistatic().solve(loads)
    nearer = Quasistatic(pace=SolverSettings(USUAL.rest_n / 2, USUAL.rest_nmm / 2)).solve(loads)
    worst = Finding.of("quasistatic: forces, limits of rest halved", "the usual rest", SPREAD_N, "N")
    names, first, second = _changed(loads, "capsules_n", rest, nearer)
    for name, change in zip(names, np.abs(first - second).max(axis=1).tolist(), strict=True):
        worst.see(change, name)
    yield worst
    halved = Quasistatic(pace=SolverSettings(parts=2)).solve(loads)
    yield _turned("quasistatic: Newton steps halved", loads, rest, halved)
    if full:
        again = Quasistatic(pace=SolverSettings(parts=4)).solve(loads)
        yield _turned("quasistatic: Newton steps halved again", loads, halved, again)


def kept(loads: Sequence[Load], *solved: Sequence[Contact]) -> NDArray[np.bool_]:
    """Return the mask (n,) of repetitions that settled, without dropping their object, in all of `solved`."""
    good = np.ones(sum(len(load.grip_n) for load in loads), dtype=bool)
    for contacts in solved:
        shifts = [one.pose[:, :3] - load.pose[:, :3] for one, load in zip(contacts, loads, strict=True)]
        slid = np.concatenate([np.sqrt(np.add.reduce(shift * shift, axis=1)) for shift in shifts])
        good &= np.concatenate([one.settled for one in contacts]) & (slid <= SLID_OUT_MM)
    return good


def _changed(
    loads: Sequence[Load], field: str, one: Sequence[Contact], other: Sequence[Contact]
) -> tuple[list[str], Floats, Floats]:
    """Return the objects of the repetitions kept in both solutions, and a field of both."""
    good = kept(loads, one, other)
    names = np.array([load.condition.thing.name for load in loads for _ in load.grip_n])[good].tolist()
    first, second = (np.concatenate([getattr(contact, field) for contact in each])[good] for each in (one, other))
    return names, first, second


def _turned(check: str, loads: Sequence[Load], one: Sequence[Contact], other: Sequence[Contact]) -> Finding:
    """Count the switches that differ between two solutions; newly drawn thresholds for the first give the bound."""
    names, first, second = _changed(loads, "forces_n", one, other)
    closed = first > THRESHOLD_N
    drawn = np.random.default_rng(15).normal(THRESHOLD_N, SPREAD_N, (_DRAWS, first.shape[1]))
    by_thresholds = np.mean([np.count_nonzero((first > thresholds) != closed) for thresholds in drawn])
    turned = np.count_nonzero((second > THRESHOLD_N) != closed)
    change = np.abs(first - second).max(axis=1)
    most = f"{names[change.argmax()]}: {change.max():.2g} N, median {np.median(change):.2g} N"
    error, bound, tried = float(turned), float(by_thresholds), int(np.count_nonzero(closed))
    return Finding(check, "the spread of thresholds", error, bound, "switches", tried, most)

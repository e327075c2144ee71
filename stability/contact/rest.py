"""Results for hard grasps in the contact model."""

from collections import Counter
from collections.abc import Iterator, Sequence
from math import fsum

import numpy as np

from thenar.simulator.body.layout import SwitchPlaces, murakami160
from thenar.simulator.body.shapes import Pose
from thenar.simulator.contact.balance import USUAL, Skin
from thenar.simulator.contact.model import Contact, Load
from thenar.simulator.contact.settle import close
from thenar.simulator.effects.contact_quasistatic import MOST_STEPS, USUAL_SKIN, Quasistatic

from ..finding import REFERENCE, Finding, Worst
from .grasps import BAR, HAND, Grasp, case_of, hard, held, otherwise
from .posed import left_of

RULE = "the rule itself"
# On any one segment of the glove.
MOST_SWITCHES = max(Counter(patch.capsule for patch in murakami160()).values())
_STATE = ("posture_deg", "pose", "forces_n", "capsules_n", "between_n")
_FIELDS = (*_STATE, "residual_n", "residual_nmm")
SKIN = USUAL_SKIN
# Skin and friction at the limits of a scene.
_LIMITS = tuple(
    Skin(press_n_per_mm=press, soft_mm=soft, drag_n_per_mm=drag, friction=friction)
    for press, soft, drag, friction in (
        (5e-324, 5.0, 1000.0, 2.0),
        (1000.0, 5e-324, 1e-300, 0.0),
        (1000.0, 5.0, 1000.0, 2.0),
        (1e-12, 1e-12, 1e-12, 1e-12),
    )
)


def findings(full: bool) -> Iterator[Finding]:
    """Yield the checks for finite numbers, truthful reports of rest, balance of forces, and invariances."""
    grasps = list(hard(full))
    yield _numbers(grasps)
    yield _nothing()
    yield _on_the_surface(full)
    yield from _balanced(grasps[:: 1 if full else 4])


def _numbers(grasps: Sequence[Grasp]) -> Finding:
    """Count results that are not finite but reported as settled, with all skins."""
    wrong = Worst("quasistatic: finite, or not settled", RULE, 0.0, "results")
    for given, tried in ((SKIN, grasps), *((given, grasps[::8]) for given in _LIMITS)):
        for grasp, contact in zip(tried, Quasistatic(given).solve([each.load for each in tried]), strict=True):
            wrong.see(float(not is_honest(contact)), grasp.name)
    return wrong.finding()


def is_honest(contact: Contact) -> bool:
    """Return whether all results are finite; the residual of an abandoned repetition may be infinite."""
    known = all(np.isfinite(getattr(contact, field)).all() for field in _STATE)
    residuals = np.isfinite(contact.residual_n) & np.isfinite(contact.residual_nmm)
    return bool(known and (residuals | ~contact.settled).all())


def _nothing() -> Finding:
    """Count results that differ for equivalent loads.

    An object of zero or the smallest mass has no weight in any direction; no grip equals no pads, and almost equals
    the smallest grip.
    """
    wrong = Worst("quasistatic: no mass, no grip", RULE, 0.0, "results")
    grasps = {grasp.name: grasp.load for grasp in hard(full=False)}
    weightless, gripless = grasps["0 kg"], grasps["a grip of 0 N"]
    pairs = (
        ("down is up", weightless, otherwise(weightless, down=-weightless.condition.held.down)),
        ("down is ahead", weightless, otherwise(weightless, down=np.array([1.0, 0.0, 0.0]))),
        ("the smallest mass", weightless, grasps[f"{5e-324:g} kg"]),
        ("no pads", gripless, otherwise(gripless, pads=())),
        ("the smallest grip", gripless, grasps[f"a grip of {5e-324:g} N"]),
    )
    for what, one, other in pairs:
        first, second = Quasistatic().solve([one, other])
        same = all(np.array_equal(getattr(first, field), getattr(second, field)) for field in _FIELDS)
        wrong.see(float(not same), what)
    return wrong.finding()


def _on_the_surface(full: bool) -> Finding:
    """Compare the forces on switches with those on segments if the glove's reach equals a switch's distance, or almost.

    With k switches on a segment the sum of depths rounds k - 1 times, each quotient and product once: k + 1 roundings
    of the force.
    """
    check = "quasistatic: switches exactly on the surface"
    lost = Worst(check, "exact sums", MOST_SWITCHES + 1.0, "x 2^-53 of the force")
    grasp = held()
    (rest,) = Quasistatic().solve([grasp.load])
    switches = SwitchPlaces(HAND, murakami160())
    tops = switches.tops(HAND.skeleton(rest.posture_deg.T * (np.pi / 180.0)))
    gaps = Pose.of(rest.pose.T).distance(BAR, tops)[0][:, 0]
    near = np.flatnonzero((gaps > 0.0) & (gaps < 4.0) & (rest.capsules_n[0, switches.capsules] > 0.0))
    for switch in near[:: 1 if full else 8].tolist():
        for reach_mm in (float(gaps[switch]), float(np.nextafter(gaps[switch], 9.0))):
            (found,) = Quasistatic(reach_mm=reach_mm).solve([grasp.load])
            borne = fsum([*found.forces_n[0].tolist(), float(found.between_n[0]), *(-found.capsules_n[0]).tolist()])
            lost.see(abs(borne) / fsum(found.capsules_n[0].tolist()) * 2.0**53, switches.layout[switch].name)
    return lost.finding()


def _balanced(grasps: Sequence[Grasp]) -> Iterator[Finding]:
    """Check the balance of forces at 60 digits for every grasp that quasistatic reports as settled.

    At rest the residuals must be below USUAL.rest_n and rest_nmm. Doubles place a sphere to some 1e-13 mm, so the
    residuals are off by about 5e-12 N on each of 50 spheres, at arms of 200 mm: less than a millionth of either.
    """
    forces = Worst("quasistatic at rest: force on the object", REFERENCE, USUAL.rest_n * (1 + 1e-6), "N")
    moments = Worst("quasistatic at rest: moment on the object", REFERENCE, USUAL.rest_nmm * (1 + 1e-6), "N mm")
    joints = Worst("quasistatic at rest: moment on a joint", REFERENCE, USUAL.rest_nmm * (1 + 1e-6), "N mm")
    cones = Worst("quasistatic: friction outside its cone", REFERENCE, 0.0, "spheres of skin")
    for name, load in grasps:
        case = case_of(load)
        (rest,) = close([case], SKIN, MOST_STEPS)
        if not rest.settled[0] or not _has_directions(load):
            continue
        left = left_of(case, rest, SKIN)
        forces.see(left.force_n, name)
        moments.see(left.moment_nmm, name)
        joints.see(left.joints_nmm, name)
        cones.see(float(left.outside), name)
    yield from (worst.finding() for worst in (forces, moments, joints, cones))


def _has_directions(load: Load) -> bool:
    """Return whether every pad has a defined direction; in the exact middle of an object it is arbitrary."""
    hand = load.condition.hand
    pads = [pad.sphere for pad in load.condition.held.pads]
    away = hand.spheres(hand.skeleton(np.radians(load.posture_deg.T)))[pads, :, 0] - load.pose[0, :3]
    return bool((np.abs(away).max(axis=1, initial=0.0) > 1e-9).all())

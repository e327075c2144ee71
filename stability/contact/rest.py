"""Results for hard grasps in the contact model."""

from collections.abc import Iterator, Sequence

import numpy as np

from thenar.simulator.contact.balance import USUAL, Skin
from thenar.simulator.contact.model import Contact, Load
from thenar.simulator.contact.settle import close
from thenar.simulator.effects.contact_quasistatic import MOST_STEPS, USUAL_SKIN, Quasistatic

from ..finding import REFERENCE, Finding, Worst
from .grasps import Grasp, case_of, hard, otherwise
from .posed import residuals

RULE = "the rule itself"
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


def _balanced(grasps: Sequence[Grasp]) -> Iterator[Finding]:
    """Check the balance of forces at 60 digits for every grasp that quasistatic reports as settled.

    At rest the residuals must be below USUAL.rest_n and rest_nmm. Doubles place a sphere to some 1e-13 mm, so the
    residuals are off by about 5e-12 N on each of 50 spheres, at arms of 200 mm: less than a millionth of either.
    """
    forces = Worst("quasistatic at rest: force on the object", REFERENCE, USUAL.rest_n * (1 + 1e-6), "N")
    moments = Worst("quasistatic at rest: moment on the object", REFERENCE, USUAL.rest_nmm * (1 + 1e-6), "N mm")
    joints = Worst("quasistatic at rest: moment on a joint", REFERENCE, USUAL.rest_nmm * (1 + 1e-6), "N mm")
    for name, load in grasps:
        case = case_of(load)
        (rest,) = close([case], SKIN, MOST_STEPS)
        if not rest.settled[0] or not _has_directions(load):
            continue
        for worst, residual in zip((forces, moments, joints), residuals(case, rest, SKIN), strict=True):
            worst.see(residual, name)
    yield from (worst.finding() for worst in (forces, moments, joints))


def _has_directions(load: Load) -> bool:
    """Return whether every pad has a defined direction; in the exact middle of an object it is arbitrary."""
    hand = load.condition.hand
    pads = [pad.sphere for pad in load.condition.held.pads]
    away = hand.spheres(hand.skeleton(np.radians(load.posture_deg.T)))[pads, :, 0] - load.pose[0, :3]
    return bool((np.abs(away).max(axis=1, initial=0.0) > 1e-9).all())

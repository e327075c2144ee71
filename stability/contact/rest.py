"""Results for hard grasps, in the quasistatic model and in MuJoCo."""

from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from math import fsum

import mpmath
import numpy as np
from mpmath import mpf

from thenar.simulator.body.hand import CAPSULES, Hand
from thenar.simulator.body.layout import Switches, murakami160
from thenar.simulator.body.shapes import Pose, Sphere
from thenar.simulator.contact.balance import USUAL, Skin
from thenar.simulator.contact.model import GRAVITY, Contact, ContactModel, Load
from thenar.simulator.contact.settle import close
from thenar.simulator.effects import contact_mujoco, contact_quasistatic
from thenar.simulator.effects.contact_mujoco import Parameters
from thenar.simulator.pipeline.effect import Setting

from ..finding import REFERENCE, Finding, Worst
from ..reference.numbers import precisely
from .grasps import BAR, HAND, Grasp, case_of, hard, held, otherwise
from .posed import Vector, digits, exactly, left_of, length, press_error_n
from .surfaces import MOST_SWITCHES

# MuJoCo's smallest friction (mjMINMU).
_LEAST_FRICTION = 1e-5
SLIPPERY = Parameters(friction=_LEAST_FRICTION)


def timed_findings(make: Callable[..., ContactModel], full: bool) -> Iterator[Finding]:
    """Compare the returned residual on balls with the sum of their contacts, weight and weld.

    Skin presses along the line from the nearest point of a capsule's axis to the ball's centre, and drags by at most
    the smallest friction: the two may differ by this share of all forces; rounding is far less.
    """
    left = Worst("mujoco: residual force on a slippery ball", "60 digits", 1.0, "of the bound")
    for diameter_mm in range(40, 100, 5 if full else 20):
        load = held(Sphere(float(diameter_mm)), pose=np.array([95.0, 5.0, -15.0 - diameter_mm / 2, 0.0, 0.0, 0.0])).load
        (contact,) = make(SLIPPERY).solve([load])
        truth = float(length(left_on_ball(load, contact)))
        bound = _LEAST_FRICTION * float(contact.capsules_n.sum())
        left.see(abs(float(contact.residual_n[0]) - truth) / bound, f"a ball of {diameter_mm} mm")
    yield left.finding()


@precisely()
def left_on_ball(load: Load, contact: Contact) -> Vector:
    """Return the unbalanced force on a ball: contacts along their normals, weight, the weld's spring."""
    condition, position = load.condition, exactly(contact.pose[0, :3])
    left: Vector = mpf(condition.thing.mass_kg) * mpf(GRAVITY) * exactly(condition.held.down)
    left = left + (exactly(load.pose[0, :3]) - position) * (mpf(SLIPPERY.weld_n_per_m) / 1000)
    angles = [mpmath.radians(mpf(x)) for x in contact.posture_deg[0].tolist()]
    for (begin, along, end), press in zip(_axes(condition.hand, angles), contact.capsules_n[0].tolist(), strict=True):
        nearest = begin + along * min(max((position - begin) @ along, mpf(0)), end)
        away = position - nearest
        left = left + away * (mpf(press) / length(away))
    return left


def _axes(hand: Hand, angles: list[mpf]) -> Iterator[tuple[Vector, Vector, mpf]]:
    """Yield every capsule's axis: its start, its direction, its length.

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
            along = exactly(palm.frames[capsule, :, 0, 0])
            yield exactly(palm.origins[capsule, :, 0]) + along * mpf(skin[0]), along, mpf(skin[-1]) - mpf(skin[0])


RULE = "the rule itself"
_STATE = ("posture_deg", "pose", "forces_n", "capsules_n", "between_n")
_FIELDS = (*_STATE, "residual_n", "residual_nmm")
# The effects of a scene do not matter to a contact model.
_SETTING = Setting(1, 1, 1.0, 10_000, 0, 500_000, 0, timed=False, on_wire=False)
_USUAL, _TIMED = contact_quasistatic.Parameters(), contact_mujoco.Parameters()
SKIN = Skin(_USUAL.press_n_per_mm, _USUAL.soft_mm, _USUAL.drag_n_per_mm, _USUAL.friction)
# Skin and friction at the limits of a scene.
_QUASISTATIC = tuple(
    contact_quasistatic.Parameters(press_n_per_mm=press, soft_mm=soft, drag_n_per_mm=drag, friction=friction)
    for press, soft, drag, friction in (
        (5e-324, 5.0, 1000.0, 2.0),
        (1000.0, 5e-324, 1e-300, 0.0),
        (1000.0, 5.0, 1000.0, 2.0),
        (1e-12, 1e-12, 1e-12, 1e-12),
    )
)
_MUJOCO = tuple(
    contact_mujoco.Parameters(dt_ms=ms, friction=friction, skin_n_per_mm=skin, weld_n_per_m=slide, weld_nm_per_rad=turn)
    for ms, friction, skin, slide, turn in (
        (5e-324, 5e-324, 5e-324, 5e-324, 5e-324),
        (10.0, 10.0, 20.0, 20_000.0, 20.0),
        (10.0, 10.0, 20.0, 3000.0, 5e-324),
        (5.0, 0.8, 1e-12, 5e-324, 5.0),
    )
)


def models() -> dict[str, Callable[..., ContactModel]]:
    """Return the constructors of both contact models by name; MuJoCo's only if it is installed."""
    makers: dict[str, Callable[..., ContactModel]] = {
        "quasistatic": lambda given=_USUAL: contact_quasistatic.model(given, _SETTING)
    }
    if find_spec("mujoco") is not None:
        makers["mujoco"] = lambda given=_TIMED: contact_mujoco.model(given, _SETTING)
    return makers


def findings(full: bool) -> Iterator[Finding]:
    """Yield the checks for finite numbers, truthful reports of rest, balance of forces, and invariances."""
    grasps = list(hard(full))
    for name, make in models().items():
        yield _numbers(name, make, grasps)
        yield _nothing(name, make())
        yield _on_the_surface(name, make, full)
    yield from _balanced(grasps[:: 1 if full else 4])
    if "mujoco" in models():
        yield from timed_findings(models()["mujoco"], full)


def _numbers(name: str, make: Callable[..., ContactModel], grasps: Sequence[Grasp]) -> Finding:
    """Count results that are not finite but reported as settled, with all skins."""
    wrong = Worst(f"{name}: finite, or not settled", RULE, 0.0, "results")
    ends = {"quasistatic": _QUASISTATIC, "mujoco": _MUJOCO}[name]
    for model, tried in ((make(), grasps), *((make(given), grasps[::8]) for given in ends)):
        for grasp, contact in zip(tried, model.solve([each.load for each in tried]), strict=True):
            wrong.see(float(not is_honest(contact)), grasp.name)
    return wrong.finding()


def is_honest(contact: Contact) -> bool:
    """Return whether all results are finite; the residual of an abandoned repetition may be infinite."""
    known = all(np.isfinite(getattr(contact, field)).all() for field in _STATE)
    residuals = np.isfinite(contact.residual_n) & np.isfinite(contact.residual_nmm)
    return bool(known and (residuals | ~contact.settled).all())


def _nothing(name: str, model: ContactModel) -> Finding:
    """Count results that differ for equivalent loads.

    An object of zero or the smallest mass has no weight in any direction (for quasistatic that is all; in MuJoCo an
    object has at least the inertia of the minimal mass); no grip equals no pads, and almost equals the smallest grip.
    """
    wrong = Worst(f"{name}: no mass, no grip", RULE, 0.0, "results")
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
        first, second = model.solve([one, other])
        same = all(np.array_equal(getattr(first, field), getattr(second, field)) for field in _FIELDS)
        wrong.see(float(not same), what)
    return wrong.finding()


def _on_the_surface(name: str, make: Callable[..., ContactModel], full: bool) -> Finding:
    """Compare the forces on switches with those on segments if the glove's reach equals a switch's distance, or almost.

    A segment's switches share its force up to k + 1 roundings of it, k the most on one segment (contact_surfaces).
    """
    lost = Worst(f"{name}: switches exactly on the surface", "exact sums", MOST_SWITCHES + 1.0, "x 2^-53 of the force")
    grasp = held()
    (rest,) = make().solve([grasp.load])
    switches = Switches(HAND, murakami160())
    tops = switches.tops(HAND.skeleton(rest.posture_deg.T * (np.pi / 180.0)))
    gaps = Pose.of(rest.pose.T).distance(BAR, tops)[0][:, 0]
    near = np.flatnonzero((gaps > 0.0) & (gaps < 4.0) & (rest.capsules_n[0, switches.capsules] > 0.0))
    usual = type(_USUAL) if name == "quasistatic" else type(_TIMED)
    for switch in near[:: 1 if full else 8].tolist():
        for reach_mm in (float(gaps[switch]), float(np.nextafter(gaps[switch], 9.0))):
            (found,) = make(usual(reach_mm=reach_mm)).solve([grasp.load])
            borne = fsum([*found.forces_n[0].tolist(), float(found.between_n[0]), *(-found.capsules_n[0]).tolist()])
            lost.see(abs(borne) / fsum(found.capsules_n[0].tolist()) * 2.0**53, switches.layout[switch].name)
    return lost.finding()


def _balanced(grasps: Sequence[Grasp]) -> Iterator[Finding]:
    """Check the balance of forces at 60 digits for every grasp that quasistatic reports as settled.

    At rest the residuals must be below USUAL.rest_n and rest_nmm. Their computed values are off by about
    `press_error_n`, 5e-12 N, on each of 50 spheres, at arms of 200 mm: by less than a millionth of either. The error of
    the residual is bounded by the sum of the errors of all contacts.
    """
    forces = Worst("quasistatic at rest: force on the object", REFERENCE, USUAL.rest_n * (1 + 1e-6), "N")
    moments = Worst("quasistatic at rest: moment on the object", REFERENCE, USUAL.rest_nmm * (1 + 1e-6), "N mm")
    joints = Worst("quasistatic at rest: moment on a joint", REFERENCE, USUAL.rest_nmm * (1 + 1e-6), "N mm")
    residuals = Worst("quasistatic: reported residual forces", REFERENCE, 1.0, "of the bound")
    presses = Worst("quasistatic: force on a sphere of skin", REFERENCE, 1.0, "of the bound")
    cones = Worst("quasistatic: friction outside its cone", REFERENCE, 0.0, "spheres of skin")
    for name, load in grasps:
        case = case_of(load)
        (rest,) = close([case], SKIN, _USUAL.most_steps)
        if not rest.settled[0] or not _has_directions(load):
            continue
        left = left_of(case, rest, SKIN, 0)
        forces.see(left.force_n, name)
        moments.see(left.moment_nmm, name)
        joints.see(left.joints_nmm, name)
        press_error = press_error_n(case, SKIN, float(rest.presses.max()))
        presses.see(left.press_n / press_error, name)
        touching = max(int(np.count_nonzero(rest.presses)), 1)
        residuals.see(abs(float(rest.residual_n[0]) - left.residual_n) / (touching * press_error), name)
        cones.see(float(left.outside), name)
    yield from (worst.finding() for worst in (forces, moments, joints, residuals, presses, cones))


def _has_directions(load: Load) -> bool:
    """Return whether every pad has a defined direction; in the exact middle of an object it is arbitrary."""
    hand = load.condition.hand
    pads = [pad.sphere for pad in load.condition.held.pads]
    away = hand.spheres(hand.skeleton(np.radians(load.posture_deg.T)))[pads, :, 0] - load.pose[0, :3]
    return bool((np.abs(away).max(axis=1, initial=0.0) > 1e-9).all())

"""A hand and an object as MuJoCo knows them: the same capsules on the same joints as hand.py, in metres and kilograms.

Every capsule of a digit is a body whose own axes are those of `Skeleton.frames`; the palm's are fixed. The object
slides and turns on springs about its commanded pose, a soft weld. Gravity is off: the true weight is applied as a
force, so that a light object can be given inertia enough for a stable step.
"""

from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..body.condition import Thing
from ..body.hand import CAPSULES, DOF, LIMITS_DEG, Hand, Skeleton
from ..body.shapes import Box, Cylinder, Shape, Sphere
from .grip import STIFFNESS

if TYPE_CHECKING:
    from ..effects.contact_mujoco import Parameters

Floats = NDArray[np.float64]

JOINTS = len(DOF)
OBJECT = "object"
MM, N_MM = 1e-3, 1e-3  # one millimetre in metres, one newton millimetre in newton metres
# What the dynamics need and rest does not know: rotor inertia of the joints (kg m2), density of the fingers (kg/m3),
# and the least mass (kg) and moment of inertia (kg m2) of an object. The springs on them are then slow enough for 5 ms.
_ARMATURE, _DENSITY, _LEAST_MASS, _LEAST_INERTIA = 2e-4, 1000.0, 0.1, 2e-4
# MuJoCo refuses what has next to no size (m) or mass (kg, kg m2): so much has everything, far below what is felt.
_LEAST_SIZE, _LEAST_PART = 1e-9, 1e-12
# Share of a contact that MuJoCo's solver takes as a hard constraint; the skin is the rest.
_IMPEDANCE = 0.9
# MuJoCo's friction creeps, the less the higher this ratio: at 1 nothing sticks for as long as a grasp takes to settle.
_GRIPS = 20.0
# Bits of who meets whom: parts of the hand meet the object, never one another.
_HAND, _OBJECT = 1, 2


def build(hand: Hand, thing: Thing, parameters: "Parameters") -> mujoco.MjModel:
    """Return the model of `hand` and `thing`: joints 0 to 19 in the order of DOF, then the object's three slides and
    its ball joint; the object is the last body; geoms bear the names of CAPSULES and `OBJECT`.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.compiler.boundmass = spec.compiler.boundinertia = _LEAST_PART
    spec.option.timestep = parameters.dt_ms / 1e3
    spec.option.gravity = [0.0, 0.0, 0.0]
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.impratio = _GRIPS
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
    _add_hand(spec, hand, parameters.friction)
    _add_object(spec, thing, parameters)
    model = spec.compile()
    _soften(model, parameters.skin_n_per_mm / MM)
    return model


def _add_hand(spec: mujoco.MjSpec, hand: Hand, friction: float) -> None:
    skeleton = hand.skeleton(np.zeros((JOINTS, 1)))
    for digit in range(5):
        body = spec.worldbody
        for segment in range(3):
            body = _add_segment(body, skeleton, 3 * digit + segment)
            for joint in (0, 1) if segment == 0 else (segment + 1,):
                _add_joint(body, skeleton, digit, joint, segment)
            _add_capsule(body, hand, 3 * digit + segment, np.zeros(3), np.eye(3), friction)
    for capsule in range(15, len(CAPSULES)):
        origin, frame = skeleton.origins[capsule, :, 0] * MM, skeleton.frames[capsule, :, :, 0]
        _add_capsule(spec.worldbody, hand, capsule, origin, frame, friction)


def _add_segment(parent: mujoco.MjsBody, skeleton: Skeleton, capsule: int) -> mujoco.MjsBody:
    origin, frame = skeleton.origins[capsule, :, 0], skeleton.frames[capsule, :, :, 0]
    if capsule % 3:
        beneath = skeleton.frames[capsule - 1, :, :, 0]
        origin = _seen_from(beneath, origin - skeleton.origins[capsule - 1, :, 0])
        frame = _seen_from(beneath, frame)
    return parent.add_body(name=CAPSULES[capsule], pos=origin * MM, quat=_quaternion(frame))


def _add_joint(body: mujoco.MjsBody, skeleton: Skeleton, digit: int, joint: int, segment: int) -> None:
    number = 4 * digit + joint
    stiffness = STIFFNESS[number] * N_MM
    body.add_joint(
        name=DOF[number],
        type=mujoco.mjtJoint.mjJNT_HINGE,
        range=np.radians(LIMITS_DEG[number]),
        axis=_seen_from(skeleton.frames[3 * digit + segment, :, :, 0], skeleton.axes[digit, joint, :, 0]),
        stiffness=[stiffness, 0.0, 0.0],
        damping=[_critical(stiffness, _ARMATURE), 0.0, 0.0],
        armature=_ARMATURE,
    )


def _add_capsule(
    body: mujoco.MjsBody, hand: Hand, capsule: int, origin: Floats, frame: Floats, friction: float
) -> None:
    begin, end = (origin + frame[:, 0] * along * MM for along in _span_mm(hand, capsule))
    body.add_geom(
        name=CAPSULES[capsule],
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[*begin, *end],
        size=[hand.radii[capsule] * MM, 0.0, 0.0],
        density=_DENSITY,
        contype=_HAND,
        conaffinity=_OBJECT,
        priority=1,
        friction=[friction, 0.0, 0.0],
        solimp=[_IMPEDANCE, _IMPEDANCE, 1.0, 0.5, 1.0],
    )


def _span_mm(hand: Hand, capsule: int) -> tuple[float, float]:
    """Return where the axis of a capsule begins and ends: at the joints, and where there is none at the first or last
    sphere of skin (hand.py), so that a digit has its round tip and what passes the wrist touches nothing.
    """
    skin = hand.sphere_offsets[hand.sphere_capsules == capsule]
    begins_at_joint, ends_at_joint = capsule < 15, capsule < 15 and capsule % 3 < 2
    return 0.0 if begins_at_joint else float(skin.min()), float(hand.lengths[capsule] if ends_at_joint else skin.max())


def _add_object(spec: mujoco.MjSpec, thing: Thing, parameters: "Parameters") -> None:
    kind, size, quaternion = _geom(thing.shape)
    mass, inertia = _inertia(thing)
    body = spec.worldbody.add_body(
        name=OBJECT, mass=mass, inertia=inertia, ipos=[0.0] * 3, iquat=[1.0, 0.0, 0.0, 0.0], explicitinertial=True
    )
    slide, turn = parameters.weld_n_per_m, parameters.weld_nm_per_rad
    for axis in np.eye(3):
        _add_spring(body, mujoco.mjtJoint.mjJNT_SLIDE, axis, slide, _critical(slide, mass))
    _add_spring(body, mujoco.mjtJoint.mjJNT_BALL, np.eye(3)[2], turn, _critical(turn, float(np.max(inertia))))
    body.add_geom(name=OBJECT, type=kind, size=size, quat=quaternion, density=0.0, contype=_OBJECT, conaffinity=_HAND)


def _add_spring(body: mujoco.MjsBody, kind: mujoco.mjtJoint, axis: Floats, stiffness: float, damping: float) -> None:
    body.add_joint(type=kind, axis=axis, stiffness=[stiffness, 0.0, 0.0], damping=[damping, 0.0, 0.0])


def _critical(stiffness: float, inertia: float) -> float:
    """Return the damping that brings a mass on a spring to rest soonest."""
    return 2.0 * float(np.sqrt(stiffness * inertia))


def _geom(shape: Shape) -> tuple[mujoco.mjtGeom, Floats, list[float]]:
    """Return kind, half sizes in metres (none is 0) and turn of the primitive; rounded edges are left sharp."""
    half = np.maximum(np.array(shape.extent_mm()) / 2 * MM, _LEAST_SIZE)
    straight = [1.0, 0.0, 0.0, 0.0]
    match shape:
        case Sphere():
            return mujoco.mjtGeom.mjGEOM_SPHERE, half, straight
        case Cylinder():  # MuJoCo's lies along z, ours along x
            return mujoco.mjtGeom.mjGEOM_CYLINDER, half[[1, 0, 2]], [np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0]
        case Box():
            return mujoco.mjtGeom.mjGEOM_BOX, half, straight


def _inertia(thing: Thing) -> tuple[float, Floats]:
    """Return mass and principal moments of a box of the object's size, each at least what a stable step needs."""
    mass = max(thing.mass_kg, _LEAST_MASS)
    square = (np.array(thing.shape.extent_mm()) * MM) ** 2
    return mass, np.maximum(mass * (square.sum() - square) / 12.0, _LEAST_INERTIA)


def _seen_from(frame: Floats, vectors: Floats) -> Floats:
    """Return vectors (3, ...) of the hand in the axes that are the columns of `frame` (3, 3)."""
    return np.stack([np.add.reduce((axis * vectors.T).T, axis=0) for axis in frame.T])


def _quaternion(frame: Floats) -> Floats:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(frame).ravel())
    return quaternion


def _soften(model: mujoco.MjModel, skin_n_per_m: float) -> None:
    """Give every capsule skin of one stiffness, critically damped.

    A contact that rests at depth r bears aref / R = (solref / d^2) d r * d / ((1 - d) A), with impedance d and A the
    sum of both bodies' inverse masses (MuJoCo's documentation, Computation, "Parameters"): solved for solref.
    """
    inverse_mass = model.body_invweight0[model.geom_bodyid, 0]
    stiffness = skin_n_per_m * (1.0 - _IMPEDANCE) * (inverse_mass + model.body(OBJECT).invweight0[0])
    model.geom_solref[:, 0], model.geom_solref[:, 1] = -stiffness, -2.0 * np.sqrt(stiffness)

"""An oracle of contact: grasps in MuJoCo, with friction and in time. The hand takes a posture and a grip, time runs
until it rests, and the contacts are read.

The model has the same capsules on the same joints as hand.py, in metres and kilograms. Every capsule of a digit is a
body with the axes of `Skeleton.frames`; the palm's are fixed. The object slides and rotates on springs about its
commanded pose, a soft weld. Gravity is off: the true weight is applied as a force, so that a light object can have
enough inertia for a stable step.
"""

import mujoco
import numpy as np

from thenar.compiler.elementary import Floats
from thenar.simulator.body.condition import Thing
from thenar.simulator.body.hand import CAPSULES, DOF, LIMITS_DEG, Hand, Skeleton
from thenar.simulator.body.layout import SwitchPlaces, murakami160
from thenar.simulator.body.shapes import Box, Cylinder, Pose, Shape, Sphere
from thenar.simulator.contact.model import GRAVITY, STIFFNESS, Contact, Load, split, torques

JOINTS = len(DOF)
OBJECT = "object"
MM, N_MM = 1e-3, 1e-3  # one millimetre in metres, one newton millimetre in newton metres
# Parameters of the dynamics that do not affect rest: rotor inertia of the joints (kg m2), density of the fingers
# (kg/m3), and the least mass (kg) and moment of inertia (kg m2) of an object. This suits steps of 5 ms.
_ARMATURE, _DENSITY, _LEAST_MASS, _LEAST_INERTIA = 2e-4, 1000.0, 0.1, 2e-4
# MuJoCo rejects tiny sizes (m) and masses (kg, kg m2): these minima are far below any effect.
_LEAST_SIZE, _LEAST_PART = 1e-9, 1e-12
# Share of a contact that MuJoCo's solver takes as a hard constraint; the skin is the rest.
_IMPEDANCE = 0.9
# MuJoCo's friction creeps, the less the higher this ratio: at 1 nothing sticks for as long as a grasp takes to settle.
_GRIPS = 20.0
# Collision bits: parts of the hand collide with the object, never with each other.
_HAND, _OBJECT = 1, 2


# 60 steps of 5 ms come closer to rest than 100 of 2 ms. Friction and stiffness of the skin are of the order measured on
# dry fingertips; a switch shares the force as far from the object as in contact.quasistatic; a stiff weld holds the
# object at its commanded pose.
_DT_MS, _STEPS, _FRICTION, _SKIN_N_PER_MM, _REACH_MM = 5.0, 60, 0.8, 2.0, 1.0
_WELD_N_PER_M, _WELD_NM_PER_RAD = 3000.0, 5.0


def build(hand: Hand, thing: Thing) -> mujoco.MjModel:
    """Return the model of `hand` and `thing`: joints 0 to 19 in the order of DOF, then the object's three slides and
    its ball joint; the object is the last body; geoms have the names of CAPSULES and `OBJECT`.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.compiler.boundmass = spec.compiler.boundinertia = _LEAST_PART
    spec.option.timestep = _DT_MS / 1e3
    spec.option.gravity = [0.0, 0.0, 0.0]
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.impratio = _GRIPS
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
    _add_hand(spec, hand)
    _add_object(spec, thing)
    model = spec.compile()
    _soften(model)
    return model


def _add_hand(spec: mujoco.MjSpec, hand: Hand) -> None:
    skeleton = hand.skeleton(np.zeros((JOINTS, 1)))
    for digit in range(5):
        body = spec.worldbody
        for segment in range(3):
            body = _add_segment(body, skeleton, 3 * digit + segment)
            for joint in (0, 1) if segment == 0 else (segment + 1,):
                _add_joint(body, skeleton, digit, joint, segment)
            _add_capsule(body, hand, 3 * digit + segment, np.zeros(3), np.eye(3))
    for capsule in range(15, len(CAPSULES)):
        origin, frame = skeleton.origins[capsule, :, 0] * MM, skeleton.frames[capsule, :, :, 0]
        _add_capsule(spec.worldbody, hand, capsule, origin, frame)


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


def _add_capsule(body: mujoco.MjsBody, hand: Hand, capsule: int, origin: Floats, frame: Floats) -> None:
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
        friction=[_FRICTION, 0.0, 0.0],
        solimp=[_IMPEDANCE, _IMPEDANCE, 1.0, 0.5, 1.0],
    )


def _span_mm(hand: Hand, capsule: int) -> tuple[float, float]:
    """Return the start and the end of a capsule's axis: at the joints, or without one at the first or last sphere of
    skin (hand.py), so that a digit has its round tip, and the part beyond the wrist touches nothing.
    """
    skin = hand.sphere_offsets[hand.sphere_capsules == capsule]
    begins_at_joint, ends_at_joint = capsule < 15, capsule < 15 and capsule % 3 < 2
    return 0.0 if begins_at_joint else float(skin.min()), float(hand.lengths[capsule] if ends_at_joint else skin.max())


def _add_object(spec: mujoco.MjSpec, thing: Thing) -> None:
    kind, size, quaternion = _geom(thing.shape)
    mass, inertia = _inertia(thing)
    body = spec.worldbody.add_body(
        name=OBJECT, mass=mass, inertia=inertia, ipos=[0.0] * 3, iquat=[1.0, 0.0, 0.0, 0.0], explicitinertial=True
    )
    slide, turn = _WELD_N_PER_M, _WELD_NM_PER_RAD
    for axis in np.eye(3):
        _add_spring(body, mujoco.mjtJoint.mjJNT_SLIDE, axis, slide, _critical(slide, mass))
    _add_spring(body, mujoco.mjtJoint.mjJNT_BALL, np.eye(3)[2], turn, _critical(turn, float(np.max(inertia))))
    body.add_geom(name=OBJECT, type=kind, size=size, quat=quaternion, density=0.0, contype=_OBJECT, conaffinity=_HAND)


def _add_spring(body: mujoco.MjsBody, kind: mujoco.mjtJoint, axis: Floats, stiffness: float, damping: float) -> None:
    body.add_joint(type=kind, axis=axis, stiffness=[stiffness, 0.0, 0.0], damping=[damping, 0.0, 0.0])


def _critical(stiffness: float, inertia: float) -> float:
    """Return the critical damping of a mass on a spring."""
    return 2.0 * float(np.sqrt(stiffness * inertia))


def _geom(shape: Shape) -> tuple[mujoco.mjtGeom, Floats, list[float]]:
    """Return kind, half sizes in metres (none is 0) and rotation of the primitive, with sharp edges."""
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
    """Return mass and principal moments of a box of the object's size, each at least the minimum for a stable step."""
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


def _soften(model: mujoco.MjModel) -> None:
    """Set skin of one stiffness on every capsule, critically damped.

    A contact that rests at depth r bears aref / R = (solref / d^2) d r * d / ((1 - d) A), with impedance d and A the
    sum of both bodies' inverse masses (MuJoCo's documentation, Computation, Dynamics): solved for solref.
    """
    inverse_mass = model.body_invweight0[model.geom_bodyid, 0]
    stiffness = _SKIN_N_PER_MM / MM * (1.0 - _IMPEDANCE) * (inverse_mass + model.body(OBJECT).invweight0[0])
    model.geom_solref[:, 0], model.geom_solref[:, 1] = -stiffness, -2.0 * np.sqrt(stiffness)


_SLIDES = slice(JOINTS, JOINTS + 3)
_BALL = slice(JOINTS + 3, JOINTS + 6)
_TURN = slice(JOINTS + 3, JOINTS + 7)  # of qpos, where a rotation takes four numbers
# Limits at rest: angular speed of joints and object (rad/s; motion decays within about 20 ms, so this moves a fingertip
# by tenths of a mm at most), sliding speed as that of a lever's end (m); the unbalanced force on the object in newtons,
# and as a share of all contacts. With a soft, weakly damped hold, balance alone does not imply rest.
_SPEED, _LEVER, _UNBALANCED_N, _UNBALANCED_SHARE = 0.1, 0.03, 0.1, 0.02


# One repetition at rest: angles (20,) in radians, pose (6,), capsules_n (20,), the force and the moment that nothing
# balances, and whether MuJoCo warned of nothing and joints and object stand still.
Settled = tuple[Floats, Floats, Floats, float, float, bool]


def solve(load: Load) -> Contact:
    """Return the rest of the hands of a load, one repetition after another."""
    condition = load.condition
    hand, shape = condition.hand, condition.thing.shape
    angles = np.radians(load.posture_deg.T)
    moments = load.grip_n * torques(condition, hand.skeleton(angles), Pose.of(load.pose.T))
    pair = Pair(hand, condition.thing, condition.held.down)
    rests = [pair.rest(*commands) for commands in zip(angles.T, load.pose, moments.T, strict=True)]
    angles, pose, capsules_n, residual_n, residual_nmm, at_rest = map(np.array, zip(*rests, strict=True))
    switches = SwitchPlaces(hand, murakami160())
    gaps = Pose.of(pose.T).distance(shape, switches.tops(hand.skeleton(angles.T)))[0]
    forces_n, between_n = split(switches, _REACH_MM - gaps, capsules_n.T)
    return Contact(
        posture_deg=np.degrees(angles),
        pose=pose,
        forces_n=forces_n.T,
        capsules_n=capsules_n,
        between_n=between_n,
        settled=at_rest,
        residual_n=residual_n,
        residual_nmm=residual_nmm,
        steps=len(rests) * _STEPS,
    )


class Pair:
    """A hand and an object in MuJoCo, reused for every repetition."""

    def __init__(self, hand: Hand, thing: Thing, down: Floats) -> None:
        self._model = build(hand, thing)
        self._data = mujoco.MjData(self._model)
        self._weight = thing.mass_kg * GRAVITY * down
        self._object = self._model.geom(OBJECT).id
        names = [self._model.geom(number).name for number in range(self._model.ngeom)]
        self._capsules = np.array([CAPSULES.index(name) if name != OBJECT else -1 for name in names])

    def rest(self, angles: Floats, pose: Floats, moments: Floats) -> Settled:
        """Return the rest of a hand commanded to angles (20,) in radians around an object at pose (6,), with
        muscle moments (20,) in N mm. No data of the previous grasp remains.
        """
        data, model = self._data, self._model
        mujoco.mj_resetData(model, data)
        data.qpos[:] = _places(angles, pose)
        model.qpos_spring[:] = data.qpos
        data.qfrc_applied[:JOINTS] = moments * N_MM
        data.xfrc_applied[-1, :3] = self._weight
        mujoco.mj_step(model, data, _STEPS)
        mujoco.mj_forward(model, data)
        if data.warning.number.any() or not np.isfinite(data.qacc).all():
            return angles, pose, np.zeros(len(CAPSULES)), np.inf, np.inf, False
        return self._read()

    def _read(self) -> Settled:
        data = self._data
        capsules_n, force, moment = self._contacts()
        force = force + self._weight + data.qfrc_spring[_SLIDES]
        turn = data.xmat[-1].reshape(3, 3)
        moment = moment + np.add.reduce(turn.T * data.qfrc_spring[_BALL][:, None], axis=0)
        residual_n, residual_nmm = _length(force), _length(moment) / N_MM
        speeds = np.abs(data.qvel)
        speeds[_SLIDES] /= _LEVER
        balanced = residual_n <= _UNBALANCED_N + _UNBALANCED_SHARE * float(capsules_n.sum())
        stands_still = float(speeds.max()) <= _SPEED
        angles = data.qpos[:JOINTS].copy()
        return angles, _pose(data.qpos), capsules_n, residual_n, residual_nmm, stands_still and balanced

    def _contacts(self) -> tuple[Floats, Floats, Floats]:
        """Return the normal forces on the capsules (20,), and the contacts' force and moment (3,) on the object."""
        contacts = self._data.contact
        meeting = contacts.efc_address >= 0
        address = contacts.efc_address[meeting]
        flipped = np.where(contacts.geom[meeting, 0] == self._object, -1.0, 1.0)
        loads = np.stack([self._data.efc_force[address + axis] for axis in range(3)], axis=1)
        frames = contacts.frame[meeting].reshape(-1, 3, 3)
        forces = np.add.reduce(np.moveaxis(frames * loads[:, :, None], 1, 0), axis=0) * flipped[:, None]
        arms = contacts.pos[meeting] - self._data.xpos[-1]
        capsules = self._capsules[np.where(flipped > 0, contacts.geom[meeting, 0], contacts.geom[meeting, 1])]
        normal = np.zeros(len(CAPSULES))
        np.add.at(normal, capsules, loads[:, 0])
        return normal, np.add.reduce(forces, axis=0), np.add.reduce(np.cross(arms, forces), axis=0)


def _places(angles: Floats, pose: Floats) -> Floats:
    turn = np.array([1.0, 0.0, 0.0, 0.0])
    mujoco.mju_quatIntegrate(turn, pose[3:], 1.0)
    return np.concatenate([angles, pose[:3] * MM, turn])


def _pose(places: Floats) -> Floats:
    turn = np.empty(3)
    mujoco.mju_quat2Vel(turn, places[_TURN], 1.0)
    return np.concatenate([places[_SLIDES] / MM, turn])


def _length(vector: Floats) -> float:
    return float(np.sqrt(np.add.reduce(vector * vector)))

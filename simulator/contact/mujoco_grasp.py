"""Grasps in MuJoCo: the hand is told a posture and a grip, time runs until it rests, and the contacts are read."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..body.condition import Thing
from ..body.hand import CAPSULES, Hand
from ..body.layout import Patch, Switches
from ..body.pose import Pose
from .grip import GRAVITY, torques
from .model import Contact, Load
from .mujoco_model import JOINTS, MM, N_MM, OBJECT, build
from .split import split

if TYPE_CHECKING:
    from ..effects.contact_mujoco import Parameters

Floats = NDArray[np.float64]

_SLIDES = slice(JOINTS, JOINTS + 3)
_BALL = slice(JOINTS + 3, JOINTS + 6)
_TURN = slice(JOINTS + 3, JOINTS + 7)  # of qpos, where a turn takes four numbers
# At rest: neither joint nor object turns faster than this (rad/s; motion dies within some 20 ms, so little of it moves
# a fingertip by tenths of a mm) or slides as fast, at a lever's end (m); and what nothing balances on the object is at
# most so many newtons and such a share of all contacts. On a soft hold, little damped, balance alone is no rest.
_SPEED, _LEVER, _UNBALANCED_N, _UNBALANCED_SHARE = 0.1, 0.03, 0.1, 0.02


@dataclass(frozen=True, slots=True)
class Rest:
    """One repetition at rest: angles (20,) in radians, pose (6,), capsules_n (20,), what nothing balances, and whether
    MuJoCo warned of nothing and joints and object stand still.
    """

    angles: Floats
    pose: Floats
    capsules_n: Floats
    residual_n: float
    residual_nmm: float
    settled: bool


@dataclass(frozen=True, slots=True)
class MujocoContact:
    """The contact model of rigid-body dynamics with friction."""

    parameters: "Parameters"
    layout: tuple[Patch, ...]

    def solve(self, loads: Sequence[Load]) -> list[Contact]:
        """Return how the hands rest (contact.ContactModel), one repetition after another."""
        with _warnings_counted_only():
            return [self._solve(load) for load in loads]

    def _solve(self, load: Load) -> Contact:
        condition = load.condition
        hand, shape = condition.hand, condition.thing.shape
        angles = np.radians(load.posture_deg.T)
        moments = load.grip_n * torques(condition, hand.skeleton(angles), Pose.of(load.pose.T))
        bench = Bench(hand, condition.thing, condition.held.down, self.parameters)
        rests = [bench.rest(*told) for told in zip(angles.T, load.pose, moments.T, strict=True)]
        angles = np.array([rest.angles for rest in rests])
        pose = np.array([rest.pose for rest in rests])
        capsules_n = np.array([rest.capsules_n for rest in rests])
        switches = Switches(hand, self.layout)
        gaps = Pose.of(pose.T).distance(shape, switches.tops(hand.skeleton(angles.T)))[0]
        forces_n, between_n = split(switches, self.parameters.reach_mm - gaps, capsules_n.T)
        return Contact(
            posture_deg=np.degrees(angles),
            pose=pose,
            forces_n=forces_n.T,
            capsules_n=capsules_n,
            between_n=between_n,
            settled=np.array([rest.settled for rest in rests]),
            residual_n=np.array([rest.residual_n for rest in rests]),
            residual_nmm=np.array([rest.residual_nmm for rest in rests]),
            steps=len(rests) * self.parameters.steps,
        )


class Bench:
    """A hand and an object on MuJoCo's bench, used again for every repetition."""

    def __init__(self, hand: Hand, thing: Thing, down: Floats, parameters: "Parameters") -> None:
        self._parameters = parameters
        self._model = build(hand, thing, parameters)
        self._data = mujoco.MjData(self._model)
        self._weight = thing.mass_kg * GRAVITY * down
        self._object = self._model.geom(OBJECT).id
        names = [self._model.geom(number).name for number in range(self._model.ngeom)]
        self._capsules = np.array([CAPSULES.index(name) if name != OBJECT else -1 for name in names])

    def rest(self, angles: Floats, pose: Floats, moments: Floats) -> Rest:
        """Return how the hand rests that is told angles (20,) in radians round an object at pose (6,), and whose
        muscles turn its joints by moments (20,) in N mm. Nothing of the grasp before is left in the data.
        """
        data, model = self._data, self._model
        mujoco.mj_resetData(model, data)
        data.qpos[:] = _places(angles, pose)
        model.qpos_spring[:] = data.qpos
        data.qfrc_applied[:JOINTS] = moments * N_MM
        data.xfrc_applied[-1, :3] = self._weight
        mujoco.mj_step(model, data, self._parameters.steps)
        mujoco.mj_forward(model, data)
        if data.warning.number.any() or not np.isfinite(data.qacc).all():
            return Rest(angles, pose, np.zeros(len(CAPSULES)), np.inf, np.inf, settled=False)
        return self._read()

    def _read(self) -> Rest:
        data = self._data
        capsules_n, force, moment = self._contacts()
        force = force + self._weight + data.qfrc_spring[_SLIDES]
        turn = data.xmat[-1].reshape(3, 3)
        moment = moment + np.add.reduce(turn.T * data.qfrc_spring[_BALL][:, None], axis=0)
        residual_n, residual_nmm = _length(force), _length(moment) / N_MM
        return Rest(
            angles=data.qpos[:JOINTS].copy(),
            pose=_pose(data.qpos),
            capsules_n=capsules_n,
            residual_n=residual_n,
            residual_nmm=residual_nmm,
            settled=self._stands_still() and residual_n <= _UNBALANCED_N + _UNBALANCED_SHARE * float(capsules_n.sum()),
        )

    def _stands_still(self) -> bool:
        speeds = np.abs(self._data.qvel)
        speeds[_SLIDES] /= _LEVER
        return float(speeds.max()) <= _SPEED

    def _contacts(self) -> tuple[Floats, Floats, Floats]:
        """Return the normal forces on the capsules (20,), and on the object the contacts' force and their moment about
        its centre (3,).
        """
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


@contextmanager
def _warnings_counted_only() -> Iterator[None]:
    """Keep MuJoCo from writing a warning to the console and into a file of the working folder: `MjData` counts them."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


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

"""Newton's method to bring every repetition to rest."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats, add_up

from ..body.shapes import Pose
from .balance import (
    DIGIT_SPHERES,
    HOLD_N_PER_MM,
    HOLD_NMM_PER_RAD,
    LIMIT_NMM_PER_RAD,
    USUAL,
    Balance,
    HandCommand,
    Skin,
    SolverSettings,
    command,
    contract,
    cross,
    dot,
    wrench,
)
from .model import STIFFNESS, Load


def cholesky(matrix: Floats) -> Floats:
    """Return the lower factors (k, k, ...) of positive definite matrices (k, k, ...)."""
    size = len(matrix)
    lower = np.zeros_like(matrix)
    for j in range(size):
        rest = matrix[j:, j].copy()
        for k in range(j):
            rest -= lower[j:, k] * lower[j, k]
        lower[j, j] = np.sqrt(rest[0])
        lower[j + 1 :, j] = rest[1:] / lower[j, j]
    return lower


def forward(lower: Floats, right: Floats) -> Floats:
    """Solve L y = right for (k, r, ...) right-hand sides."""
    solved = right.copy()
    for j in range(len(lower)):
        solved[j] /= lower[j, j]
        for i in range(j + 1, len(lower)):
            solved[i] -= lower[i, j] * solved[j]
    return solved


def backward(lower: Floats, right: Floats) -> Floats:
    """Solve L^T x = right for (k, r, ...) right-hand sides."""
    solved = right.copy()
    for j in range(len(lower) - 1, -1, -1):
        solved[j] /= lower[j, j]
        for i in range(j):
            solved[i] -= lower[j, i] * solved[j]
    return solved


def solve_arrow(limbs: Floats, coupling: Floats, body: Floats, on_limbs: Floats, on_body: Floats) -> Floats:
    """Solve systems of d limbs coupled only through one body, by eliminating the limbs (Schur complement).

    limbs (d, 4, 4, n), coupling (d, 4, 6, n), body (6, 6, n); right sides on_limbs (d, 4, n), on_body (6, n).
    Returns (4 d + 6, n).
    """
    lower = cholesky(limbs.transpose(1, 2, 0, 3))
    sides = np.concatenate([coupling.transpose(1, 2, 0, 3), on_limbs.swapaxes(0, 1)[:, None]], axis=1)
    half = forward(lower[:, :, None], sides)
    wide, last = half[:, :6], half[:, 6]
    reduced, right = body.copy(), on_body.copy()
    for joint in range(4):
        reduced -= add_up((wide[joint, :, None] * wide[joint, None, :]).transpose(2, 0, 1, 3))
        right -= add_up((wide[joint] * last[joint]).swapaxes(0, 1))
    factor = cholesky(reduced)
    moved = backward(factor[:, :, None], forward(factor[:, :, None], right[:, None]))[:, 0]
    for column in range(6):
        last = last - wide[:, column] * moved[column]
    turned = backward(lower[:, :, None], last[:, None])[:, 0]
    return np.concatenate([turned.swapaxes(0, 1).reshape(-1, moved.shape[1]), moved])


Indices = NDArray[np.intp]

_LARGEST_STEP = np.array([0.12] * 20 + [3.0] * 3 + [0.12] * 3)[:, None]  # radians; mm; radians
_LARGEST_SINK_MM = 1.0  # largest increase of penetration in one step
_HOLD_STIFFNESS = np.array([HOLD_N_PER_MM] * 3 + [HOLD_NMM_PER_RAD] * 3)[:, None]


def newton_step(balance: Balance) -> Floats:
    """Return the step (26, n) of angles, position and rotation; shortened if it is long or increases penetration."""
    joints, coupling, body = stiffness(balance)
    found = solve_arrow(joints, coupling, body, balance.on_joints.reshape(5, 4, -1), balance.on_object)
    longest: Floats = (np.abs(found) / _LARGEST_STEP).max(axis=0)
    found = found / np.maximum(longest, 1.0)
    return found * _unhurt(balance, found)


def _unhurt(balance: Balance, step: Floats) -> Floats:
    """Return the share of a step (n,) at which no skin penetrates much deeper than the step predicts."""
    n = step.shape[1]
    moved = balance.jacobian * step[:20].reshape(5, 1, 4, 1, n)
    nearing = step[20:23] + cross(np.broadcast_to(step[23:], balance.levers.shape), balance.levers)
    nearing[:DIGIT_SPHERES] -= add_up(moved.transpose(2, 0, 1, 3, 4)).reshape(DIGIT_SPHERES, 3, n)
    room = np.maximum(-balance.sunk, 0.0) + _LARGEST_SINK_MM
    worst: Floats = (dot(nearing, balance.normal) / room).max(axis=0)
    return 1.0 / np.maximum(worst, 1.0)


def stiffness(balance: Balance) -> tuple[Floats, Floats, Floats]:
    """Return the matrix in blocks: joints (5, 4, 4, n), joints with object (5, 4, 6, n), object (6, 6, n).

    Only spheres that touch in any of the repetitions are summed: the others would only add zeros.
    """
    n = balance.angles.shape[1]
    joints, coupling, body = np.zeros((5, 4, 4, n)), np.zeros((5, 4, 6, n)), np.zeros((6, 6, n))
    touching = np.flatnonzero((balance.presses > 0.0).any(axis=1))
    levers = balance.levers[touching]
    for block in wrench(levers, _resisted(balance, _body_rows(levers), touching)):
        body += block
    of_digits = touching[touching < DIGIT_SPHERES]
    spread = balance.jacobian.reshape(DIGIT_SPHERES, 4, 3, n)[of_digits]
    skin = _resisted(balance, spread, of_digits)
    between = wrench(balance.levers[of_digits], skin)
    for sphere, block, pull in zip(of_digits, contract(spread, skin), between, strict=True):
        joints[sphere // 7] += block
        coupling[sphere // 7] -= pull
    spring = STIFFNESS[:, None] + LIMIT_NMM_PER_RAD * balance.beyond
    joints[:, np.arange(4), np.arange(4)] += spring.reshape(5, 4, n)
    body[np.arange(6), np.arange(6)] += _HOLD_STIFFNESS
    return joints, coupling, body


def _resisted(balance: Balance, rows: Floats, spheres: Indices) -> Floats:
    """Return K r for rows r (m, k, 3, n), with K the stiffness of the skin of m `spheres`.

    K = sideways (I - n n^T) + press n n^T. On a curved surface, pressing skin is pushed on when it moves sideways: this
    reduces K across a ball, and across a bar but not along it.

    Omitted, so that K stays symmetric and positive: sticking and slipping skin resists more at greater depth, slipping
    skin does not resist along its slip, contact points move over skin and edges, and levers and normals rotate with
    what they press.
    """
    normal, bent = balance.normal[spheres, None], balance.bent[spheres, None]
    sideways = balance.drag[spheres, None] - bent
    across = rows[:, :, 0] * normal[:, :, 0] + rows[:, :, 1] * normal[:, :, 1] + rows[:, :, 2] * normal[:, :, 2]
    pressed = (balance.press_stiffness[spheres, None] - sideways) * across
    resisted = sideways[:, :, None] * rows
    resisted += pressed[:, :, None] * normal
    x, y, z = balance.pose.rotation[:, 0]
    along = (rows[:, :, 0] * x + rows[:, :, 1] * y + rows[:, :, 2] * z) * (bent * balance.command.surfaces.bars())
    resisted[:, :, 0] += along * x
    resisted[:, :, 1] += along * y
    resisted[:, :, 2] += along * z
    return resisted


def _body_rows(levers: Floats) -> Floats:
    """Return the motion (m, 6, 3, n) of the object's points at `levers` (m, 3, n) with its six degrees of freedom."""
    rows = np.zeros((len(levers), 6, 3, levers.shape[2]))
    x, y, z = levers[:, 0], levers[:, 1], levers[:, 2]
    for axis in range(3):
        rows[:, axis, axis] = 1.0
    rows[:, 3, 1], rows[:, 3, 2] = -z, y
    rows[:, 4, 0], rows[:, 4, 2] = z, -x
    rows[:, 5, 0], rows[:, 5, 1] = -y, x
    return rows


Bits = NDArray[np.bool_]

# Sticking and slipping skin is determined in these steps. Then sticking points stay fixed, and skin may bear this
# multiple of its slip limit: friction that follows the pressing force in every step may never come to rest.
_SEARCH = 10
_SLIP_STEPS = frozenset((*range(_SEARCH), 18, 19))
_STICKS = 2.0
# A step counts as worse if it increases the imbalance by this factor; it is shortened at most to this part.
_WORSE, _LEAST_FRACTION = 1.6, 0.1
# From this step on only half of each is taken: repetitions not at rest by then oscillate.
_HALF_FROM = 24


@dataclass(slots=True)
class Rest:
    """The rest of n hands.

    angles (20, n) in radians, pose
    presses (50, n), drags (50, 3, n)  on the spheres of skin in N: along the normals, and of friction
    residual_n, residual_nmm (n,)  unbalanced force and moment of skin and weight on the object
    settled (n,)                   False if the forces never came into balance
    steps   (n,)                   Newton steps taken
    """

    angles: Floats
    pose: Pose
    presses: Floats
    drags: Floats
    residual_n: Floats
    residual_nmm: Floats
    settled: Bits
    steps: NDArray[np.int64]

    @classmethod
    def of(cls, target: HandCommand) -> "Rest":
        """Return the state of the hands before any step."""
        n = target.angles.shape[1]
        pose = Pose(target.pose.position.copy(), target.pose.rotation.copy())
        spheres = len(target.hand.sphere_capsules)
        nowhere, none = np.zeros((spheres, n)), np.zeros(n)
        drags, steps = np.zeros((spheres, 3, n)), np.zeros(n, dtype=np.int64)
        return cls(target.angles.copy(), pose, nowhere, drags, none, none.copy(), none > 0.0, steps)

    def note(self, which: Indices, balance: Balance, at_rest: Bits, count: int) -> None:
        """Store the state of repetitions `which` after `count` steps, and whether they are at rest."""
        self.angles[:, which], self.presses[:, which] = balance.angles, balance.presses
        self.drags[..., which] = balance.drags
        self.pose.position[:, which], self.pose.rotation[..., which] = balance.pose.position, balance.pose.rotation
        self.residual_n[which], self.residual_nmm[which] = balance.residual_n, balance.residual_nmm
        self.settled[which], self.steps[which] = at_rest, count

    def part(self, first: int, last: int) -> "Rest":
        """Return the rest of repetitions first to last - 1."""
        arrays = {each.name: getattr(self, each.name)[..., first:last] for each in fields(self) if each.name != "pose"}
        return Rest(pose=self.pose.rows(slice(first, last)), **arrays)


def close(loads: Sequence[Load], skin: Skin, most_steps: int, pace: SolverSettings = USUAL) -> list[Rest]:
    """Return the rest of the hands of `loads`, all of one size, one Rest per load."""
    target = command(loads)
    rest, walk = Rest.of(target), _Walk.start(target)
    left = np.arange(target.angles.shape[1])
    for count in range(most_steps * pace.parts + 1):
        whole = count // pace.parts
        balance = Balance(target, skin, walk.angles, walk.pose, 1.0 if whole < _SEARCH else _STICKS)
        slipping, at_rest = whole in _SLIP_STEPS, balance.at_rest(pace)
        if slipping:
            target = replace(target, object_points=balance.slipped())
        rest.note(left, balance, at_rest, count)
        going = np.flatnonzero(~at_rest)
        if not going.size or whole == most_steps:
            break
        walk = walk.onward(balance, going, (0.5 if whole >= _HALF_FROM else 1.0) / pace.parts, always=slipping)
        if going.size < left.size:
            left, target = left[going], target.rows(going)
    ends = np.cumsum([len(load.grip_n) for load in loads])
    return [rest.part(int(end) - len(load.grip_n), int(end)) for load, end in zip(loads, ends, strict=True)]


@dataclass(frozen=True, slots=True)
class _Walk:
    """The current candidates of r repetitions: at `fraction` of a Newton step from the best candidate so far.

    A step that much increases the imbalance is shortened repeatedly: it ran into a contact that it did not predict.
    """

    from_angles: Floats
    from_pose: Pose
    step: Floats
    fraction: Floats
    unrest: Floats
    angles: Floats
    pose: Pose

    @classmethod
    def start(cls, target: HandCommand) -> "_Walk":
        n = target.angles.shape[1]
        far = np.full(n, np.inf)
        return cls(target.angles, target.pose, np.zeros((26, n)), np.ones(n), far, target.angles, target.pose)

    def onward(self, balance: Balance, going: Indices, share: float, *, always: bool) -> "_Walk":
        """Return the next candidates of the repetitions `going`, a `share` of a step further."""
        unrest = balance.unrest[going]
        better = (unrest < _WORSE * self.unrest[going]) | (self.fraction[going] < _LEAST_FRACTION) | always
        step = np.where(better, newton_step(balance)[:, going], self.step[:, going])
        angles = np.where(better, self.angles[:, going], self.from_angles[:, going])
        position = np.where(better, self.pose.position[:, going], self.from_pose.position[:, going])
        rotation = np.where(better, self.pose.rotation[..., going], self.from_pose.rotation[..., going])
        fraction = np.where(better, share, self.fraction[going] * 0.4)
        part, start = fraction * step, Pose(position, rotation)
        kept = np.where(better, unrest, self.unrest[going])
        return _Walk(angles, start, step, fraction, kept, angles + part[:20], start.moved(part[20:]))

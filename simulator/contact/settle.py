"""Newton's method, until every repetition is at rest."""

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
    Case,
    Command,
    Pace,
    Skin,
    command,
    contract,
    cross,
    dot,
    wrench,
)
from .model import STIFFNESS


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
    """Solve systems of d limbs that meet only in one body, by eliminating the limbs (Schur's complement).

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
_LARGEST_SINK_MM = 1.0  # what skin may sink in deeper by one step
_HOLD_STIFFNESS = np.array([HOLD_N_PER_MM] * 3 + [HOLD_NMM_PER_RAD] * 3)[:, None]


def newton_step(balance: Balance) -> Floats:
    """Return the step (26, n) of angles, position and turn; shortened, where it is long or would drive skin in deep."""
    joints, coupling, body = stiffness(balance)
    found = solve_arrow(joints, coupling, body, balance.on_joints.reshape(5, 4, -1), balance.on_object)
    longest: Floats = (np.abs(found) / _LARGEST_STEP).max(axis=0)
    found = found / np.maximum(longest, 1.0)
    return found * _unhurt(balance, found)


def _unhurt(balance: Balance, step: Floats) -> Floats:
    """Return how much of a step (n,) may be taken so that no skin sinks in much deeper than the step foresees."""
    n = step.shape[1]
    moved = balance.jacobian * step[:20].reshape(5, 1, 4, 1, n)
    nearing = step[20:23] + cross(np.broadcast_to(step[23:], balance.levers.shape), balance.levers)
    nearing[:DIGIT_SPHERES] -= add_up(moved.transpose(2, 0, 1, 3, 4)).reshape(DIGIT_SPHERES, 3, n)
    room = np.maximum(-balance.sunk, 0.0) + _LARGEST_SINK_MM
    worst: Floats = (dot(nearing, balance.normal) / room).max(axis=0)
    return 1.0 / np.maximum(worst, 1.0)


def stiffness(balance: Balance) -> tuple[Floats, Floats, Floats]:
    """Return the matrix in blocks: joints (5, 4, 4, n), joints with object (5, 4, 6, n), object (6, 6, n).

    Only spheres that touch in any of the repetitions are summed: the others would add nothing but zeros.
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
    """Return K r for rows r (m, k, 3, n), K being what the skin of m `spheres` resists with.

    K = sideways (I - n n^T) + press n n^T. Where the surface bends, pressing skin that moves sideways is pushed on:
    that lessens K across a ball, and across a bar but not along it.

    Left out, so that K stays symmetric and positive: that sticking and slipping skin resists more where it sinks in
    deeper, that slipping skin resists no more along its slip, that points of contact wander over skin and edges, and
    that levers and normals turn with what they press.
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
    """Return how points of the object at `levers` (m, 3, n) move with its six degrees of freedom: (m, 6, 3, n)."""
    rows = np.zeros((len(levers), 6, 3, levers.shape[2]))
    x, y, z = levers[:, 0], levers[:, 1], levers[:, 2]
    for axis in range(3):
        rows[:, axis, axis] = 1.0
    rows[:, 3, 1], rows[:, 3, 2] = -z, y
    rows[:, 4, 0], rows[:, 4, 2] = z, -x
    rows[:, 5, 0], rows[:, 5, 1] = -y, x
    return rows


Bits = NDArray[np.bool_]

# Where skin sticks and where it slips is found in these steps. Then points that stick are left alone, and skin may bear
# so many times what it slips at: friction that follows the pressing force in every step may never come to rest.
_SEARCH = 10
_SLIP_STEPS = frozenset((*range(_SEARCH), 18, 19))
_STICKS = 2.0
# A step counts as worse where it leads so much further from balance; it is shortened no further than to this part.
_WORSE, _LEAST_FRACTION = 1.6, 0.1
# From this step on only half of each is taken: what has not come to rest by then swings to and fro.
_HALF_FROM = 24


@dataclass(slots=True)
class Rest:
    """Where n hands came to rest.

    angles (20, n) in radians, pose
    presses (50, n), drags (50, 3, n)  on the spheres of skin in N: along the normals, and of friction
    residual_n, residual_nmm (n,)  force and moment on the object that skin and weight leave unbalanced
    settled (n,)                   False where the forces never came into balance
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
    def of(cls, told: Command) -> "Rest":
        """Return where hands are before any step."""
        n = told.angles.shape[1]
        pose = Pose(told.pose.position.copy(), told.pose.rotation.copy())
        spheres = len(told.hand.sphere_capsules)
        nowhere, none = np.zeros((spheres, n)), np.zeros(n)
        drags, steps = np.zeros((spheres, 3, n)), np.zeros(n, dtype=np.int64)
        return cls(told.angles.copy(), pose, nowhere, drags, none, none.copy(), none > 0.0, steps)

    def note(self, which: Indices, balance: Balance, at_rest: Bits, count: int) -> None:
        """Enter where repetitions `which` are after `count` steps, and whether they are at rest."""
        self.angles[:, which], self.presses[:, which] = balance.angles, balance.presses
        self.drags[..., which] = balance.drags
        self.pose.position[:, which], self.pose.rotation[..., which] = balance.pose.position, balance.pose.rotation
        self.residual_n[which], self.residual_nmm[which] = balance.residual_n, balance.residual_nmm
        self.settled[which], self.steps[which] = at_rest, count

    def part(self, first: int, last: int) -> "Rest":
        """Return the rest of repetitions first to last - 1."""
        arrays = {each.name: getattr(self, each.name)[..., first:last] for each in fields(self) if each.name != "pose"}
        return Rest(pose=self.pose.rows(slice(first, last)), **arrays)


def close(cases: Sequence[Case], skin: Skin, most_steps: int, pace: Pace = USUAL) -> list[Rest]:
    """Return how the hands of `cases`, all of one size, come to rest, a Rest a case."""
    told = command(cases)
    rest, walk = Rest.of(told), _Walk.start(told)
    left = np.arange(told.angles.shape[1])
    for count in range(most_steps * pace.parts + 1):
        whole = count // pace.parts
        balance = Balance(told, skin, walk.angles, walk.pose, 1.0 if whole < _SEARCH else _STICKS)
        slipping, at_rest = whole in _SLIP_STEPS, balance.at_rest(pace)
        if slipping:
            told = replace(told, object_points=balance.slipped())
        rest.note(left, balance, at_rest, count)
        going = np.flatnonzero(~at_rest)
        if not going.size or whole == most_steps:
            break
        walk = walk.onward(balance, going, (0.5 if whole >= _HALF_FROM else 1.0) / pace.parts, always=slipping)
        if going.size < left.size:
            left, told = left[going], told.rows(going)
    ends = np.cumsum([len(case.grip_n) for case in cases])
    return [rest.part(int(end) - len(case.grip_n), int(end)) for case, end in zip(cases, ends, strict=True)]


@dataclass(frozen=True, slots=True)
class _Walk:
    """Where r repetitions are looked for: at `fraction` of a Newton step from the best place so far.

    A step that leads much further from balance is shortened, again and again: it ran into a contact that it did not
    foresee.
    """

    from_angles: Floats
    from_pose: Pose
    step: Floats
    fraction: Floats
    unrest: Floats
    angles: Floats
    pose: Pose

    @classmethod
    def start(cls, told: Command) -> "_Walk":
        n = told.angles.shape[1]
        far = np.full(n, np.inf)
        return cls(told.angles, told.pose, np.zeros((26, n)), np.ones(n), far, told.angles, told.pose)

    def onward(self, balance: Balance, going: Indices, share: float, *, always: bool) -> "_Walk":
        """Return the next places of the repetitions `going`, a `share` of a step on from where these are."""
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

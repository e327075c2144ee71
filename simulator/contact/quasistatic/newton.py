"""How the forces change with every unknown, and the step that would balance them."""

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import add_up

from ..grip import STIFFNESS
from .balance import DIGIT_SPHERES, HOLD_N_PER_MM, HOLD_NMM_PER_RAD, LIMIT_NMM_PER_RAD, Balance
from .linear import solve_arrow
from .vectors import contract, cross, dot, wrench

Floats = NDArray[np.float64]
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

"""Step by step until every repetition is at rest."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...body.pose import Pose
from .balance import Balance
from .case import Case, Command, Skin, command
from .newton import newton_step
from .pace import USUAL, Pace

Floats = NDArray[np.float64]
Bits = NDArray[np.bool_]
Indices = NDArray[np.intp]

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
        own = slice(first, last)
        return Rest(
            self.angles[:, own],
            Pose(self.pose.position[:, own], self.pose.rotation[..., own]),
            self.presses[:, own],
            self.drags[..., own],
            self.residual_n[own],
            self.residual_nmm[own],
            self.settled[own],
            self.steps[own],
        )


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

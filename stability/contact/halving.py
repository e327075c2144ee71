"""Steps halved: Newton's, what counts as rest, MuJoCo's time step, and the levels of a growing grip.

A newton more or less matters where it turns a switch. The shipped scenes spread the thresholds of switches about 1 N by
a standard deviation of 0.15 N (switch.threshold), because nobody knows those of a glove's better: so halved steps may
change no force on a segment by more than that where they only come nearer to the same rest, and where friction's
history differs, turn no more switches than thresholds drawn anew would.
"""

from collections.abc import Iterator, Sequence
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats
from thenar.simulator.body.layout import murakami160
from thenar.simulator.contact.balance import USUAL, Pace
from thenar.simulator.contact.model import Contact, Load
from thenar.simulator.effects import contact_mujoco, switch_threshold
from thenar.simulator.effects.contact_quasistatic import Parameters, Quasistatic
from thenar.simulator.pipeline.batch import SLID_OUT_MM
from thenar.simulator.pipeline.ramp import crossings
from thenar.simulator.planning.postures import Postures
from thenar.simulator.running.simulation import conditions_of
from thenar.simulator.scenes.decode import load_scene

from ..finding import Finding, Worst
from .rest import models

Bits = NDArray[np.bool_]

THRESHOLD_N = 1.0
SPREAD_N = switch_threshold.Parameters().sd_n
_DRAWS = 20
_LEVELS = 5
_THRESHOLDS_N = np.full(len(murakami160()), THRESHOLD_N)


def findings(full: bool) -> Iterator[Finding]:
    """Yield by how much halved steps change forces, and how many switches they turn."""
    loads = list(shipped(4 if full else 1))
    rest = Quasistatic(Parameters()).solve(loads)
    nearer = Quasistatic(Parameters(), Pace(USUAL.rest_n / 2, USUAL.rest_nmm / 2)).solve(loads)
    yield _nearer(loads, rest, nearer)
    halved = Quasistatic(Parameters(), Pace(parts=2)).solve(loads)
    yield _turned("quasistatic: Newton steps halved", loads, rest, halved)
    if full:
        again = Quasistatic(Parameters(), Pace(parts=4)).solve(loads)
        yield _turned("quasistatic: Newton steps halved again", loads, halved, again)
    if find_spec("mujoco") is not None:
        yield _finer_time(loads)
    yield _finer_grip(loads[:: 1 if full else 14])


def shipped(repetitions: int) -> Iterator[Load]:
    """Yield the grasps of the shipped scene's first subject, varied as its effects vary them."""
    scene, rng = load_scene("kamakura"), np.random.default_rng(14)
    for condition in conditions_of(scene, scene.subjects[0], Postures.of(scene)):
        told, n = condition.held, repetitions
        pose = told.pose + rng.normal(size=(n, 6)) * ([1.5] * 3 + [np.radians(2.5)] * 3)
        posture_deg = told.posture_deg + 1.5 * rng.normal(size=(n, 20))
        yield Load(condition, posture_deg, pose, told.grip_n * np.exp(0.25 * rng.normal(size=n)))


def kept(loads: Sequence[Load], *solved: Sequence[Contact]) -> Bits:
    """Return which repetitions (n,) settled, without dropping their object, in all of `solved`."""
    good = np.ones(sum(len(load.grip_n) for load in loads), dtype=bool)
    for contacts in solved:
        shifts = [one.pose[:, :3] - load.pose[:, :3] for one, load in zip(contacts, loads, strict=True)]
        slid = np.concatenate([np.sqrt(np.add.reduce(shift * shift, axis=1)) for shift in shifts])
        good &= np.concatenate([one.settled for one in contacts]) & (slid <= SLID_OUT_MM)
    return good


def _nearer(loads: Sequence[Load], rest: Sequence[Contact], nearer: Sequence[Contact]) -> Finding:
    """Return the most that halving what may be left at rest changes the force on a segment; it may be SPREAD_N."""
    worst = Worst("quasistatic: forces, rest held twice as strictly", "the usual rest", SPREAD_N, "N")
    good = kept(loads, rest, nearer)
    change = np.abs(_capsules(rest) - _capsules(nearer)).max(axis=1)
    for name, here in zip(np.array(_names(loads))[good].tolist(), change[good].tolist(), strict=True):
        worst.see(here, name)
    return worst.finding()


def _turned(check: str, loads: Sequence[Load], one: Sequence[Contact], other: Sequence[Contact]) -> Finding:
    """Count the switches that differ between two solutions, against what thresholds drawn anew make of the first."""
    good = kept(loads, one, other)
    first, second = (np.concatenate([contact.forces_n for contact in each])[good] for each in (one, other))
    closed = first > THRESHOLD_N
    rng = np.random.default_rng(15)
    drawn = rng.normal(THRESHOLD_N, SPREAD_N, (_DRAWS, first.shape[1]))
    by_thresholds = np.mean([np.count_nonzero((first > thresholds) != closed) for thresholds in drawn])
    turned = np.count_nonzero((second > THRESHOLD_N) != closed)
    change = np.abs(first - second).max(axis=1)
    most = f"{np.array(_names(loads))[good][change.argmax()]}: {change.max():.2g} N, median {np.median(change):.2g} N"
    error, bound, tried = float(turned), float(by_thresholds), int(np.count_nonzero(closed))
    return Finding(check, "the spread of thresholds", error, bound, "switches", tried, most)


def _finer_time(loads: Sequence[Load]) -> Finding:
    usual = contact_mujoco.Parameters()
    finer = contact_mujoco.Parameters(dt_ms=usual.dt_ms / 2, steps=usual.steps * 2)
    make = models()["mujoco"]
    return _turned("mujoco: time steps halved", loads, make(usual).solve(loads), make(finer).solve(loads))


def _finer_grip(loads: Sequence[Load]) -> Finding:
    """Count what differs where a grip grows in twice as many levels: the forces at a level that both have not at all,
    and the time at which a switch first closes by no more than a coarse level: from below to above its threshold.
    """
    worst = Worst("ramp: twice as many levels of the grip", "the usual levels", 0.0, "switches")
    model = Quasistatic(Parameters())
    for load in loads:
        coarse, fine = (_grown(model, load, levels) for levels in (_LEVELS, 2 * _LEVELS))
        worst.see(float(np.count_nonzero(fine[::2] != coarse)), load.condition.thing.name, coarse[0].size)
        up, sooner = (crossings(forces, _THRESHOLDS_N, 1e6 / (len(forces) - 1))[0] for forces in (coarse, fine))
        both = np.logical_or.reduce(coarse > _THRESHOLDS_N)
        # A switch that the finer grip closes sooner, in passing, is no later than the coarse one says.
        worst.see(float(np.count_nonzero((sooner > up + 1e6 / _LEVELS)[both])), load.condition.thing.name, 0)
    return worst.finding()


def _grown(model: Quasistatic, load: Load, levels: int) -> Floats:
    """Return the forces (levels + 1, n, s) at evenly spaced levels of the grip, none at the first."""
    grips = [load.grip_n * (level / levels) for level in range(1, levels + 1)]
    solved = model.solve([Load(load.condition, load.posture_deg, load.pose, grip_n) for grip_n in grips])
    return np.array([np.zeros_like(solved[0].forces_n), *(contact.forces_n for contact in solved)])


def _capsules(contacts: Sequence[Contact]) -> Floats:
    return np.concatenate([contact.capsules_n for contact in contacts])


def _names(loads: Sequence[Load]) -> list[str]:
    return [load.condition.thing.name for load in loads for _ in load.grip_n]

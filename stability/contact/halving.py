"""Halved steps: Newton's, and the limits of rest.

A force matters only if it changes a switch. The shipped scenes spread the thresholds of switches around 1 N with a
standard deviation of 0.15 N (switch.threshold), because those of a real glove are no better known. So if halved steps
only get closer to the same rest, they may change no force on a segment by more than this; if the history of friction
differs, they may change no more switches than newly drawn thresholds would.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.elementary import Floats
from thenar.simulator.contact.balance import USUAL, SolverSettings
from thenar.simulator.contact.model import Contact, Load
from thenar.simulator.effects import switch_threshold
from thenar.simulator.effects.contact_quasistatic import Quasistatic
from thenar.simulator.pipeline.batch import SLID_OUT_MM
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import conditions_of
from thenar.simulator.planning.postures import Postures

from ..finding import Finding, Worst

Bits = NDArray[np.bool_]

THRESHOLD_N = 1.0
SPREAD_N = switch_threshold.SD_N
_DRAWS = 20


def findings(full: bool) -> Iterator[Finding]:
    """Yield the changes of forces and of switches by halved steps."""
    loads = list(shipped(4 if full else 1))
    rest = Quasistatic().solve(loads)
    nearer = Quasistatic(pace=SolverSettings(USUAL.rest_n / 2, USUAL.rest_nmm / 2)).solve(loads)
    yield _nearer(loads, rest, nearer)
    halved = Quasistatic(pace=SolverSettings(parts=2)).solve(loads)
    yield _turned("quasistatic: Newton steps halved", loads, rest, halved)
    if full:
        again = Quasistatic(pace=SolverSettings(parts=4)).solve(loads)
        yield _turned("quasistatic: Newton steps halved again", loads, halved, again)


def shipped(repetitions: int) -> Iterator[Load]:
    """Yield the grasps of the shipped scene's first subject, varied by its effects."""
    scene, rng = load_scene("kamakura"), np.random.default_rng(14)
    for condition in conditions_of(scene, scene.subjects[0], Postures.shipped(scene.taxonomy)):
        target, n = condition.held, repetitions
        pose = target.pose + rng.normal(size=(n, 6)) * ([1.5] * 3 + [np.radians(2.5)] * 3)
        posture_deg = target.posture_deg + 1.5 * rng.normal(size=(n, 20))
        yield Load(condition, posture_deg, pose, target.grip_n * np.exp(0.25 * rng.normal(size=n)))


def kept(loads: Sequence[Load], *solved: Sequence[Contact]) -> Bits:
    """Return the mask (n,) of repetitions that settled, without dropping their object, in all of `solved`."""
    good = np.ones(sum(len(load.grip_n) for load in loads), dtype=bool)
    for contacts in solved:
        shifts = [one.pose[:, :3] - load.pose[:, :3] for one, load in zip(contacts, loads, strict=True)]
        slid = np.concatenate([np.sqrt(np.add.reduce(shift * shift, axis=1)) for shift in shifts])
        good &= np.concatenate([one.settled for one in contacts]) & (slid <= SLID_OUT_MM)
    return good


def _nearer(loads: Sequence[Load], rest: Sequence[Contact], nearer: Sequence[Contact]) -> Finding:
    """Return the largest change of the force on a segment by halved limits of rest; the bound is SPREAD_N."""
    worst = Worst("quasistatic: forces, limits of rest halved", "the usual rest", SPREAD_N, "N")
    good = kept(loads, rest, nearer)
    change = np.abs(_capsules(rest) - _capsules(nearer)).max(axis=1)
    for name, here in zip(np.array(_names(loads))[good].tolist(), change[good].tolist(), strict=True):
        worst.see(here, name)
    return worst.finding()


def _turned(check: str, loads: Sequence[Load], one: Sequence[Contact], other: Sequence[Contact]) -> Finding:
    """Count the switches that differ between two solutions; newly drawn thresholds for the first give the bound."""
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


def _capsules(contacts: Sequence[Contact]) -> Floats:
    return np.concatenate([contact.capsules_n for contact in contacts])


def _names(loads: Sequence[Load]) -> list[str]:
    return [load.condition.thing.name for load in loads for _ in load.grip_n]

"""Faults of single switches in a live recogniser: their cost with and without quarantine, and false alarms.

    python benchmarks/quarantine.py BUILD SET.grasps

BUILD has only switches; each row of the set, normally of other subjects, is a grasp. Subjects take turns; their grasps
come in random order, with an open hand for a moment in between. Every switch is stuck, closed and open, from one of the
grasps on. Points are lost compared with the same grasps without the fault.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import select_inputs
from thenar.runtime.build import Build
from thenar.runtime.frames import SwitchFrame
from thenar.runtime.live.quarantine import SETTLED_US
from thenar.runtime.live.recogniser import LiveRecognizer
from thenar.runtime.policy import Policy

GRASPS = 30
OPEN_US = 50_000
_HELD_US = 3 * SETTLED_US


@dataclass(frozen=True, slots=True)
class Cost:
    """Percentage points lost by a fault of one switch: without quarantine, with it, and if the switch is known to be
    lost; in the first GRASPS grasps, and in the same number after them. Also the number of grasps until it was found,
    None if it was not, and the number of other quarantines.
    """

    name: str
    without: tuple[float, float]
    quarantined: tuple[float, float]
    lost: tuple[float, float]
    delays: tuple[int | None, ...]
    others: int


def held(
    build: Build,
    grasps: Sequence[int],
    quarantine: bool,
    *,
    at: int = 0,
    stuck: int = 0,
    dead: int = 0,
    lost: int = 0,
) -> Iterator[tuple[str, frozenset[str]]]:
    """Yield the candidate for each grasp, and the quarantined inputs after it; from grasp `at` on, switches are stuck
    closed, or open, or lost. The hand is open for OPEN_US between them.
    """
    policy = Policy(lead=0, dwell_us=0, hold_us=0, lag_us=None, quarantine=quarantine)
    live, now_us = LiveRecognizer(build, switch_period_us=_HELD_US, policy=policy), 0
    for number, closed in enumerate(grasps):
        late = number >= at
        # The evidence of a grasp counts in the next frame, and so in this grasp.
        for pause_us, shown in ((OPEN_US, 0), (1, 0), *[(SETTLED_US, closed)] * (_HELD_US // SETTLED_US)):
            frame = SwitchFrame(now_us, (shown | stuck * late) & ~(dead * late), lost * late)
            grasp = live.step(now_us, 0, frame, None).grasp
            now_us += pause_us
        yield grasp.candidate, frozenset(wrong.name for wrong in live.quarantine.found)


def masks_of(build: Build, grasp_set: GraspSet) -> list[int]:
    """Return the kept switches that are closed in each row."""
    bits = np.packbits(select_inputs(grasp_set, build.manifest)[0], axis=1, bitorder="little")
    return [int.from_bytes(row.tobytes(), "little") for row in bits]


def orders(grasp_set: GraspSet, draws: int, seed: int = 0) -> Iterator[np.ndarray]:
    """Yield rows of one subject after the other, in random order."""
    names = np.unique(grasp_set.subjects)
    for draw in range(draws):
        own = np.flatnonzero(grasp_set.subjects == names[draw % len(names)])
        yield np.random.default_rng((seed, draw)).permutation(own)


def false_alarms(build: Build, grasp_set: GraspSet, draws: int) -> tuple[int, int]:
    """Return how often an input was quarantined without a fault, and in how many grasps."""
    masks, alarms, grasps = masks_of(build, grasp_set), 0, 0
    for order in orders(grasp_set, draws, seed=1):
        before: frozenset[str] = frozenset()
        for _, found in held(build, [masks[row] for row in order], True):
            alarms, before = alarms + len(found - before), found
        grasps += len(order)
    return alarms, grasps


def cost(build: Build, grasp_set: GraspSet, closed: bool, draws: int, switch: int) -> Cost:
    """Return the cost of a switch that is stuck closed, or open."""
    masks, name = masks_of(build, grasp_set), build.manifest.switches[switch].name
    points = np.zeros((3, 2))
    delays, others, bit = list[int | None](), 0, 1 << switch
    for draw, order in enumerate(orders(grasp_set, draws, seed=2 + switch)):
        at = GRASPS + draw % GRASPS
        rows = order[: at + 2 * GRASPS]
        grasps, right = [masks[row] for row in rows], []
        fault = {"stuck" if closed else "dead": bit}
        for quarantine, faults in ((False, {}), (False, fault), (False, {"lost": bit}), (True, fault)):
            seen = list(held(build, grasps, quarantine, at=at, **faults))
            same = np.array([grasp for grasp, _ in seen]) == grasp_set.grasps[rows]
            right.append(same[at:].reshape(2, GRASPS).mean(axis=1))
        points += 100 * (right[0] - np.array(right[1:])) / draws
        after = [found for _, found in seen[at:]]
        delays.append(next((number for number, found in enumerate(after) if name in found), None))
        others += len(frozenset().union(*after) - {name})
    without, as_lost, quarantined = ((float(first), float(second)) for first, second in points)
    return Cost(name, without, quarantined, as_lost, tuple(delays), others)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build")
    parser.add_argument("grasps")
    parser.add_argument("--draws", type=int, default=6, help="orders of the grasps, each of a subject")
    asked = parser.parse_args()
    build, grasp_set = Build.load(asked.build), GraspSet.load(asked.grasps)
    alarms, grasps = false_alarms(build, grasp_set, asked.draws)
    print(f"without a fault: {alarms} false alarms in {grasps} grasps")
    for closed, what in ((True, "closed"), (False, "open")):
        switches = range(build.tables.n_switches)
        every = [cost(build, grasp_set, closed, asked.draws, switch) for switch in switches]
        found = sorted(every, key=lambda each: -each.without[1])
        print(f"stuck {what}: points lost, grasps 1 to {GRASPS} and {GRASPS + 1} to {2 * GRASPS}; found after")
        for each in found:
            delays = [GRASPS * 2 if delay is None else delay + 1 for delay in each.delays]
            missed = sum(delay is None for delay in each.delays)
            print(
                f"{each.name:20}{each.without[0]:7.1f}{each.without[1]:7.1f}  quarantined{each.quarantined[0]:7.1f}"
                f"{each.quarantined[1]:7.1f}  as lost{each.lost[0]:7.1f}{each.lost[1]:7.1f}"
                f"  {median(delays):5.1f} grasps, {missed} missed, {each.others} others"
            )
        for name in ("without", "quarantined", "lost"):
            both = np.array([getattr(each, name) for each in found])
            print(f"{name}: mean {both.mean(axis=0).round(1)}, worst {both.max(axis=0).round(1)}")


if __name__ == "__main__":
    main()

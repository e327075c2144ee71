"""Replays: a glove's data while a hand goes from grasp to grasp, recorded or composed of single trials.

Without recordings of transitions, a replay is composed of single trials. The switches and joints of each grasp come
from the recordings; everything in between is modelled. When the hand lets go, the switches of the grasp open one
by one, at times spread evenly over RELEASE_US. During the transition the joints follow a minimum-jerk path (Flash and
Hogan 1985, J. Neurosci. 5: 1688) that opens the hand, most at two thirds of the path (Jeannerod 1984, J. Motor Behav.
16: 235), in TRAVEL_US, sampled every RECORD_US as by a CyberGlove. When it grips, the switches of the next grasp close
one by one over GRIP_US; with the last one the grasp is complete. The times are those of the scene `continuous`. In the
open hand, each joint has the value that only a twentieth of the trials exceeds. A taxel is pressed and released at
once, like a switch; between grasps it has its value in the twentieth of the trials that press it least.

The model leaves out movement within a hold: a trial is one frame, so an error in that frame lasts for the whole hold,
and more frames do not correct it. It also leaves out contact bounce, and switches that are touched in passing.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..movements.segments import Span
from ..movements.streams import (
    LEAST_FRAMES,
    Bits,
    Codes,
    Rows,
    Stream,
    Times,
    frames_are_dense,
    holds_of,
    movements_of,
)
from ..placement.elements import Elements, above
from ..recordings.graspset import GraspSet, Joint
from ..samples import Columns
from .points import FrontierError

RELEASE_US, TRAVEL_US, GRIP_US = 200_000, 300_000, 200_000
TRANSITION_US = RELEASE_US + TRAVEL_US + GRIP_US
HOLD_US = (600_000, 1_000_000)
RECORD_US = 10_000
_OPENING = 0.5
_OPEN = 0.05  # share of the trials in which a joint is opened further than in the open hand
_BUMP = 3.0**9 / 2.0**6  # scales the maximum of t^6 (1 - t)^3, at t = 2/3, to one
_NEVER = np.int64(1) << 60

GRASPS = 300
PERIOD_US = 10_000
# The golden section: the fractional parts of its multiples are spread evenly, for any number of them.
_GOLDEN = 0.618034


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """What latencies are measured on: n rows of a glove's readings, the stream that shows them, the grasps in it.

    bits    (n, s) bool     every switch of the set
    codes   (n, j) uint16   the joints
    taxels  (n, t) uint16   the taxels
    grasps  every grasp, from the state at which it is complete to the one at which it ends, and its class
    what    a sentence: the kind of stream, and the reason for it
    """

    bits: Bits
    codes: Codes
    taxels: Codes
    stream: Stream
    grasps: tuple[Span, ...]
    what: str

    def reading(self, elements: Elements, joints: Columns) -> "Replay":
        """Return the same replay with these elements as switches, and these joints."""
        bits, codes = above(self.bits, self.taxels, elements), self.codes[:, list(joints)]
        return replace(self, bits=bits, codes=codes, taxels=self.taxels[:, :0])


def replay_of(
    grasp_set: GraspSet,
    labels: Rows,
    rows: Rows | None = None,
    *,
    seed: int,
    grasps: int = GRASPS,
) -> Replay:
    """Return a replay of rows of a set: of its movements if its frames are dense, else composed of its trials.

    labels  (n,) the classes of all rows, as the tables number them; -1 for nothing held
    rows    those that may be used, the tables' test rows; None: all. Of movements, only those with all of their rows
            among them are used

    Raises FrontierError if no replay can be made of the rows.
    """
    if frames_are_dense(grasp_set):
        return recorded(grasp_set, labels, rows, grasps=grasps)
    chosen = np.arange(len(grasp_set)) if rows is None else rows
    chosen = chosen[labels[chosen] >= 0]
    return composed(grasp_set.rows(chosen), labels[chosen], seed=seed, grasps=grasps)


def recorded(grasp_set: GraspSet, labels: Rows, rows: Rows | None = None, *, grasps: int = GRASPS) -> Replay:
    """Return the movements of a set with a grasp and at least LEAST_FRAMES rows, one after the other.

    Rows of a set without times are taken to be PERIOD_US apart. Two movements are separated by a period plus a
    varying fraction, so that no frame time stays in step with the rows. If there are more than `grasps` movements, that
    many of them are taken, evenly spread.

    Raises FrontierError if no movement lies in `rows` as a whole.
    """
    movements = movements_of(grasp_set)
    movements = movements.pick((movements.sizes >= LEAST_FRAMES) & (movements.counts(~grasp_set.is_none) > 0))
    if rows is not None:
        usable = np.isin(np.arange(len(grasp_set)), rows)
        movements = movements.pick(movements.counts(usable) == movements.sizes)
    if not len(movements):
        raise FrontierError("no whole movement is among the held-out rows for latency: cut the folds between movements")
    spread = np.unique(np.linspace(0, len(movements) - 1, min(grasps, len(movements))).astype(np.intp))
    movements = movements.pick(spread)
    begins = np.cumsum(movements.sizes) - movements.sizes
    complete, released = (begins + frame for frame in holds_of(grasp_set, movements))
    number = np.repeat(np.arange(len(begins)), movements.sizes)
    shown = movements.rows[np.arange(len(number)) - begins[number] + movements.first[number]]
    times_us = grasp_set.times_us[shown] if grasp_set.times_us.size else np.arange(len(shown)) * PERIOD_US
    steps_us = np.maximum(np.diff(times_us, prepend=times_us[:1]), 0)
    steps_us[begins[1:]] = PERIOD_US + round(_GOLDEN * PERIOD_US)
    at_us = np.cumsum(steps_us, dtype=np.int64)
    apart = "when they were recorded" if grasp_set.times_us.size else f"taken to be {PERIOD_US / 1000:g} ms apart"
    return Replay(
        grasp_set.switches[shown],
        grasp_set.codes[shown],
        grasp_set.taxels[shown],
        Stream(np.arange(len(shown)), at_us, int(at_us[-1]) + PERIOD_US),
        tuple(map(Span, complete.tolist(), released.tolist(), labels[shown[complete]].tolist())),
        f"Latencies are over {len(movements)} recorded movements, frames {apart}: "
        "neighbouring rows of a trial resemble each other, as the frames of a whole movement do.",
    )


def composed(trials: GraspSet, labels: Rows, *, seed: int, grasps: int = GRASPS) -> Replay:
    """Return a replay composed of single trials, the rows of a set, of classes `labels` (n,): see this module.

    Raises FrontierError for fewer than two grasp types, which have no transitions.
    """
    if len(np.unique(labels)) < 2:
        raise FrontierError("a latency is measured between grasps of different types, and the rows are of one")
    n_switches, rest = len(trials.switch_names), _open_hand(trials.taxels, trials.taxel_columns).astype(np.uint16)
    rest = np.append(np.zeros(n_switches, np.uint16), rest)
    contacts = np.hstack([trials.switches, trials.taxels], dtype=np.uint16)
    random = np.random.default_rng(seed)
    rows = _order(labels, grasps, random)
    legs = list(_legs(contacts, rest, trials.codes, _open_hand(trials.codes, trials.joints), rows, random))
    readings, poses, at_us = map(np.concatenate, zip(*legs, strict=True))
    ends = np.cumsum([len(leg_us) for _, _, leg_us in legs])
    # A leg ends with the state in which its grasp is complete.
    return Replay(
        readings[:, :n_switches] > 0,
        poses,
        readings[:, n_switches:],
        Stream(np.arange(len(at_us)), at_us, int(at_us[-1]) + HOLD_US[0]),
        tuple(map(Span, (ends - 1).tolist(), ends.tolist(), labels[rows].tolist())),
        f"Latencies are over a stream composed of {grasps} single trials, each held for {HOLD_US[0] / 1e6:g} to "
        f"{HOLD_US[1] / 1e6:g} s, up to {TRANSITION_US / 1e6:g} s from one to the next: the recordings hold no whole "
        "movements.",
    )


def _order(labels: Rows, grasps: int, random: np.random.Generator) -> list[int]:
    """Return the sequence of trials; every trial occurs once before any is repeated."""
    chosen: list[int] = []
    waiting: list[int] = []
    while len(chosen) < grasps:
        place = next((n for n, row in enumerate(waiting) if not chosen or labels[row] != labels[chosen[-1]]), None)
        if place is None:
            waiting += random.permutation(len(labels)).tolist()
        else:
            chosen.append(waiting.pop(place))
    return chosen


def _open_hand(codes: Codes, columns: Sequence[Joint]) -> NDArray[np.float64]:
    """Return the codes of joints or taxels (n, c) while nothing is held: low values, which may have high codes."""
    rising = np.sort(codes, axis=0)
    rank = int(_OPEN * (len(codes) - 1))
    falls = np.array([column.step < 0 for column in columns], np.bool_)
    opened: NDArray[np.float64] = np.where(falls, rising[len(codes) - 1 - rank], rising[rank]).astype(np.float64)
    return opened


def _legs(
    contacts: Codes,
    rest: Codes,
    codes: Codes,
    opened: NDArray[np.float64],
    rows: list[int],
    random: np.random.Generator,
) -> Iterator[tuple[Codes, Codes, Times]]:
    """Yield the transition from each grasp to the next: contacts, codes and times of its states, the last its hold."""
    contact, pose, leaves_us = rest, opened, 0
    # Of each record on the way: the share of the path that is behind the hand, and how far it opens.
    time = np.arange(TRAVEL_US // RECORD_US + 1)[:, np.newaxis] / (TRAVEL_US // RECORD_US)
    cubed, left = time * time * time, 1.0 - time
    behind = cubed * (10.0 - time * (15.0 - 6.0 * time))
    opening = _OPENING * _BUMP * cubed * cubed * left * left * left
    for row in rows:
        straight, travels_us = pose + (codes[row] - pose) * behind, leaves_us + RELEASE_US
        path = np.rint(straight + (opened - straight) * opening).astype(np.uint16)
        opens_us = np.where(contact != rest, leaves_us + random.integers(0, RELEASE_US, len(rest)), -_NEVER)
        grips_us = travels_us + TRAVEL_US + random.integers(0, GRIP_US, len(rest))
        closes_us = np.where(contacts[row] != rest, grips_us, _NEVER)
        records_us = travels_us + RECORD_US * np.arange(len(path)) if len(pose) else np.array([travels_us + TRAVEL_US])
        contacts_us = opens_us[opens_us > -_NEVER], closes_us[closes_us < _NEVER]
        at_us = np.unique(np.concatenate([[leaves_us], records_us, *contacts_us]).astype(np.int64))
        now = at_us[:, np.newaxis]
        shown = np.where(now < opens_us, contact, np.where(now >= closes_us, contacts[row], rest))
        yield shown, path[np.clip((at_us - travels_us) // RECORD_US, 0, len(path) - 1)], at_us
        contact, pose = contacts[row], codes[row].astype(np.float64)
        leaves_us = int(at_us[-1]) + int(random.integers(*HOLD_US))

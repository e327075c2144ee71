"""Streams: a glove's data while a hand goes from grasp to grasp, recorded or composed of single trials.

Without recordings of transitions, a stream is composed of single trials. The switches and joints of each held grasp
come from the recordings; everything in between is modelled. When the hand lets go, the switches of the grasp open one
by one, at times spread evenly over RELEASE_US. During the transition the joints follow a minimum-jerk path (Flash and
Hogan 1985, J. Neurosci. 5: 1688) that opens the hand, most at two thirds of the path (Jeannerod 1984, J. Motor Behav.
16: 235), in TRAVEL_US, sampled every RECORD_US as by a CyberGlove. When it grips, the switches of the next grasp close
one by one over GRIP_US; with the last one the grasp is complete. The times are those of the scene `continuous`. In the
open hand, each joint has the value that only a twentieth of the trials exceeds. A taxel is pressed and released at
once, like a switch; between grasps it has its value in the twentieth of the trials that press it least.

The model leaves out movement within a hold: a trial is one frame, so an error in that frame lasts for the whole hold,
and more frames do not correct it. It also leaves out contact bounce, and switches that are touched in passing.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..placement.elements import Elements, above
from ..recordings.graspset import GraspSet
from ..samples import Columns
from .movements import Movements, holds_movements, movements_of
from .points import FrontierError

Rows = NDArray[np.intp]
Bits = NDArray[np.bool_]
Codes = NDArray[np.uint16]
Times = NDArray[np.int64]

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
class Stream:
    """T states of a glove; each lasts until the next; the last is the end, of duration 0.

    bits      (T, s) bool     every switch of the set
    codes     (T, j) uint16   the joints
    at_us     (T,) int64      when each begins, never falling
    types     (T,) intp       the class of the grasp; -1 while the hand moves
    arrivals  (g,) intp       the states at which a grasp is complete, if its type differs from the grasp before: the
                              same type may still be decided on from before, which measures nothing
    ends      (g,) intp       the states at which these grasps end
    what      a sentence: the kind of stream, and the reason for it
    taxels    (T, t) uint16   the taxels
    """

    bits: NDArray[np.bool_]
    codes: NDArray[np.uint16]
    at_us: NDArray[np.int64]
    types: Rows
    arrivals: Rows
    ends: Rows
    what: str = ""
    taxels: Codes = field(default_factory=lambda: np.empty((0, 0), np.uint16))

    def __len__(self) -> int:
        return len(self.at_us)

    def with_elements(self, elements: Elements) -> "Stream":
        """Return the same stream with these elements as switches, if it has taxels."""
        if not self.taxels.shape[1]:
            return self
        return replace(self, bits=above(self.bits, self.taxels, elements), taxels=self.taxels[:, :0])

    def with_joints(self, joints: Columns) -> "Stream":
        """Return the same stream with only the joints `joints`; without any if it has none."""
        return replace(self, codes=self.codes[:, list(joints)]) if 0 < len(joints) < self.codes.shape[1] else self


def stream_of(
    grasp_set: GraspSet,
    labels: Rows,
    rows: Rows | None = None,
    *,
    seed: int,
    grasps: int = GRASPS,
    period_us: int = PERIOD_US,
) -> Stream:
    """Return a stream of rows of a set: of its movements if it holds whole ones, else composed of its trials.

    labels  (n,) the classes of all rows, as the tables number them; -1 for nothing held
    rows    those that may be used, the tables' test rows; None: all. Of a set of whole movements, only movements with
            all of their rows among them are used

    `what` of the stream describes it in a sentence. Raises FrontierError if no stream can be made of the rows.
    """
    if holds_movements(grasp_set):
        return recorded_stream(grasp_set, labels, rows, grasps=grasps, period_us=period_us)
    chosen = np.arange(len(grasp_set)) if rows is None else rows
    chosen = chosen[labels[chosen] >= 0]
    return composed_stream(
        grasp_set.switches[chosen],
        grasp_set.codes[chosen],
        labels[chosen],
        seed=seed,
        grasps=grasps,
        opens_up=np.array([joint.step < 0 for joint in grasp_set.joints], np.bool_),
        taxels=grasp_set.taxels[chosen],
        eases_up=np.array([taxel.step < 0 for taxel in grasp_set.taxel_columns], np.bool_),
    )


def recorded_stream(
    grasp_set: GraspSet,
    labels: Rows,
    rows: Rows | None = None,
    *,
    grasps: int = GRASPS,
    period_us: int = PERIOD_US,
) -> Stream:
    """Return the movements of a set whose rows are the frames of whole movements, one after the other.

    Rows of a set without times are taken to be `period_us` apart. Two movements are separated by a period plus a
    varying fraction, so that no frame time stays in step with the rows. If there are more than `grasps` movements, that
    many of them are taken, evenly spread.

    Raises FrontierError if no movement lies in `rows` as a whole.
    """
    found = movements_of(grasp_set)
    if rows is not None:
        found = found.pick(_whole(found, rows, len(grasp_set)))
    if not len(found):
        raise FrontierError("no whole movement is among the held-out rows for latency: cut the folds between movements")
    found = found.pick(np.unique(np.linspace(0, len(found) - 1, min(grasps, len(found))).astype(np.intp)))
    apart = "when they were recorded" if grasp_set.times_us.size else f"taken to be {period_us / 1000:g} ms apart"
    what = (
        f"Latencies are over {len(found)} recorded movements, frames {apart}: "
        "neighbouring rows of a trial resemble each other, as the frames of a whole movement do."
    )
    return _laid_out(grasp_set, labels, found, period_us, what)


def composed_stream(
    switches: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    labels: Rows,
    *,
    seed: int,
    grasps: int = GRASPS,
    opens_up: NDArray[np.bool_] | None = None,
    taxels: Codes | None = None,
    eases_up: NDArray[np.bool_] | None = None,
) -> Stream:
    """Return a stream composed of single trials (n, s), (n, j) of classes `labels` (n,): see this module.

    opens_up  (j,) the joints whose codes rise as the hand opens; None: the codes of all fall
    taxels    (n, t) codes; eases_up (t,): those that rise as the taxel is released; None: all fall

    Raises FrontierError for fewer than two grasp types, which have no transitions.
    """
    if len(np.unique(labels)) < 2:
        raise FrontierError("a latency is measured between grasps of different types, and the rows are of one")
    pads = np.empty((len(labels), 0), np.uint16) if taxels is None else taxels
    n_switches, rest = switches.shape[1], _open_hand(pads, eases_up).astype(np.uint16)
    contacts, rest = np.hstack([switches, pads], dtype=np.uint16), np.append(np.zeros(n_switches, np.uint16), rest)
    random = np.random.default_rng(seed)
    order = _order(labels, grasps, random)
    legs = _legs(contacts, rest, codes, _open_hand(codes, opens_up), order, random)
    found = np.concatenate([leg.contacts for leg in legs])
    begins = np.concatenate([[0], np.cumsum([len(leg.at_us) for leg in legs])])
    return stream_from(
        bits=found[:, :n_switches] > 0,
        taxels=found[:, n_switches:],
        codes=np.concatenate([leg.codes for leg in legs]),
        at_us=np.concatenate([leg.at_us for leg in legs]),
        end_us=int(legs[-1].at_us[-1]) + HOLD_US[0],
        arrivals=begins[:-1] + np.array([leg.arrival for leg in legs]),
        ends=begins[1:],
        grasps=labels[order],
        what=f"Latencies are over a stream composed of {grasps} single trials, each held for {HOLD_US[0] / 1e6:g} to "
        f"{HOLD_US[1] / 1e6:g} s, up to {TRANSITION_US / 1e6:g} s from one to the next: the recordings hold no whole "
        "movements.",
    )


def stream_from(
    *,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    at_us: NDArray[np.int64],
    end_us: int,
    arrivals: Rows,
    ends: Rows,
    grasps: Rows,
    what: str,
    taxels: Codes | None = None,
) -> Stream:
    """Return the stream of states that end at end_us, given all grasps (g,), classes `grasps`, in order."""
    types = np.full(len(at_us) + 1, -1, np.intp)
    for arrival, end, grasp in zip(arrivals.tolist(), ends.tolist(), grasps.tolist(), strict=True):
        types[arrival:end] = grasp
    another = np.concatenate([[True], grasps[1:] != grasps[:-1]])
    pads = np.empty((len(at_us), 0), np.uint16) if taxels is None else taxels
    return Stream(
        bits=np.vstack([bits, bits[-1:]]),
        codes=np.vstack([codes, codes[-1:]]),
        at_us=np.append(at_us, np.int64(end_us)),
        types=types,
        arrivals=arrivals[another],
        ends=ends[another],
        what=what,
        taxels=np.vstack([pads, pads[-1:]]),
    )


def _whole(movements: Movements, rows: Rows, count: int) -> NDArray[np.bool_]:
    """Return which movements (m,) have all their rows among `rows`."""
    there = np.zeros(count + 1, np.int64)
    there[1:] = np.cumsum(np.bincount(rows, minlength=count) > 0)
    whole: NDArray[np.bool_] = there[movements.beyond] - there[movements.first] == movements.beyond - movements.first
    return whole


def _laid_out(grasp_set: GraspSet, labels: Rows, movements: Movements, period_us: int, what: str) -> Stream:
    sizes = movements.beyond - movements.first
    begins = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    number = np.repeat(np.arange(len(sizes)), sizes)
    rows = np.arange(sizes.sum()) - begins[number] + movements.first[number]
    times_us = grasp_set.times_us[rows] if grasp_set.times_us.size else np.arange(len(rows)) * period_us
    steps_us = np.maximum(np.diff(times_us, prepend=times_us[:1]), 0)
    steps_us[begins[1:]] = period_us + round(_GOLDEN * period_us)
    at_us = np.cumsum(steps_us, dtype=np.int64)
    return stream_from(
        bits=grasp_set.switches[rows],
        codes=grasp_set.codes[rows],
        at_us=at_us,
        end_us=int(at_us[-1]) + period_us,
        arrivals=begins + movements.complete - movements.first,
        ends=begins + movements.released - movements.first,
        grasps=labels[movements.complete],
        what=what,
        taxels=grasp_set.taxels[rows],
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Leg:
    """The transition from one grasp to the next, and its hold: states (t,), of which `arrival` begins the hold."""

    contacts: Codes
    codes: Codes
    at_us: Times
    arrival: int


def _order(labels: Rows, grasps: int, random: np.random.Generator) -> list[int]:
    """Return the sequence of held trials; every trial occurs once before any is repeated."""
    chosen: list[int] = []
    waiting: list[int] = []
    while len(chosen) < grasps:
        place = next((n for n, row in enumerate(waiting) if not chosen or labels[row] != labels[chosen[-1]]), None)
        if place is None:
            waiting += random.permutation(len(labels)).tolist()
        else:
            chosen.append(waiting.pop(place))
    return chosen


def _open_hand(codes: Codes, opens_up: Bits | None) -> NDArray[np.float64]:
    """Return the values of joints or taxels (n, c) while nothing is held; opens_up: see composed_stream."""
    if not len(codes):
        return np.zeros(codes.shape[1])
    rising = np.sort(codes, axis=0)
    rank = int(_OPEN * (len(codes) - 1))
    opened: NDArray[np.float64] = np.where(
        False if opens_up is None else opens_up, rising[len(codes) - 1 - rank], rising[rank]
    ).astype(np.float64)
    return opened


def _legs(
    contacts: Codes,
    rest: Codes,
    codes: Codes,
    opened: NDArray[np.float64],
    order: list[int],
    random: np.random.Generator,
) -> list[_Leg]:
    legs: list[_Leg] = []
    held, pose, leaves_us = rest, opened, 0
    for row in order:
        lets_go = leaves_us + random.integers(0, RELEASE_US, len(rest))
        grips = leaves_us + RELEASE_US + TRAVEL_US + random.integers(0, GRIP_US, len(rest))
        open_us = np.where(held != rest, lets_go, -_NEVER)
        close_us = np.where(contacts[row] != rest, grips, _NEVER)
        at_us, travelled = _changes(leaves_us, open_us, close_us, _path(pose, codes[row].astype(np.float64), opened))
        now = at_us[:, np.newaxis]
        seen = np.where(now < open_us, held, np.where(now >= close_us, contacts[row], rest))
        leg = _Leg(seen, travelled, at_us, len(at_us) - 1)
        held, pose = contacts[row], codes[row].astype(np.float64)
        leaves_us = int(leg.at_us[-1]) + int(random.integers(*HOLD_US))
        legs.append(leg)
    return legs


def _path(start: NDArray[np.float64], end: NDArray[np.float64], opened: NDArray[np.float64]) -> Codes:
    """Return the codes (TRAVEL_US / RECORD_US + 1, j) along the path, including both ends."""
    t = np.arange(TRAVEL_US // RECORD_US + 1)[:, np.newaxis] / (TRAVEL_US // RECORD_US)
    cubed, left = t * t * t, 1.0 - t
    straight = start + (end - start) * (cubed * (10.0 - t * (15.0 - 6.0 * t)))
    bent = straight + (opened - straight) * (_OPENING * _BUMP * cubed * cubed * left * left * left)
    return np.rint(bent).astype(np.uint16)


def _changes(leaves_us: int, open_us: Times, close_us: Times, path: Codes) -> tuple[Times, Codes]:
    """Return the times of all changes from the beginning of the release to the last, and the joints at these times."""
    starts_us = leaves_us + RELEASE_US
    records_us = starts_us + RECORD_US * np.arange(len(path)) if path.shape[1] else np.array([starts_us + TRAVEL_US])
    changes = np.concatenate([[leaves_us], open_us[open_us > -_NEVER], records_us, close_us[close_us < _NEVER]])
    at_us = np.unique(changes.astype(np.int64))
    return at_us, path[np.clip((at_us - starts_us) // RECORD_US, 0, len(path) - 1)]

"""A stream composed of single trials, where nobody recorded how a hand goes from grasp to grasp.

What is taken from the recordings: the switches and joints of each grasp while it is held. What is made up: all between.
The hand lets go: the switches of the grasp open one by one, at times spread evenly over RELEASE_US. It goes to the next
one: its joints follow a minimum-jerk path (Flash and Hogan 1985, J. Neurosci. 5: 1688) bent half-way towards an open
hand, most at two thirds of the way (Jeannerod 1984, J. Motor Behav. 16: 235), in TRAVEL_US, told every RECORD_US as a
CyberGlove would. It grips: the switches of the next grasp close one by one over GRIP_US; with the last one the grasp is
complete. The times are those of the scene `continuous`. The open hand is, joint by joint, the one that only a twentieth
of the trials opens further.

What that leaves out: a hand that holds is still, and a trial is one frame, so what a single frame gets wrong stays
wrong for the whole hold, and no number of frames makes up for it; contacts that bounce; switches that are touched in
passing.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..points import FrontierError
from .stream import Stream, stream_from

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
_BUMP = 3.0**9 / 2.0**6  # makes t^6 (1 - t)^3 one at its top, t = 2/3
_NEVER = np.int64(1) << 60


@dataclass(frozen=True, slots=True, eq=False)
class Trials:
    """n single trials: switches (n, s), codes (n, j), labels (n,)."""

    switches: Bits
    codes: Codes
    labels: Rows


@dataclass(frozen=True, slots=True, eq=False)
class _Leg:
    """The way from one grasp to the next, and its hold: states (t,), of which number `arrival` is the first of it."""

    bits: Bits
    codes: Codes
    at_us: Times
    arrival: int


def composed(trials: Trials, opens_up: Bits, grasps: int, seed: int, what: str) -> Stream:
    """Return a stream of so many trials, no two of one type in succession, all as often as the others as far as that
    goes. opens_up (j,): joints whose codes rise as the hand opens. Raises FrontierError for fewer than two types.
    """
    if len(np.unique(trials.labels)) < 2:
        raise FrontierError("a latency is measured between grasps of different types, and the rows are of one")
    random = np.random.default_rng(seed)
    order = _order(trials.labels, grasps, random)
    legs = _legs(trials, _open_hand(trials.codes, opens_up), order, random)
    lengths = np.array([len(leg.at_us) for leg in legs])
    begins = np.concatenate([[0], np.cumsum(lengths)])
    return stream_from(
        bits=np.concatenate([leg.bits for leg in legs]),
        codes=np.concatenate([leg.codes for leg in legs]),
        at_us=np.concatenate([leg.at_us for leg in legs]),
        end_us=int(legs[-1].at_us[-1]) + HOLD_US[0],
        arrivals=begins[:-1] + np.array([leg.arrival for leg in legs]),
        ends=begins[1:],
        grasps=trials.labels[order],
        what=what,
    )


def _order(labels: Rows, grasps: int, random: np.random.Generator) -> list[int]:
    """Return which trials are held one after the other; every trial once before any comes again."""
    chosen: list[int] = []
    waiting: list[int] = []
    while len(chosen) < grasps:
        place = next((n for n, row in enumerate(waiting) if not chosen or labels[row] != labels[chosen[-1]]), None)
        if place is None:
            waiting += random.permutation(len(labels)).tolist()
        else:
            chosen.append(waiting.pop(place))
    return chosen


def _open_hand(codes: Codes, opens_up: Bits) -> NDArray[np.float64]:
    if not len(codes):
        return np.zeros(codes.shape[1])
    rising = np.sort(codes, axis=0)
    rank = int(_OPEN * (len(codes) - 1))
    opened: NDArray[np.float64] = np.where(opens_up, rising[len(codes) - 1 - rank], rising[rank]).astype(np.float64)
    return opened


def _legs(trials: Trials, opened: NDArray[np.float64], order: list[int], random: np.random.Generator) -> list[_Leg]:
    legs: list[_Leg] = []
    bits, codes, leaves_us = np.zeros(trials.switches.shape[1], np.bool_), opened, 0
    for row in order:
        lets_go = leaves_us + random.integers(0, RELEASE_US, len(bits))
        grips = leaves_us + RELEASE_US + TRAVEL_US + random.integers(0, GRIP_US, len(bits))
        open_us, close_us = np.where(bits, lets_go, -_NEVER), np.where(trials.switches[row], grips, _NEVER)
        path = _path(codes, trials.codes[row].astype(np.float64), opened)
        leg = _leg(leaves_us, open_us, close_us, path)
        bits, codes = trials.switches[row], trials.codes[row].astype(np.float64)
        leaves_us = int(leg.at_us[-1]) + int(random.integers(*HOLD_US))
        legs.append(leg)
    return legs


def _path(start: NDArray[np.float64], end: NDArray[np.float64], opened: NDArray[np.float64]) -> Codes:
    """Return the codes (TRAVEL_US / RECORD_US + 1, j) on the way, both ends among them."""
    t = np.arange(TRAVEL_US // RECORD_US + 1)[:, np.newaxis] / (TRAVEL_US // RECORD_US)
    cubed, left = t * t * t, 1.0 - t
    straight = start + (end - start) * (cubed * (10.0 - t * (15.0 - 6.0 * t)))
    bent = straight + (opened - straight) * (_OPENING * _BUMP * cubed * cubed * left * left * left)
    return np.rint(bent).astype(np.uint16)


def _leg(leaves_us: int, open_us: Times, close_us: Times, path: Codes) -> _Leg:
    """Return the states from where the hand begins to let go: each in which something changes, up to the last."""
    starts_us = leaves_us + RELEASE_US
    records_us = starts_us + RECORD_US * np.arange(len(path)) if path.shape[1] else np.array([starts_us + TRAVEL_US])
    changes = np.concatenate([[leaves_us], open_us[open_us > -_NEVER], records_us, close_us[close_us < _NEVER]])
    at_us = np.unique(changes.astype(np.int64))
    now = at_us[:, np.newaxis]
    travelled = np.clip((at_us - starts_us) // RECORD_US, 0, len(path) - 1)
    return _Leg((now < open_us) | (now >= close_us), path[travelled], at_us, len(at_us) - 1)

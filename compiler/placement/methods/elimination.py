"""Backward elimination: repeatedly drop the switch whose row of the score tables raises the loss least when removed.

The tables are those that boosting converges to, one row of scores for each bit, fitted jointly (`Logistic`), of all
remaining switches and of the joints. While many switches are left, the few whose rows are cheapest to replace by their
means are dropped together. The last LAST are dropped one at a time, from CANDIDATES candidates: the tables are refitted
without each, since the others may compensate. Of equally likely candidates the lowest number is tried, of equally good
ones the likeliest is dropped.

With the times of ports, a rise in loss is weighed against the time of the port, split among its remaining switches: the
last one of a port pays for all of it.

The joints' codes, if any, are always kept here. Of many rows, a sample is used. Joints, each of which takes time to
digitise and to send, are dropped in the same way, one at a time, after the switches are chosen.
"""

import numpy as np
from numpy.typing import NDArray

from ...elementary import LN_2, Floats, add_up, exp, log
from ...samples import Columns, Samples
from ..logistic import Logistic
from ..ports import PortCosts
from .base import BEST, FINE, Method, first_of

# With at most LAST left they are dropped one at a time, each from CANDIDATES candidates.
LAST, CANDIDATES = 40, 6
# The share of the remaining switches that is dropped at once while many are left.
SHARE = 0.05
# Steps of L-BFGS: at first, for a candidate, and after a removal.
FIRST_STEPS, TRIAL_STEPS, STEPS = 60, 3, 5
# Weight of a port's mean time, relative to a weight of 1 for the switch itself.
PORT_WEIGHT = 16.0
MOST_ROWS = 8192
# Of the joints.
JOINT_ROWS, JOINT_CANDIDATES = 2048, 4
BINS = 8
# Number of factors in 0.5 .. 1 that are multiplied before their exponents are extracted: 2^-512 is no underflow.
_FACTORS = 512


def elimination_order(samples: Samples, ports: PortCosts | None = None) -> Columns:
    """Return the switches that vary in `samples`, most important first (the last one dropped).

    Takes the time of some 1500 evaluations of the tables for 160 switches, independent of the data.
    """
    rows = sampled(samples)
    left: list[int] = np.flatnonzero((rows.switches != rows.switches[0]).any(axis=0)).tolist()
    gone: list[int] = []
    bits = np.ascontiguousarray(rows.switches.T[left])
    fit = Logistic(np.concatenate([bits, thermometer(rows.codes)]), rows.labels, rows.n_classes)
    if len(left) > 1:
        fit.improve(FIRST_STEPS)
    while len(left) > 1:
        costs = np.ones(len(left)) if ports is None else 1.0 + PORT_WEIGHT * ports.shares(left)
        rises = removal_rises(fit.probability, bits, fit.rows[: len(left)], rows.labels)
        likeliest = np.argsort(rises / costs, kind="stable").tolist()
        if len(left) > LAST:
            worst = likeliest[: max(1, int(SHARE * len(left)))]
            fit = fit.without(worst)
            fit.improve(STEPS)
        else:
            fits = {position: fit.without([position]) for position in likeliest[:CANDIDATES]}
            for candidate in fits.values():
                candidate.improve(TRIAL_STEPS)
            before = fit.loss
            worst = [min(fits, key=lambda position: (fits[position].loss - before) / costs[position])]
            fit = fits[worst[0]]
            fit.improve(STEPS - TRIAL_STEPS)
        gone += [left[position] for position in worst]
        left = [column for position, column in enumerate(left) if position not in set(worst)]
        bits = np.delete(bits, worst, axis=0)
    return tuple(left + gone[::-1])


def sampled(samples: Samples, most: int = MOST_ROWS) -> Samples:
    """Return at most `most` rows, spread evenly over each class's rows, in order: classes keep their shares."""
    if len(samples.labels) <= most:
        return samples
    by_class = np.argsort(samples.labels, kind="stable")
    spread = np.arange(most) * len(by_class) // most
    return samples.rows(np.sort(by_class[spread]))


def thermometer(codes: NDArray[np.uint16]) -> NDArray[np.bool_]:
    """Return bits (b, n) of codes (n, j): for each joint, whether the code exceeds each of its BINS - 1 quantiles.

    Duplicate thresholds, and those that no code exceeds, give no bit.
    """
    n = len(codes)
    rows = []
    for column in codes.T:
        quantiles = np.sort(column)[np.arange(1, BINS) * n // BINS]
        rows += [column > threshold for threshold in np.unique(quantiles) if threshold < column.max()]
    return np.array(rows, dtype=np.bool_).reshape(len(rows), n)


def removal_rises(probability: Floats, bits: NDArray[np.bool_], rows: Floats, labels: NDArray[np.intp]) -> Floats:
    """Return the rise (s,) of the sum of -ln P(label) for each switch whose row is replaced by its mean.

    probability (K, n) with all rows in place, bits (s, n), rows (s, K), labels (n,). Removal changes the scores of a
    frame by one of two vectors d (K,), depending on whether the switch is closed; the loss then rises by
    ln(sum over k of P_k exp d_k) - d_label.
    """
    n_classes, n = probability.shape
    member = (labels == np.arange(n_classes)[:, np.newaxis]).astype(np.float64)
    closed_of_class = bits.astype(np.float64) @ member.T
    share = closed_of_class.sum(axis=1, keepdims=True) / n
    closed, opened = rows * (share - 1.0), rows * share
    own = add_up((closed_of_class * closed + (member.sum(axis=1) - closed_of_class) * opened).T)
    return sums_of_logs(_shares_after(probability, np.ascontiguousarray(bits.T), exp(closed), exp(opened))) - own


def _shares_after(probability: Floats, bits: NDArray[np.bool_], closed: Floats, opened: Floats) -> Floats:
    """Return the sum (n, s) over classes of P times its factor (s, K), added class by class."""
    # Not a matrix product: its last bits would depend on the machine.
    total = np.zeros(bits.shape)
    for shares, if_closed, if_open in zip(probability, closed.T, opened.T, strict=True):
        factors = np.where(bits, if_closed, if_open)
        factors *= shares[:, np.newaxis]
        total += factors
    return total


def sums_of_logs(factors: Floats) -> Floats:
    """Return the sum over axis 0 of ln `factors` (n, s), all > 0: (s,), as logarithms of products.

    Factors are multiplied in a fixed order, first halves by second halves, with their exponents extracted.
    """
    product, powers = np.frexp(factors)
    exponents = powers.sum(axis=0, dtype=np.int64)
    while len(product) > 1:
        joined = 1
        while len(product) > 1 and joined < _FACTORS:
            half, joined = len(product) // 2, joined * 2
            product, rest = product[: len(product) - half].copy(), product[len(product) - half :]
            product[:half] *= rest
        product, powers = np.frexp(product)
        exponents += powers.sum(axis=0, dtype=np.int64)
    sums: Floats = log(product[0]) + exponents * LN_2
    return sums


def joint_order(samples: Samples) -> Columns:
    """Return the varying joints, most important first (the last one dropped), given all the switches of these rows.

    JOINT_CANDIDATES joints have the smallest immediate increase of the loss; each is refitted for TRIAL_STEPS more
    steps, and the one with the lowest loss is dropped, of equal ones the lowest number.
    """
    rows = sampled(samples, JOINT_ROWS)
    levels = [thermometer(rows.codes[:, [joint]]) for joint in range(rows.codes.shape[1])]
    left = [joint for joint, bits in enumerate(levels) if len(bits)]
    if len(left) < 2:
        return tuple(left)
    fit = Logistic(np.concatenate([*(levels[joint] for joint in left), rows.switches.T]), rows.labels, rows.n_classes)
    fit.improve(FIRST_STEPS)
    gone: list[int] = []
    while len(left) > 1:
        ends = np.cumsum([0, *(len(levels[joint]) for joint in left)]).tolist()
        without = [fit.without(list(range(*ends[place : place + 2]))) for place in range(len(left))]
        likeliest = sorted(range(len(left)), key=lambda place: without[place].loss)[:JOINT_CANDIDATES]
        for place in likeliest:
            without[place].improve(TRIAL_STEPS)
        worst = min(likeliest, key=lambda place: (without[place].loss, left[place]))
        fit = without[worst]
        fit.improve(STEPS - TRIAL_STEPS)
        gone.append(left.pop(worst))
    return (*left, *gone[::-1])


MEMBER = (
    Method(
        name=BEST,
        help="Repeatedly drop the switch whose removal raises the loss least: score tables fitted jointly",
        learn=lambda samples, _: first_of(elimination_order(samples)),
        nested=True,
        ours=True,
        uses_joints=True,
        sizes=FINE,
        try_all_switches=True,
        tried="always",
        rank=1,
    ),
    Method(
        name="elimination-cost",
        help="Elimination that weighs each switch against its share of the time to read its port",
        learn=lambda samples, ports: first_of(elimination_order(samples, ports)),
        nested=True,
        ours=True,
        uses_joints=True,
        uses_ports=True,
        sizes=FINE,
        try_all_switches=True,
        tried="wired",
        rank=2,
    ),
)

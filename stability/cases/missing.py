"""Ports that do not reply and joints that stop sending; rows fitted to the training rows replace them."""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple, TypeVar

import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from thenar.runtime.build import Build
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.proof import furthest
from thenar.runtime.model.terms.base import HIGHEST_CODE
from thenar.runtime.scores import LANE_OFFSET

from ..checks.integer_sums import first_best
from ..finding import Case, Finding, Worst
from ..inputs.hard_tables import Bits, Codes
from ..inputs.small_sets import SmallBuild, small_build, small_set
from ..reference.numbers import precisely
from ..reference.standing_in import Kind, Rows, stand_ins, whole
from ..reference.tables import balanced, mean_row, mean_switch, table_scores


class Loss(NamedTuple):
    """Masks of kept switches (s,) and joints (j,) that cannot be read, and a description."""

    switches: Bits
    joints: Bits
    name: str

    @property
    def inputs(self) -> Bits:
        """Switches, then joints."""
        return np.concatenate([self.switches, self.joints])


def every_loss(build: Build, width: int) -> Iterator[Loss]:
    """Yield every subset of ports, `width` switches each in the order of their columns, and joints.

    The last port has no kept switch.
    """
    ports = np.array([switch.column // width for switch in build.manifest.switches])
    n_ports, n_joints = int(ports.max()) + 2, build.tables.n_joints
    for silent in product((False, True), repeat=n_ports + n_joints):
        masks = np.array(silent)
        name = f"silent of {n_ports} ports {np.flatnonzero(masks[:n_ports])}, joints {np.flatnonzero(masks[n_ports:])}"
        yield Loss(masks[:n_ports][ports], masks[n_ports:], name)


def changes(tables: IntegerTables, sign: int) -> list[NDArray[np.int64]]:
    """Return per input, times `sign`, the replacement row minus the row of each value, (values, K) steps."""
    pairs = [
        (np.stack([0 * row, row]), mean) for row, mean in zip(tables.switch_rows, tables.switch_means, strict=True)
    ]
    pairs += zip(tables.joint_rows, tables.joint_means, strict=True)
    return [sign * (mean.astype(np.int64) - rows) for rows, mean in pairs]


def worst_frames(tables: IntegerTables) -> Iterator[tuple[Bits, Codes]]:
    """Yield the frames in which a loss changes a score most, and those whose sums get furthest from zero.

    Inputs are independent, so for a class and a direction the first are the same for every loss. Codes are the lowest,
    then the highest, of their bins.
    """
    for sign in (1, -1):
        most = [change.argmax(axis=0) for change in changes(tables, sign)]
        for grasp in range(tables.n_classes):
            picked = [int(of_input[grasp]) for of_input in most]
            bits, bins = np.array(picked[: tables.n_switches], bool), picked[tables.n_switches :]
            ends = [(0, *(steps.astype(int) + 1), *steps, HIGHEST_CODE) for steps in tables.thresholds]
            for end in (0, 1):
                codes = [of[b + end * len(of) // 2] for of, b in zip(ends, bins, strict=True)]
                yield bits, np.array(codes, np.uint16)
    for missing in (True, False):
        found = furthest(tables, missing=missing)
        yield found.bits, found.codes


_T = TypeVar("_T")


class ExactTables:
    """The balanced score tables of a build in steps, and the replacement rows of lost inputs in whole steps, fitted to
    the recordings with the build's own whole rows.

    strays  largest error in steps of each input's replacement in the build: switches, then joints
    """

    @precisely()
    def __init__(self, small: SmallBuild) -> None:
        tables, integers, scale = small.tables, small.build.tables, small.build.tables.scale
        bias, joints = balanced(tables.bias.tolist(), [rows.tolist() for rows in tables.joint_rows])
        self._bias = _scaled(bias, scale)
        self._switches = [_scaled(row, scale) for row in tables.switch_rows.tolist()]
        self._thresholds = [steps.tolist() for steps in tables.thresholds]
        self._joints = [[_scaled(row, scale) for row in rows] for rows in joints]
        of_switches = zip(self._switches, small.bits.T.tolist(), strict=True)
        of_joints = zip(self._thresholds, self._joints, small.codes.T.tolist(), strict=True)
        means = [mean_switch(row, bits) for row, bits in of_switches], [mean_row(*joint) for joint in of_joints]
        got = integers.switch_means.tolist(), integers.joint_means.tolist()
        self._stand_ins: list[tuple[int, ...]] = []
        self.strays: list[int] = []
        for kind, of_kind, rows in zip(_kinds(small), means, got, strict=True):
            starts = whole(of_kind, _float_slack(small), kind.ends)
            strays, fitted = min((_strays(each, rows), each) for each in stand_ins(kind, starts))
            self._stand_ins += fitted
            self.strays += strays

    def scores(self, bits: Sequence[bool], codes: Sequence[int], loss: Loss) -> list[mpf]:
        """Return the scores (K,) of a frame that lost some inputs: each of these has one row for all values."""
        switches, joints = loss.switches.tolist(), loss.joints.tolist()
        for_switches, for_joints = self._stand_ins[: len(switches)], self._stand_ins[len(switches) :]
        return table_scores(
            self._bias,
            _swapped(self._switches, for_switches, switches),
            _swapped(self._thresholds, [[] for _ in joints], joints),
            _swapped(self._joints, [[row] for row in for_joints], joints),
            [lost or bit for lost, bit in zip(switches, bits, strict=True)],
            codes,
        )

    @precisely()
    def most(self, loss: Loss) -> list[mpf]:
        """Return the most (K,) that the loss can change each score, up or down.

        An input's replacement is added instead of one of its rows, independently of other inputs. So for each direction
        this is the sum over lost inputs of the largest change by one input.
        """
        lost = [rows for rows, is_lost in zip(self.changes(), loss.inputs, strict=True) if is_lost]
        return [
            max(sum(max(sign * row[k] for row in rows) for rows in lost) for sign in (1, -1))
            for k in range(len(self._bias))
        ]

    @precisely()
    def changes(self) -> list[list[list[mpf]]]:
        """Return per input, for each of its values, the replacement row minus the value's row (K,)."""
        inputs = [*([[mpf(0)] * len(row), row] for row in self._switches), *self._joints]
        return [
            [[a - b for a, b in zip(lost, row, strict=True)] for row in rows]
            for lost, rows in zip(self._stand_ins, inputs, strict=True)
        ]


def _kinds(small: SmallBuild) -> tuple[Kind, Kind]:
    """Return the switches and the joints of a build, with the scores of its whole rows for its training rows."""
    tables, labels = small.build.tables, small.labels.tolist()
    choices = [np.stack([0 * row, row]).astype(np.int64) for row in tables.switch_rows]
    values: list[NDArray[np.intp]] = list(small.bits.T.astype(np.intp))
    for steps, rows, codes in zip(tables.thresholds, tables.joint_rows, small.codes.T, strict=True):
        choices.append(rows.astype(np.int64))
        values.append(np.searchsorted(steps, codes))
    adds = np.array([rows[of_row] for rows, of_row in zip(choices, values, strict=True)])
    scores = tables.bias + adds.sum(axis=0)

    def kind(inputs: slice) -> Kind:
        without = [*(scores - adds[inputs]), scores - adds[inputs].sum(axis=0)]
        ends = [(tuple(rows.min(axis=0).tolist()), tuple(rows.max(axis=0).tolist())) for rows in choices[inputs]]
        return Kind([each.tolist() for each in without], labels, ends, tables.scale)

    return kind(slice(tables.n_switches)), kind(slice(tables.n_switches, None))


def _strays(one: Rows, other: Sequence[Sequence[int]]) -> list[int]:
    """Return the largest difference between the rows of one and of the other."""
    pairs = zip(one, other, strict=True)
    return [max(abs(a - b) for a, b in zip(*rows, strict=True)) for rows in pairs]


def _scaled(row: Sequence[float], scale: float) -> list[mpf]:
    return [mpf(value) * scale for value in row]


def _swapped(all_: Sequence[_T], others: Sequence[_T], which: Sequence[bool]) -> list[_T]:
    return [other if swap else one for one, other, swap in zip(all_, others, which, strict=True)]


CASE = Case(
    title="Missing ports and silent joints",
    danger="with a fitted row for a missing input a score changes more than proven, or the loss is not reported",
)

_SUBSETS = "every subset of ports and joints"


class Lost(NamedTuple):
    """A loss, and n frames: bits (n, s), codes (n, j), and their scores (n, K) under it."""

    loss: Loss
    bits: Bits
    codes: Codes
    scores: NDArray[np.int64]


def findings(full: bool) -> Iterator[Finding]:
    """Lose every subset of joints and of ports, of 8 and of 16 switches, in recorded and in the worst frames."""
    if full:
        small = small_build(small_set(8, rows=150, switches=48, joints=4, types=5, noise=0.15), rounds=40)
    else:
        small = small_build(small_set(8, rows=100, switches=32, joints=2, types=4, noise=0.1), rounds=20)
    recorded = 24 if full else 8
    hard = list(worst_frames(small.build.tables))
    bits = np.vstack([small.bits[:recorded], *(of_frame for of_frame, _ in hard)])
    codes = np.vstack([small.codes[:recorded], *(of_frame for _, of_frame in hard)])
    losses = [loss for width in (8, 16) for loss in every_loss(small.build, width)]
    cases = [Lost(loss, bits, codes, _scores(small, loss, bits, codes)) for loss in losses]
    exact = ExactTables(small)
    yield _fitted(exact)
    yield from _exactly(small, exact, cases)
    yield _integers(small, cases)
    yield _sums(small, cases)
    yield from _reported(small, cases)


def _scores(small: SmallBuild, loss: Loss, bits: Bits, codes: Codes) -> NDArray[np.int64]:
    frames = zip(bits, codes, strict=True)
    lanes = [small.build.scorer.lanes_without(*frame, loss.switches, loss.joints) for frame in frames]
    return np.array(lanes) - LANE_OFFSET


def _fitted(exact: ExactTables) -> Finding:
    """Compare the replacement of each input with the same fit at 60 digits.

    All of it is integers, so nothing may differ. A number close to a half may be rounded either way if the error of
    doubles decides (reference/standing_in.py): the results of both are right.
    """
    worst = Worst("the replacement of each input", "the fit at 60 digits", 0, "steps")
    for number, strays in enumerate(exact.strays):
        worst.see(strays, f"input {number}")
    return worst.finding()


def _exactly(small: SmallBuild, exact: ExactTables, cases: list[Lost]) -> Iterator[Finding]:
    """Compare scores with the exact ones with replacements, and with those of the whole frame."""
    # Half a step for the bias and for the row of each input; the replacements are whole.
    rounding = (small.tables.n_inputs + 1) / 2 + _float_slack(small)
    scores = Worst(f"scores, {_SUBSETS} lost", "the fit at 60 digits", rounding, "steps")
    proved = Worst(f"change by losing {_SUBSETS}", "the whole frame, 60 digits", 1, "of the proven bound")
    nothing = cases[0].loss
    frames = list(zip(cases[0].bits.tolist(), cases[0].codes.tolist(), strict=True))
    whole = [exact.scores(*frame, nothing) for frame in frames]
    for case in cases:
        with precisely():
            allowed = [most + rounding for most in exact.most(case.loss)]
            for frame, of_whole, got in zip(frames, whole, case.scores.tolist(), strict=True):
                truth = exact.scores(*frame, case.loss)
                scores.see(float(max(abs(a - b) for a, b in zip(truth, got, strict=True))), case.loss.name)
                shares = (abs(a - b) / most for a, b, most in zip(of_whole, got, allowed, strict=True))
                proved.see(float(max(shares)), case.loss.name)
    yield scores.finding()
    yield proved.finding()


def _float_slack(small: SmallBuild) -> float:
    """Return the most steps that doubles can change a score on the way to integers and to their means.

    Counted as in compare.float_slack: with S the sum of the largest magnitudes of all rows, 2^-53 S times the number of
    joints for the bias that balancing sums up, 2 for balanced rows, at most twice as large as before, 2 for the bias,
    scaled, and 6 for means of such rows, which are summed, divided and scaled.
    """
    tables = small.tables
    largest = sum(float(np.abs(row).max()) for row in [tables.bias, *tables.switch_rows, *tables.joint_rows])
    return (len(tables.joint_rows) + 10) * 2.0**-53 * largest * small.build.tables.scale


def _integers(small: SmallBuild, cases: list[Lost]) -> Finding:
    """Integers do not round: the worst frames must change by exactly the bound, and no frame by more."""
    worst = Worst(f"largest change by losing {_SUBSETS}", "the bound itself, in integers", 0, "steps")
    whole = cases[0].scores
    for case in cases:
        for sign in (1, -1):
            most = [change.max(axis=0) for change in changes(small.build.tables, sign)]
            bound = np.sum([m for m, lost in zip(most, case.loss.inputs, strict=True) if lost], axis=0, initial=0)
            found = (sign * (case.scores - whole)).max(axis=0)
            worst.see(float(np.abs(found - bound).max()), case.loss.name, len(whole))
    return worst.finding()


def _sums(small: SmallBuild, cases: list[Lost]) -> Finding:
    """No running sum, in the order of the inputs, may exceed the bound of the build."""
    tables = small.build.tables
    worst = Worst(f"running sums, {_SUBSETS} lost", "the build's bound, at most 32767", tables.bound, "steps")
    for case in cases:
        switches = case.bits.T[:, :, np.newaxis] * tables.switch_rows[:, np.newaxis].astype(np.int64)
        switches[case.loss.switches] = tables.switch_means[case.loss.switches, np.newaxis]
        pairs = zip(tables.thresholds, tables.joint_rows, case.codes.T, strict=True)
        joints = np.stack([rows[np.searchsorted(steps, codes)] for steps, rows, codes in pairs]).astype(np.int64)
        joints[case.loss.joints] = tables.joint_means[case.loss.joints, np.newaxis]
        running = tables.bias + np.cumsum(np.concatenate([switches, joints]), axis=0)
        # The running sums must end at the scores of the scorer.
        differs = not np.array_equal(running[-1], case.scores)
        worst.see(float("inf") if differs else float(np.abs(running).max()), case.loss.name, len(case.bits))
    return worst.finding()


def _reported(small: SmallBuild, cases: list[Lost]) -> Iterator[Finding]:
    degraded = Worst("frames reported as degraded", "those that lost a kept switch or a joint", 0, "frames")
    unread = Worst("outputs that depend on the value of a lost input", "the output without it", 0, "frames")
    build, grasps = small.build, small.build.grasps
    for case in cases:
        lost = case.loss.switches, case.loss.joints
        for bits, codes, scores in zip(case.bits, case.codes, case.scores.tolist(), strict=True):
            found = build.recognise(bits, codes, *lost)
            right = found.degraded == bool(case.loss.inputs.any()) and found.grasp == grasps[first_best(scores)]
            degraded.see(float(not right), case.loss.name)
            other = bits ^ case.loss.switches, np.where(case.loss.joints, HIGHEST_CODE - codes, codes)
            unread.see(float(build.recognise(*other, *lost) != found), case.loss.name)
    yield degraded.finding()
    yield unread.finding()

"""Scores with exact means in place of what is missing, at 60 digits, and what a missing input can change at most."""

from collections.abc import Sequence
from typing import TypeVar

from mpmath import mpf

from ..inputs.small_build import SmallBuild
from ..reference.numbers import precisely
from ..reference.tables import mean_row, mean_switch, table_scores
from .lost_inputs import Loss

_T = TypeVar("_T")


class ExactMeans:
    """The score tables of a build and the means of its recordings, in steps."""

    @precisely()
    def __init__(self, small: SmallBuild) -> None:
        tables, scale = small.tables, small.build.tables.scale
        self._bias = _scaled(tables.bias.tolist(), scale)
        self._switches = [_scaled(row, scale) for row in tables.switch_rows.tolist()]
        self._thresholds = [steps.tolist() for steps in tables.thresholds]
        self._joints = [[_scaled(row, scale) for row in rows.tolist()] for rows in tables.joint_rows]
        pairs = zip(self._switches, small.bits.T.tolist(), strict=True)
        self._switch_means = [mean_switch(row, bits) for row, bits in pairs]
        joints = zip(self._thresholds, self._joints, small.codes.T.tolist(), strict=True)
        self._joint_means = [mean_row(steps, rows, codes) for steps, rows, codes in joints]

    def scores(self, bits: Sequence[bool], codes: Sequence[int], loss: Loss) -> list[mpf]:
        """Return the scores (K,) of a frame that lost some inputs: tables in which these have nothing but a mean."""
        switches, joints = loss.switches.tolist(), loss.joints.tolist()
        return table_scores(
            self._bias,
            _swapped(self._switches, self._switch_means, switches),
            _swapped(self._thresholds, [[] for _ in joints], joints),
            _swapped(self._joints, [[mean] for mean in self._joint_means], joints),
            [lost or bit for lost, bit in zip(switches, bits, strict=True)],
            codes,
        )

    @precisely()
    def most(self, loss: Loss) -> list[mpf]:
        """Return the most (K,) that the loss can change each score, up or down.

        What is lost adds its mean instead of one of its rows, whatever the other inputs say; so that is, for each
        direction, the sum over lost inputs of the most that one can change.
        """
        lost = [rows for rows, is_lost in zip(self.changes(), loss.inputs, strict=True) if is_lost]
        return [
            max(sum(max(sign * row[k] for row in rows) for rows in lost) for sign in (1, -1))
            for k in range(len(self._bias))
        ]

    @precisely()
    def changes(self) -> list[list[list[mpf]]]:
        """Return per input, for each of its values, what its mean adds to the scores (K,) beyond what that adds."""
        means = [*self._switch_means, *self._joint_means]
        inputs = [*([[mpf(0)] * len(row), row] for row in self._switches), *self._joints]
        return [
            [[a - b for a, b in zip(mean, row, strict=True)] for row in rows]
            for mean, rows in zip(means, inputs, strict=True)
        ]


def _scaled(row: Sequence[float], scale: float) -> list[mpf]:
    return [mpf(value) * scale for value in row]


def _swapped(all_: Sequence[_T], others: Sequence[_T], which: Sequence[bool]) -> list[_T]:
    return [other if swap else one for one, other, swap in zip(all_, others, which, strict=True)]

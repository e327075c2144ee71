"""A frame run twice: through the runtime's scorer in integers, and through the reference at 60 digits."""

from collections.abc import Sequence

from mpmath import mpf

from thenar.compiler.tables.collapse import ScoreTables
from thenar.runtime.scores import LANE_OFFSET, Scorer
from thenar.runtime.tables import IntegerTables

from ..reference.numbers import precisely
from ..reference.tables import table_scores


class BothWays:
    """Tables and their integers, arranged for one frame after another."""

    def __init__(self, tables: ScoreTables, integers: IntegerTables) -> None:
        self._scorer, self._scale = Scorer(integers), integers.scale
        self._rows = (
            tables.bias.tolist(),
            tables.switch_rows.tolist(),
            [thresholds.tolist() for thresholds in tables.thresholds],
            [rows.tolist() for rows in tables.joint_rows],
        )

    @precisely()
    def run(self, bits: Sequence[bool], codes: Sequence[int]) -> tuple[list[mpf], list[int]]:
        """Return the frame's scores (K,) in steps: exact ones, and those that run."""
        exact = [score * self._scale for score in table_scores(*self._rows, bits, codes)]
        return exact, [lane - LANE_OFFSET for lane in self._scorer.lanes(bits, codes)]


@precisely()
def lost(exact: Sequence[mpf], deployed: Sequence[int], leader: int, rival: int) -> mpf:
    """Return how many steps of the lead of class `leader` over `rival` are gone."""
    return (exact[leader] - exact[rival]) - (deployed[leader] - deployed[rival])

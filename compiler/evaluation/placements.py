"""Placements chosen from given rows: by ID3, and by its rivals at a given number of switches. Each is grown once."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..placement.id3 import grow_id3
from ..placement.rivals import forward_cmim, random_placement, top_mutual_information
from ..samples import Columns
from .folds import Rows

_Key = tuple[str, int, bytes]


@dataclass(frozen=True, slots=True)
class Placements:
    """Chooses among switches (n, s) bool that should tell labels (n,) apart; every answer is remembered."""

    switches: NDArray[np.bool_]
    labels: NDArray[np.intp]
    _known: dict[_Key, Columns] = field(default_factory=dict, init=False, repr=False)

    def id3(self, rows: Rows, min_samples: int) -> Columns:
        """Return the paper's placement from these rows, pruned by S = `min_samples`."""
        return self._once("id3", min_samples, rows, lambda X, y: grow_id3(X, y, min_samples=min_samples).inputs)

    def cmim(self, rows: Rows, size: int) -> Columns:
        """Return the `size` switches that greedy forward selection by conditional mutual information takes."""
        return self._once("cmim", size, rows, lambda X, y: forward_cmim(X, y, size))

    def top(self, rows: Rows, size: int) -> Columns:
        """Return the `size` switches that each tell most about the grasp type, alone."""
        return self._once("top", size, rows, lambda X, y: top_mutual_information(X, y, size))

    def random(self, size: int, seed: int) -> Columns:
        """Return `size` switches drawn at random."""
        return _plain(random_placement(self.switches.shape[1], size, seed))

    def _once(
        self, method: str, size: int, rows: Rows, choose: Callable[[NDArray[np.bool_], NDArray[np.intp]], ArrayLike]
    ) -> Columns:
        if self.switches.shape[1] == 0:
            return ()
        rows = np.sort(rows)
        key = (method, size, rows.tobytes())
        if key not in self._known:
            self._known[key] = _plain(choose(self.switches[rows], self.labels[rows]))
        return self._known[key]


def _plain(columns: ArrayLike) -> Columns:
    return tuple(int(column) for column in np.asarray(columns, dtype=np.intp))

"""What a placement is learnt from: the rows of a training set, as plain arrays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..limits import check_types
from ..placement.errors import PlacementError

Columns = tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Learning:
    """Rows of a training set, of one honest fold or of everything.

    switches  (n, s) bool; True: closed
    codes     (n, j) uint16, the joints' codes; j = 0: the switches alone are to recognise the grasp
    labels    (n,) intp, class numbers 0..n_classes-1

    Raises PlacementError where the arrays do not fit together.
    """

    switches: NDArray[np.bool_]
    codes: NDArray[np.uint16]
    labels: NDArray[np.intp]
    n_classes: int

    def __post_init__(self) -> None:
        rows = {len(part) for part in (self.switches, self.codes, self.labels)}
        if len(rows) != 1 or self.switches.ndim != 2 or self.codes.ndim != 2 or self.labels.ndim != 1:
            raise PlacementError(
                f"switches {self.switches.shape}, codes {self.codes.shape} and labels {self.labels.shape} must be "
                f"(n, s), (n, j) and (n,) of the same n rows"
            )
        if not rows.pop():
            raise PlacementError("no placement can be learnt from a set without rows")
        if self.labels.min() < 0 or self.labels.max() >= self.n_classes:
            raise PlacementError(f"labels must be class numbers 0 to {self.n_classes - 1}")
        check_types(self.n_classes, PlacementError)

    @property
    def n_switches(self) -> int:
        """Return the number of switches there are to choose from."""
        return int(self.switches.shape[1])

    def rows(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> "Learning":
        """Return some of the rows, by number or by mask (n,)."""
        return Learning(self.switches[chosen], self.codes[chosen], self.labels[chosen], self.n_classes)

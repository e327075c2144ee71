"""Cost-aware ID3: information gain against the scan time that a switch adds to those that are read anyway.

Nodes are split largest first (of equal ones the one found first), so that the switches found first are those that most
rows ask for: the beginning of one growth serves every number of switches. At a node the switch of the largest

    |C| * gain / (1 + marginal time / mean time of a port)

is chosen: gain against cost, with the cost that is left of it. A switch on a port that is read anyway is free; one on a
port of its own counts half where all ports take equally long. Of equal ones the cheaper wins, then the lowest number.
The comparison is exact.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from heapq import heappop, heappush
from math import fsum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .counting import Counter
from .digits import Digits
from .errors import PlacementError
from .gain import Node
from .gainpercost import best_per_cost
from .inputs import check_bits, check_labels

Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class PortCosts:
    """Scan time port by port: reading port p takes us[p] once, however many of its switches are kept.

    port_of  (s,) the port of every switch, an index of `us`
    us       (ports,) microseconds, >= 0

    Raises PlacementError where a switch is on a port that is not there, or a time is negative or not finite.
    """

    port_of: tuple[int, ...]
    us: tuple[float, ...]

    def __post_init__(self) -> None:
        if any(not 0 <= port < len(self.us) for port in self.port_of):
            raise PlacementError(f"every switch must be on one of the {len(self.us)} ports whose times are given")
        if any(not 0 <= us < float("inf") for us in self.us):
            raise PlacementError("the time that reading a port takes must be finite and at least 0 us")

    def scan_us(self, columns: Iterable[int]) -> float:
        """Return the time that reading the switches `columns` takes."""
        return sum(self.us[port] for port in sorted({self.port_of[column] for column in columns}))

    def shares(self, kept: Iterable[int]) -> NDArray[np.float64]:
        """Return, for every switch of `kept`, its port's time shared out over those of `kept` on it, over the mean time
        of a port; 0 where no port takes any time.
        """
        on = np.array([self.port_of[column] for column in kept], dtype=np.intp)
        us = np.array(self.us)
        mean = fsum(self.us) / len(self.us) if any(self.us) else 1.0
        shares: NDArray[np.float64] = us[on] / (np.bincount(on, minlength=len(us))[on] * mean)
        return shares

    def marginal_costs(self, kept: Iterable[int]) -> NDArray[np.int64]:
        """Return, for every switch, sum of all ports' times + number of ports * time that it adds to `kept`.

        Whole nanoseconds, so that comparisons are exact; all 1 where no port takes any time.
        """
        times = np.array([round(us * 1000) for us in self.us], dtype=np.int64)
        if not times.any():
            return np.ones(len(self.port_of), dtype=np.int64)
        left = times * len(times)
        left[sorted({self.port_of[column] for column in kept})] = 0
        costs: NDArray[np.int64] = times.sum() + left[np.array(self.port_of, dtype=np.intp)]
        return costs


def cost_aware_order(X: ArrayLike, y: ArrayLike, ports: PortCosts) -> tuple[int, ...]:
    """Return the switches that the tree for bits X (n, d) and labels y (n,) asks for, in the order they were found.

    Raises PlacementError if X or y are not such data, or `ports` does not know d switches.
    """
    bits = check_bits(X)
    if len(ports.port_of) != bits.shape[1]:
        raise PlacementError(f"ports are known of {len(ports.port_of)} switches, X has {bits.shape[1]}")
    classes, labels = check_labels(y, len(bits))
    return _grow(bits, labels, len(classes), ports)


def _grow(bits: NDArray[np.bool_], labels: NDArray[np.intp], n_classes: int, ports: PortCosts) -> tuple[int, ...]:
    counter = Counter(Digits.from_matrix(bits), labels, n_classes)
    waiting: list[tuple[int, int, Rows]] = [(-len(bits), 0, np.arange(len(bits)))]
    found: dict[int, None] = {}
    costs = ports.marginal_costs(found)
    made = 1
    while waiting:
        _, _, rows = heappop(waiting)
        totals = np.bincount(labels[rows], minlength=n_classes)
        if np.count_nonzero(totals) < 2:
            continue
        column = best_per_cost(Node(totals, counter.count(rows), counter.starts), costs)
        if column is None:
            continue
        if column not in found:
            found[column] = None
            costs = ports.marginal_costs(found)
        closed = bits[rows, column]
        for part in (rows[~closed], rows[closed]):
            heappush(waiting, (-len(part), made, part))
            made += 1
    return tuple(found)

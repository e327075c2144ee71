"""The layout of a build's integer tables in memory, as the C core reads them (`thenar_model` in core/thenar.h).

    score_k = start_k + sum over found rows of row[k] + sum over lines of above * slope[k]

All rows lie in one table: the start; for every group of switches the sums of each combination of closed ones; the bins
of every joint that has thresholds; the cells of every pair of joints. A row is found by its place in pairs of
entries. The middle of a line's range adds nothing, so what its lowest code adds is part of the start. Every sum is
the one of `IntegerTables`, bit for bit: both are exact modulo 2^16, and no score leaves int16.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.terms.base import HIGHEST_CODE

from . import FirmwareError

GROUPS = (4, 1)
"""The numbers of switches that can share a lookup, the fastest first."""
_BLOCK = 4  # pairs that the core adds up at once: the shortest row
_MOST = 65535  # places of rows and thresholds are numbers of 16 bits

Rows = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class StoredBins:
    """The thresholds of a joint, and the places of the first of them and of the row of code 0, the latter in pairs.

    The core halves them: they are filled up to one less than a power of two, by thresholds that no code exceeds.
    """

    joint: int
    first_threshold: int
    thresholds: tuple[int, ...]
    first_row: int

    @property
    def half(self) -> int:
        """How many thresholds the first comparison decides; 0 without thresholds."""
        return (1 << len(self.thresholds).bit_length()) >> 1

    @property
    def filled(self) -> tuple[int, ...]:
        """The thresholds, filled up."""
        size = max(2 * self.half - 1, 0)
        return self.thresholds + (HIGHEST_CODE,) * (size - len(self.thresholds))


@dataclass(frozen=True, eq=False)
class Layout:
    """A layout of `tables` in which `group` switches share a lookup. Raises FirmwareError where it is too large."""

    tables: IntegerTables
    group: int = GROUPS[0]

    def __post_init__(self) -> None:
        tables = self.tables
        if tables.n_switches + tables.n_joints == 0:
            raise FirmwareError("the build uses no switch and no joint: compile it with at least one input")
        for what, count in (("pairs of entries", self.row_pairs * self.n_rows), ("thresholds", len(self.thresholds))):
            if count > _MOST:
                raise FirmwareError(
                    f"the tables have {count} {what}, but firmware has at most {_MOST}: compile with fewer "
                    "``rounds`` or a smaller ``max_bins``, or keep fewer inputs"
                )

    @property
    def row_pairs(self) -> int:
        """The pairs of entries of a row."""
        return max(-(-self.tables.n_classes // 2), _BLOCK)

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """The switches that share a lookup, by their numbers."""
        count = self.tables.n_switches
        return tuple(tuple(range(at, min(at + self.group, count))) for at in range(0, count, self.group))

    @property
    def binned(self) -> tuple[int, ...]:
        """The joints that have thresholds; the others add the same row to every frame, which is part of the start."""
        return tuple(joint for joint, steps in enumerate(self.tables.thresholds) if len(steps))

    @property
    def n_rows(self) -> int:
        """The number of rows of the table."""
        cells = sum(grid.n_rows for grid in self.tables.grids)
        bins = sum(len(self.tables.thresholds[joint]) + 1 for joint in self.binned)
        return 1 + sum((1 << len(group)) - 1 for group in self.groups) + bins + cells

    @property
    def found(self) -> int:
        """The most rows that a frame adds, the start included."""
        return 1 + len(self.groups) + len(self.binned) + len(self.tables.grids)

    @cached_property
    def start(self) -> Rows:
        """The sums before anything is found (K,): the bias, constant joints, and lines at their lowest codes."""
        tables = self.tables
        constant = [rows[0] for steps, rows in zip(tables.thresholds, tables.joint_rows, strict=True) if not len(steps)]
        start: Rows = tables.bias.astype(np.int64) + sum(constant, np.zeros(tables.n_classes, np.int64))
        return start - sum((line.zero * line.row.astype(np.int64) for line in tables.lines), np.zeros_like(start))

    @property
    def sections(self) -> tuple[tuple[str, tuple[int, ...], Rows], ...]:
        """The rows after the start: "switches" or "joints", their numbers, and the rows of a section (m, K)."""
        tables = self.tables
        rows = tables.switch_rows
        switches = [("switches", group, _sums(rows[group[0] : group[-1] + 1])) for group in self.groups]
        bins = [("joints", (joint,), tables.joint_rows[joint].astype(np.int64)) for joint in self.binned]
        grids = [("joints", grid.joints, grid.cells.astype(np.int64)) for grid in tables.grids]
        return (*switches, *bins, *grids)

    @cached_property
    def bins(self) -> tuple[StoredBins, ...]:
        """The joints that have thresholds, then both joints of each pair."""
        tables = self.tables
        row = 1 + sum((1 << len(group)) - 1 for group in self.groups)
        found, at = [], 0
        for joint in self.binned:
            found.append(StoredBins(joint, at, tuple(tables.thresholds[joint].tolist()), row * self.row_pairs))
            row, at = row + len(tables.thresholds[joint]) + 1, at + len(found[-1].filled)
        for grid in tables.grids:
            for joint, steps in zip(grid.joints, grid.thresholds, strict=True):
                found.append(StoredBins(joint, at, tuple(steps.tolist()), row * self.row_pairs))
                at += len(found[-1].filled)
            row += grid.n_rows
        return tuple(found)

    @property
    def thresholds(self) -> tuple[int, ...]:
        """The filled thresholds of all `bins`, one after the other."""
        return tuple(chain.from_iterable(bins.filled for bins in self.bins))

    @property
    def means(self) -> Rows:
        """For each input a shift, and what it adds to an open switch, or to code 0, if it is missing, (s + j, 1 + K).

        Raises FirmwareError if bytes do not hold it, as in a build of an earlier version.
        """
        missing, shifts = self.tables.missing, self.tables.missing_shifts[:, np.newaxis]
        means = missing >> shifts
        if (means << shifts != missing).any():
            raise FirmwareError("what missing inputs add is finer than firmware stores: compile the build again")
        return np.hstack([shifts, means])

    @property
    def frame_size(self) -> int:
        """Bytes of a frame as `frame_bytes` makes them."""
        return 2 * (-(-self.tables.n_switches // 16) + self.tables.n_joints)

    def frame_bytes(self, bits: NDArray[np.bool_], codes: NDArray[np.uint16]) -> NDArray[np.uint8]:
        """Return the inputs as the core stores them, (n, F): switches (n, s) in words of 16, then codes (n, j)."""
        n, words = len(bits), -(-self.tables.n_switches // 16)
        packed = np.zeros((n, 2 * words), np.uint8)
        found = np.packbits(bits, axis=1, bitorder="little")
        packed[:, : found.shape[1]] = found
        return np.hstack([packed, np.ascontiguousarray(codes, "<u2").view(np.uint8).reshape(n, 2 * codes.shape[1])])

    @property
    def memory(self) -> int:
        """The words of 16 bits that a hand needs: inputs, scores, found rows, distances, which inputs are missing."""
        tables = self.tables
        small = len(tables.lines) + -(-(tables.n_switches + tables.n_joints) // 8)
        return self.frame_size // 2 + 2 * self.row_pairs + self.found + -(-small // 2)


def _sums(rows: NDArray[np.int16]) -> Rows:
    """Return the sums of every combination of rows (n, K) but that of none, (2^n - 1, K): bit b is for row b."""
    sums = np.zeros((1, rows.shape[1]), np.int64)
    for row in rows:
        sums = np.vstack([sums, sums + row])
    return sums[1:]

"""How often each class meets each value of each input at a node: all that information gain asks for.

Of every input only the values from the second on are counted, the cells; what is left of the class has the first value.
"""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from .digits import Digits

Counts = npt.NDArray[np.int64]

_DIGIT = 256
_FEW = 1500
_BLOCK = 65536


class Counter:
    """Counts cells at nodes: sets of rows of `digits` (n rows) with class numbers `labels` (n,) below n_classes.

    starts   (n_columns,) the first cell of each of digits.columns
    """

    def __init__(self, digits: Digits, labels: npt.NDArray[np.intp], n_classes: int) -> None:
        self.digits = digits
        self.labels = labels.astype(np.min_scalar_type(max(n_classes - 1, 0)))
        self.n_classes = n_classes
        sizes = [len(values) - 1 for values in digits.values]
        self.starts = np.cumsum([0, *sizes])[:-1].astype(np.intp)
        lanes, self._lane_of_cell = _lanes(digits)
        self._lanes_of_digit = lanes.astype(np.float64)
        self._lanes = lanes.reshape(len(lanes) * _DIGIT, lanes.shape[2])
        self._offsets = np.arange(len(lanes))[:, None] * _DIGIT
        self._classes = np.arange(n_classes, dtype=self.labels.dtype)[:, None]
        self._wide_sizes = sizes[len(digits.places) :]

    def count(self, rows: npt.NDArray[np.intp]) -> Counts:
        """Return the cells of the node that holds `rows`: (n_classes, n_cells)."""
        lanes = self._count_few(rows) if len(rows) <= _FEW else self._count_many(rows)
        flat = lanes.transpose(1, 0, 2).reshape(self.n_classes, -1)
        narrow = flat[:, self._lane_of_cell].astype(np.int64)
        return np.concatenate([narrow, *self._count_wide(rows)], axis=1) if self.digits.wide else narrow

    def _count_few(self, rows: npt.NDArray[np.intp]) -> npt.NDArray[np.float32]:
        """Write every row's lanes out and sum them class by class; float32 holds counts below 2^24 exactly."""
        digits = self.digits.packed.take(rows, axis=1)
        written = self._lanes.take(digits + self._offsets, axis=0)
        member = (self.labels.take(rows) == self._classes).astype(np.float32)
        sums: npt.NDArray[np.float32] = np.matmul(member, written)
        return sums

    def _count_many(self, rows: npt.NDArray[np.intp]) -> npt.NDArray[np.float64]:
        """Count whole digits class by class, then share each digit's count out to its lanes."""
        base = self.labels.take(rows).astype(np.intp) * _DIGIT
        sums = np.empty((len(self.digits.packed), self.n_classes, self._lanes_of_digit.shape[2]))
        for digit, lanes, total in zip(self.digits.packed, self._lanes_of_digit, sums, strict=True):
            histogram = np.zeros(_DIGIT * self.n_classes, dtype=np.int64)
            for start in range(0, len(rows), _BLOCK):
                block = slice(start, start + _BLOCK)
                keys = base[block] + digit.take(rows[block])
                histogram += np.bincount(keys, minlength=len(histogram))
            np.matmul(histogram.reshape(self.n_classes, _DIGIT).astype(np.float64), lanes, out=total)
        return sums

    def _count_wide(self, rows: npt.NDArray[np.intp]) -> Iterator[Counts]:
        for codes, size in zip(self.digits.wide, self._wide_sizes, strict=True):
            radix = size + 1
            keys = self.labels.take(rows).astype(np.intp) * radix + codes.take(rows)
            yield np.bincount(keys, minlength=radix * self.n_classes).reshape(self.n_classes, radix)[:, 1:]


def _lanes(digits: Digits) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.intp]]:
    """Return tables (n_digits, 256, lanes) with a 1 where a digit holds a cell's value, and each narrow cell's lane.

    Lanes are numbered through all digits; every digit has as many as the one with most cells.
    """
    places = np.array([(p.digit, p.weight, p.radix) for p in digits.places], dtype=np.intp).reshape(-1, 3)
    sizes = places[:, 2] - 1
    digit, weight, radix = np.repeat(places, sizes, axis=0).T
    code = 1 + np.arange(len(digit)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    used = np.bincount(digit, minlength=len(digits.packed))
    width = int(used.max(initial=0))
    lane = np.arange(len(digit)) - (np.cumsum(used) - used)[digit]
    tables = np.zeros((len(digits.packed), _DIGIT, width), dtype=np.float32)
    # Cells that lie alike in their digits are written together: of bits, every eighth.
    cells = np.lexsort((code, radix, weight))
    kinds, counts = np.unique(np.stack([weight, radix, code])[:, cells], axis=1, return_counts=True)
    every = np.arange(_DIGIT)
    for (w, r, c), end, count in zip(kinds.T.tolist(), np.cumsum(counts).tolist(), counts.tolist(), strict=True):
        alike = cells[end - count : end]
        tables[digit[alike], :, lane[alike]] = every // w % r == c
    return tables, digit * width + lane

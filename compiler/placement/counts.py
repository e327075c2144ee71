"""Count how often each class occurs with each value of each input at a node; information gain needs nothing else.

Several inputs are packed in one byte, as mixed-radix digits, so that a node's counts need few passes. Eight bits make
one digit, five three-valued inputs make one, and so on. An input of more than NARROW values has a digit to itself
("wide"). An input's value at a row is then (digit // weight) % radix: a code, the rank of the value. Only the values
from the second on are counted, as cells; the rest of each class has the first value.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .exact import Counts
from .inputs import PlacementError

NARROW = 16
_DIGIT = 256
# Rows packed together, the most rows to expand into lanes, and rows counted together.
_PACKED, _FEW, _BLOCK = 16384, 1500, 65536


@dataclass(frozen=True, slots=True)
class Place:
    """Location of one input within a byte: the digit's number, and value code = (digit // weight) % radix."""

    digit: int
    weight: int
    radix: int


@dataclass(frozen=True, slots=True)
class Digits:
    """Packed inputs of n rows.

    packed   (n_digits, n) uint8, the digits of the narrow inputs
    wide     one (n,) array of codes for each wide input
    places   location of each narrow input, digit by digit
    columns  the number of each input, narrow ones in the order of `places`, then the wide ones; constant ones are
             left out, unless X holds bits only
    values   for each of `columns`, its values in ascending order
    """

    n_rows: int
    n_inputs: int
    packed: npt.NDArray[np.uint8]
    wide: tuple[npt.NDArray[Any], ...]
    places: tuple[Place, ...]
    columns: npt.NDArray[np.intp]
    values: tuple[npt.NDArray[Any], ...]

    def codes(self, position: int, rows: npt.NDArray[np.intp]) -> npt.NDArray[Any]:
        """Return the value codes of input number `columns[position]` at `rows`."""
        if position >= len(self.places):
            return self.wide[position - len(self.places)].take(rows)
        place = self.places[position]
        digits: npt.NDArray[Any] = self.packed[place.digit].take(rows)
        return digits // np.uint8(place.weight) % np.uint8(place.radix)

    @classmethod
    def from_matrix(cls, X: npt.NDArray[Any]) -> "Digits":
        """Pack X (n, d), bool or ints >= 0."""
        if X.dtype == np.bool_ or not X.size or X.max() <= 1:
            return _pack_bits(X)
        return _pack_values(X)

    @classmethod
    def from_packed_bits(cls, bits: npt.NDArray[np.uint8], n_inputs: int) -> "Digits":
        """Wrap rows that are already packed: bits = np.packbits(X, axis=1, bitorder="little") of n_inputs columns."""
        if bits.dtype != np.uint8 or bits.ndim != 2 or bits.shape[1] != -(-n_inputs // 8):
            raise PlacementError(f"{n_inputs} bits a row are (n, {-(-n_inputs // 8)}) uint8, not {bits.shape}")
        return _digits_of_bits(np.ascontiguousarray(bits.T), n_inputs)


def _pack_bits(X: npt.NDArray[Any]) -> Digits:
    n, d = X.shape
    packed = np.empty((-(-d // 8), n), dtype=np.uint8)
    for start in range(0, n, _PACKED):
        packed[:, start : start + _PACKED] = np.packbits(X[start : start + _PACKED], axis=1, bitorder="little").T
    return _digits_of_bits(packed, d)


def _digits_of_bits(packed: npt.NDArray[np.uint8], d: int) -> Digits:
    both = np.arange(2)
    places = tuple(Place(digit=i // 8, weight=1 << i % 8, radix=2) for i in range(d))
    return Digits(packed.shape[1], d, packed, (), places, np.arange(d), (both,) * d)


def _pack_values(X: npt.NDArray[Any]) -> Digits:
    n, d = X.shape
    values = [np.unique(np.ascontiguousarray(X[:, column])) for column in range(d)]
    narrow = sorted((c for c in range(d) if 1 < len(values[c]) <= NARROW), key=lambda c: len(values[c]))
    wide = [c for c in range(d) if len(values[c]) > NARROW]
    places = _places([len(values[c]) for c in narrow])
    packed = np.zeros((places[-1].digit + 1 if places else 0, n), dtype=np.uint8)
    for column, place in zip(narrow, places, strict=True):
        packed[place.digit] += _codes(X[:, column], values[column]) * np.uint8(place.weight)
    columns = np.array(narrow + wide, dtype=np.intp)
    codes = tuple(_codes(X[:, column], values[column]) for column in wide)
    return Digits(n, d, packed, codes, tuple(places), columns, tuple(values[c] for c in columns))


def _codes(column: npt.NDArray[Any], values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return np.searchsorted(values, column).astype(np.min_scalar_type(len(values) - 1))


def _places(radices: list[int]) -> list[Place]:
    """Fill each digit while the product of its radices fits a byte."""
    places: list[Place] = []
    digit, weight = 0, 1
    for radix in radices:
        if weight * radix > _DIGIT:
            digit, weight = digit + 1, 1
        places.append(Place(digit, weight, radix))
        weight *= radix
    return places


class Counter:
    """Counts cells at nodes: subsets of the rows of `digits` (n rows) with class numbers `labels` (n,) below n_classes.

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
        """Return the cells (n_classes, n_cells) of the node that holds `rows`."""
        lanes = self._count_few(rows) if len(rows) <= _FEW else self._count_many(rows)
        flat = lanes.transpose(1, 0, 2).reshape(self.n_classes, -1)
        narrow = flat[:, self._lane_of_cell].astype(np.int64)
        return np.concatenate([narrow, *self._count_wide(rows)], axis=1) if self.digits.wide else narrow

    def _count_few(self, rows: npt.NDArray[np.intp]) -> npt.NDArray[np.float32]:
        """Expand every row into lanes and sum them per class; float32 holds counts below 2^24 exactly."""
        digits = self.digits.packed.take(rows, axis=1)
        written = self._lanes.take(digits + self._offsets, axis=0)
        member = (self.labels.take(rows) == self._classes).astype(np.float32)
        sums: npt.NDArray[np.float32] = np.matmul(member, written)
        return sums

    def _count_many(self, rows: npt.NDArray[np.intp]) -> npt.NDArray[np.float64]:
        """Count whole digits per class, then distribute each digit's count to its lanes."""
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

    Lanes are numbered through all digits; every digit has as many lanes as the largest one needs.
    """
    places = np.array([(p.digit, p.weight, p.radix) for p in digits.places], dtype=np.intp).reshape(-1, 3)
    sizes = places[:, 2] - 1
    digit, weight, radix = np.repeat(places, sizes, axis=0).T
    code = 1 + np.arange(len(digit)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    used = np.bincount(digit, minlength=len(digits.packed))
    width = int(used.max(initial=0))
    lane = np.arange(len(digit)) - (np.cumsum(used) - used)[digit]
    tables = np.zeros((len(digits.packed), _DIGIT, width), dtype=np.float32)
    # Write cells at the same offset in their digits together: for bits, every eighth.
    cells = np.lexsort((code, radix, weight))
    kinds, counts = np.unique(np.stack([weight, radix, code])[:, cells], axis=1, return_counts=True)
    every = np.arange(_DIGIT)
    for (w, r, c), end, count in zip(kinds.T.tolist(), np.cumsum(counts).tolist(), counts.tolist(), strict=True):
        alike = cells[end - count : end]
        tables[digit[alike], :, lane[alike]] = every // w % r == c
    return tables, digit * width + lane

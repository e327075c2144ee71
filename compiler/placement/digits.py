"""Several inputs in one byte: mixed-radix digits, stored input by input, so that a node's counts need few passes.

Eight bits make one digit, five three-valued inputs make one, and so on. An input of more than NARROW values is a digit
of its own ("wide"). An input's value at a row is then (digit // weight) % radix: a code, the rank of the value.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import PlacementError

NARROW = 16
_DIGIT = 256
_BLOCK = 16384


@dataclass(frozen=True, slots=True)
class Place:
    """One input inside a byte: the digit's number, and value code = (digit // weight) % radix."""

    digit: int
    weight: int
    radix: int


@dataclass(frozen=True, slots=True)
class Digits:
    """Inputs of n rows, packed.

    packed   (n_digits, n) uint8, the digits of the narrow inputs
    wide     one (n,) array of codes for each wide input
    places   where each narrow input is, digit by digit
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
        """Take rows that are packed already: bits = np.packbits(X, axis=1, bitorder="little") of n_inputs columns."""
        if bits.dtype != np.uint8 or bits.ndim != 2 or bits.shape[1] != -(-n_inputs // 8):
            raise PlacementError(f"{n_inputs} bits a row are (n, {-(-n_inputs // 8)}) uint8, not {bits.shape}")
        return _digits_of_bits(np.ascontiguousarray(bits.T), n_inputs)


def _pack_bits(X: npt.NDArray[Any]) -> Digits:
    n, d = X.shape
    packed = np.empty((-(-d // 8), n), dtype=np.uint8)
    for start in range(0, n, _BLOCK):
        packed[:, start : start + _BLOCK] = np.packbits(X[start : start + _BLOCK], axis=1, bitorder="little").T
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
    """Fill digit after digit, as long as the product of the radices fits a byte."""
    places: list[Place] = []
    digit, weight = 0, 1
    for radix in radices:
        if weight * radix > _DIGIT:
            digit, weight = digit + 1, 1
        places.append(Place(digit, weight, radix))
        weight *= radix
    return places

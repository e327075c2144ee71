"""A hand laid flat, with its switches, for pictures, reports and specs.

The positions come from a hand map (simulator/handmaps) or from a user's layout, so nothing here depends on how hands
are simulated.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import ThenarError
from thenar.runtime.names import nearest

Floats = NDArray[np.float64]


class MapError(ThenarError, ValueError):
    """A switch or a set that cannot be drawn on the hand."""


@dataclass(frozen=True, slots=True, eq=False)
class HandShape:
    """A glove laid flat; all positions in mm for a hand of `length_mm`.

    The shipped one is a right hand, palm up, thumb right, with the digits' sides unfolded. A user's layout is drawn to
    scale and has no length (None); its outline, strips, creases and labels may be empty.

    names, places (s, 2)  the switches and their centres; radius_mm of the circle that represents one
    parts (s,)            index of each switch's part in part_names: the digits from the thumb on, then the palm
    sides (s,)            -1 on the unfolded left side of its digit, 1 on the right one, 0 elsewhere
    outline (k, 2)        the hand from cuff to cuff; digits: outline of each digit; creases: open lines
    strips                outlines of the unfolded sides, left and right of the thumb, then of the index, ...
    labels (digits, 2)    where a digit's name is written, above its tip
    part_number           of a switch to buy, and body_mm, its width; "" and 0 if open
    """

    glove: str
    length_mm: float | None
    names: tuple[str, ...]
    places: Floats
    radius_mm: float
    part_names: tuple[str, ...]
    parts: NDArray[np.intp]
    sides: NDArray[np.intp]
    outline: Floats
    digits: tuple[Floats, ...]
    strips: tuple[Floats, ...]
    creases: tuple[Floats, ...]
    labels: Floats
    part_number: str = ""
    body_mm: float = 0.0

    @property
    def view(self) -> str:
        """Description of the view."""
        if self.length_mm is None:
            return f"the glove as drawn in {self.glove}"
        return "a right hand, palm up, thumb right, the sides of its digits unfolded"

    @property
    def wrist(self) -> tuple[float, float]:
        """Where the wires end: in the middle of the glove's cuff; for a user's layout, in the middle below it."""
        if self.length_mm is not None:
            x, y = (self.outline[0] + self.outline[-1]) / 2
            return float(x), float(y)
        points = np.concatenate([self.outline, self.places])
        (left, bottom), (right, _) = points.min(axis=0), points.max(axis=0)
        return float((left + right) / 2), float(bottom)

    def fitted(self, names: Sequence[str], length_mm: float | None = None) -> "HandShape | None":
        """Return the hand at that length if it has all the switches `names`; None if not, or without names."""
        if not names or not self.knows(names):
            return None
        return self if length_mm is None else self.scaled(length_mm)

    def scaled(self, length_mm: float) -> "HandShape":
        """Return the same hand at another length, with its proportions; the size of a switch stays."""
        if self.length_mm is None:
            raise MapError(f"{self.glove} is drawn to scale: only the glove that thenar draws can be resized")
        factor = length_mm / self.length_mm
        return replace(
            self,
            length_mm=length_mm,
            places=self.places * factor,
            outline=self.outline * factor,
            digits=tuple(digit * factor for digit in self.digits),
            strips=tuple(strip * factor for strip in self.strips),
            creases=tuple(crease * factor for crease in self.creases),
            labels=self.labels * factor,
        )

    @property
    def by_name(self) -> dict[str, tuple[float, float]]:
        """Position of each switch, mm, by its name."""
        return {name: (x, y) for name, (x, y) in zip(self.names, self.places.tolist(), strict=True)}

    def knows(self, names: Sequence[str]) -> bool:
        """Return whether every one of `names` is a switch or taxel of this hand, or a level of one ("pad3>118")."""
        return set(map(self._place_of, names)) <= set(self.names)

    def _place_of(self, name: str) -> str:
        return name if name in self.names else name.rpartition(">")[0]

    def numbers_of(self, names: Sequence[str]) -> NDArray[np.intp]:
        """Return the numbers of the switches called `names`; for a level, its taxel's. Raises MapError that names the
        first unknown one.
        """
        number = {name: number for number, name in enumerate(self.names)}
        places = list(map(self._place_of, names))
        strange = next((name for name, place in zip(names, places, strict=True) if place not in number), None)
        if strange is not None:
            if self.length_mm is not None and number.keys().isdisjoint(places):
                raise MapError(f"the position of switch {strange!r} is unknown: say it with ``layout``")
            raise MapError(f"{strange!r} is no switch of the glove {self.glove}{nearest(strange, self.names)}")
        return np.array([number[place] for place in places], dtype=np.intp)

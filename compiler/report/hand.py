"""The hand as SVG: paths, circles and names in mm, y downwards, for the template to write out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..hand import Floats, HandShape

_MARGIN_MM = 4.0
_NEAREST_MM = 0.5  # outline points closer than this to the last drawn one are skipped
_LABELS_MM = 7.0
_LEAST_LETTER = 8.4 / 370  # as a fraction of a drawing of this width in pixels: smaller letters are illegible


@dataclass(frozen=True, slots=True)
class HandPicture:
    """A hand to draw; `ident` prefixes the ids of its elements, title and summary are for screen readers.

    view_box is SVG's; radius is of a dot, letter the least size of its number on a narrow screen; outline, strips and
    creases are values of `d`. labels hold the name and place of each digit; dots hold the name and place of each
    switch, and its number among the kept ones, from 1; "" if it is not kept.
    """

    ident: str
    title: str
    summary: str
    view_box: str
    radius: str
    letter: str
    outline: str
    strips: tuple[str, ...]
    creases: tuple[str, ...]
    labels: tuple[tuple[str, str, str], ...]
    dots: tuple[tuple[str, str, str, str], ...]


def hand_picture(hand: HandShape, kept: Sequence[str], ident: str, title: str, summary: str) -> HandPicture:
    """Return the picture of `hand` with the switches called `kept`, all of which it has, numbered in their order."""
    order, box = {name: str(place) for place, name in enumerate(kept, 1)}, _view_box(hand)
    return HandPicture(
        ident=ident,
        title=title,
        summary=summary,
        view_box=" ".join(map(_mm, box)),
        radius=f"{hand.radius_mm:.2f}",
        letter=_mm(box[2] * _LEAST_LETTER),
        outline=_path(hand.outline, closed=True),
        strips=tuple(_path(strip, closed=True) for strip in hand.strips),
        creases=tuple(_path(crease, closed=False) for crease in hand.creases),
        labels=tuple(
            (name, _mm(x), _mm(-y)) for name, (x, y) in zip(hand.part_names, hand.labels.tolist(), strict=False)
        ),
        dots=tuple(
            (name, _mm(x), _mm(-y), order.get(name, ""))
            for name, (x, y) in zip(hand.names, hand.places.tolist(), strict=True)
        ),
    )


def _view_box(hand: HandShape) -> tuple[float, float, float, float]:
    points = np.concatenate([hand.outline, *hand.strips, hand.places, hand.labels])
    (left, bottom), (right, top) = points.min(axis=0) - _MARGIN_MM, points.max(axis=0) + _MARGIN_MM
    # The names of the digits extend beyond their places.
    return left - _LABELS_MM, -top, right - left + 2 * _LABELS_MM, top - bottom


def _path(points: Floats, *, closed: bool) -> str:
    if not len(points):
        return ""
    drawn = [points[0]]
    for point in points[1:-1]:
        if np.hypot(*(point - drawn[-1])) >= _NEAREST_MM:
            drawn.append(point)
    drawn.append(points[-1])
    steps = " ".join(f"{_mm(x)} {_mm(-y)}" for x, y in drawn)
    return f"M{steps}{'Z' if closed else ''}"


def _mm(value: float) -> str:
    return f"{value:.1f}"

"""The content of a report; and what its sections share: tables of texts, and pictures of the hand."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.errors import BuildError
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.manifest import Manifest
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.scanning.scanmap import ScanMap

from ..facts import Fact
from ..frontier.points import Frontier
from ..hand import Floats, HandShape
from ..model.compare import Comparison, WorstCase
from ..model.faults import FaultCounts
from ..movements.transitions import Transitions
from ..placement.tree import Tree

_MARGIN_MM = 4.0
_NEAREST_MM = 0.5  # outline points closer than this to the last drawn one are skipped
_LABELS_MM = 7.0
_LEAST_LETTER = 8.4 / 370  # as a fraction of a drawing of this width in pixels: smaller letters are illegible


@dataclass(frozen=True, slots=True, eq=False)
class ReportContent:
    """A build and everything known about it; None where something was not requested or does not apply.

    tables        the build's integer tables
    facts         the facts of the build; warnings: sentences on what is wrong with it
    tree          the tree that chose the switches, over the recordings' switches; classes index manifest.grasps
    confusion     (K, K) counts of frames in the headline's folds, row: true, column: predicted; K types, with "none" if
                  the build can predict it
    frontier      the frontier to report; point: the number of the build's point, None if it is not on the frontier
    hand          the positions of the recordings' switches
    scan, harness the scan map and the harness that it was made for
    comparison    the training rows, through the model, its tables and the integers
    faults        the effect of each input fault on the training rows
    transitions   how often each type follows each, where the recordings are whole movements
    worst         the worst case of the integers over all possible frames
    has_page      whether try.html is in the same folder

    Raises BuildError where parts are inconsistent.
    """

    manifest: Manifest
    tables: IntegerTables
    facts: tuple[Fact, ...]
    warnings: tuple[str, ...] = ()
    tree: Tree | None = None
    confusion: NDArray[np.intp] | None = None
    frontier: Frontier | None = None
    point: int | None = None
    hand: HandShape | None = None
    scan: ScanMap | None = None
    harness: Harness | None = None
    comparison: Comparison | None = None
    faults: FaultCounts | None = None
    worst: WorstCase | None = None
    transitions: Transitions | None = None
    has_page: bool = False

    def __post_init__(self) -> None:
        grasps, classes = len(self.manifest.grasps), len(self.manifest.classes)
        if self.tables.n_classes != grasps or self.tables.n_switches != len(self.manifest.switches):
            raise BuildError("the tables do not match build.json: compile the build again")
        if self.confusion is not None and self.confusion.shape not in ((grasps, grasps), (classes, classes)):
            raise BuildError(f"the confusion matrix of {grasps} grasp types has the shape {self.confusion.shape}")
        if self.tree is not None and len(self.tree.classes) > grasps:
            raise BuildError("the tree has more grasp types than the build: it belongs to other recordings")
        if self.hand is not None and not self.hand.knows(self.sources):
            raise BuildError("the hand lacks a kept switch: it belongs to another glove")
        if self.scan is not None and self.harness is None:
            raise BuildError("the scan map has no harness: compile with ``glove`` and the glove.toml in use")

    @property
    def switch_names(self) -> tuple[str, ...]:
        """Names of the kept switches, in the order in which they were chosen."""
        return tuple(switch.name for switch in self.manifest.switches)

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the kept switches, and of the taxels with kept levels, by first occurrence."""
        return tuple(dict.fromkeys(switch.source for switch in self.manifest.switches))


@dataclass(frozen=True, slots=True)
class PlainTable:
    """A table of texts: every row is as long as `columns`.

    words  columns of words; the others hold numbers, right-aligned
    head   the column with the row headings
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: tuple[int, ...] = (0,)
    head: int = 0


@dataclass(frozen=True, slots=True)
class HandPicture:
    """A hand as SVG, in mm, y downwards.

    ident prefixes the ids of its elements; title and summary are for screen readers. view_box is SVG's; radius is of a
    dot, letter the least size of its number on a narrow screen; outline, strips and creases are values of `d`. labels
    hold the name and place of each digit; dots hold the name and place of each switch, and its number among the kept
    ones, from 1; "" if it is not kept.
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

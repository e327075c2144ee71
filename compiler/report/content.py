"""The content of a report, and the tables of texts of which its sections are made."""

from collections.abc import Mapping
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
from ..hand import HandShape
from ..model.compare import Comparison, WorstCase
from ..model.faults import FaultCounts
from ..movements.transitions import Transitions
from ..placement.tree import Tree


@dataclass(frozen=True, slots=True, eq=False)
class ReportContent:
    """A build and everything known about it; None where something was not requested or does not apply.

    tables        the build's integer tables
    facts         the facts of the build; warnings: sentences on what is wrong with it
    data          what the scripts of the page read: tryout.page_data
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

    Raises BuildError where parts are inconsistent.
    """

    manifest: Manifest
    tables: IntegerTables
    facts: tuple[Fact, ...]
    data: Mapping[str, object]
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

"""What a report is made of, and the table that its sections share."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.errors import ThenarError
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.manifest import Manifest
from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.tables import IntegerTables

from ..evaluation.study import Study
from ..frontier.points import Frontier
from ..hand import HandShape
from ..placement.tree import Tree
from ..segmenting.transitions import Transitions
from ..tables.compare import Comparison, WorstCase
from ..tables.faults import FaultCounts


class ReportError(ThenarError, ValueError):
    """The parts of a report do not belong together."""


@dataclass(frozen=True, slots=True, eq=False)
class ReportContent:
    """A build and what is known of it; None where a thing was not asked for or has no meaning.

    tables        the build's integer tables, tables_bytes their size in `tables.bin`
    rounds        rounds of boosting that the ensemble holds
    firmware      a sentence: what the firmware in the build is laid out for, or why there is none
    only_answer   the one grasp type that every row gets, where there is but one
    tree          the tree that chose the switches, over the recordings' switches; classes index manifest.grasps
    confusion     (K, K) counts of frames in the headline's folds, row: true, column: recognised, as in manifest.answers
    study         the paper's tables for these recordings; no_study: a sentence, why there are none
    frontier      of which the report tells; point: the number of the one that the build is, None if it is none of them
    hand          where the recordings' switches lie
    scan, harness the scan map and the harness that it was made for
    comparison    the rows trained on, through the model, its tables and the integers
    faults        what each fault of an input leaves of the rows trained on
    transitions   which type follows which, where the recordings are whole movements
    worst         the worst that integers can do, over every frame there is
    has_page      whether try.html lies beside the report

    Raises ReportError where parts do not belong together.
    """

    manifest: Manifest
    tables: IntegerTables
    tables_bytes: int
    rounds: int
    firmware: str = ""
    only_answer: str | None = None
    tree: Tree | None = None
    confusion: NDArray[np.intp] | None = None
    study: Study | None = None
    no_study: str = "They were not asked for."
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
        grasps, answers = len(self.manifest.grasps), len(self.manifest.answers)
        if self.tables.n_classes != grasps or self.tables.n_switches != len(self.manifest.switches):
            raise ReportError("the tables are of another build than build.json: compile the build again")
        if self.confusion is not None and self.confusion.shape not in ((grasps, grasps), (answers, answers)):
            raise ReportError(f"a confusion matrix of {grasps} grasp types is not {self.confusion.shape}")
        if self.tree is not None and len(self.tree.classes) > grasps:
            raise ReportError("the tree knows more grasp types than the build: it is of other recordings")
        if self.hand is not None and not self.hand.knows(self.sources):
            raise ReportError("the hand lacks a kept switch: it is of another glove")
        if self.scan is not None and (self.harness is None or self.scan.harness != self.harness.fingerprint):
            raise ReportError("the scan map is not of this harness: compile with --glove and the glove.toml in use")

    @property
    def switch_names(self) -> tuple[str, ...]:
        """Names of the kept switches, in the order in which they were chosen."""
        return tuple(switch.name for switch in self.manifest.switches)

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the kept switches, and of the taxels that levels are kept of, in the order of the first of each."""
        return tuple(dict.fromkeys(switch.source for switch in self.manifest.switches))


@dataclass(frozen=True, slots=True)
class PlainTable:
    """A table of texts: every row is as long as `columns`.

    words  columns of words; the others hold numbers, to the right
    head   the column that heads the rows
    note   a sentence below the table
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: tuple[int, ...] = (0,)
    head: int = 0
    note: str = ""

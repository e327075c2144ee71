"""The properties of a complete build, and the documents in its folder: its report and the spec of its glove."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.build import Build
from thenar.runtime.hand import HandDrawing, load_hand
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.manifest import Manifest
from thenar.runtime.model.integers import IntegerTables, tables_to_bytes
from thenar.runtime.scanning.scanmap import ScanMap

from ..facts import Fact, facts
from ..hand import HandShape
from ..model.compare import Comparison, worst_case
from ..model.faults import FaultCounts
from ..recogniser import Recogniser
from ..recordings.graspset import GraspSet

if TYPE_CHECKING:
    from ..frontier.points import Frontier
    from ..glove.prices import Part
    from ..movements.transitions import Transitions

REPORT_NAME, SPEC_FOLDER = "report.html", "spec"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BuildReport:
    """A build and its properties.

    Attributes
    ----------
    folder : Path
        Its folder.
    manifest : Manifest
        The content of `build.json`.
    tables : IntegerTables
        The deployed tables; `tables_bytes` is the size of `tables.bin`.
    only_answer : str or None
        The grasp type predicted for every row, if there is only one: then the inputs carry no information that a sum
        over them can use.
    firmware : str
        What the firmware is laid out for, or why there is none, in words.
    scan, harness : ScanMap, Harness or None
        How to read the switches, and the wiring to read them from; None if it was compiled without a harness.
    unread : str
        A sentence on the joints if nothing in the harness reads them; empty otherwise.
    grasp_set, trained, comparison
        The training set, the trained model, and the training rows through the model, its tables and the integers.
    faults : FaultCounts
        The accuracy that remains on the training rows under each input fault.
    drawing : HandDrawing
        The content of `hand.json`.
    confusion : ndarray of int, shape (K, K), or None
        How often the folds predicted each grasp type (columns) for rows of each type (rows); None without folds.
    """

    folder: Path
    manifest: Manifest
    tables: IntegerTables
    tables_bytes: int
    only_answer: str | None
    firmware: str
    scan: ScanMap | None
    harness: Harness | None
    unread: str
    grasp_set: GraspSet
    recogniser: Recogniser
    comparison: Comparison
    faults: FaultCounts
    drawing: HandDrawing
    confusion: NDArray[np.intp] | None

    @property
    def facts(self) -> tuple[Fact, ...]:
        """Its facts in words, as the command line and the report print them."""
        return facts(self.manifest, self.scan, self.harness, tables_bytes=self.tables_bytes, firmware=self.firmware)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on a build that always predicts the same, and on joints that nothing in the harness reads."""
        always = (
            f"the build predicts {self.only_answer} for every row: no single input distinguishes grasp types, and the "
            "model looks at one input at a time"
        )
        return tuple(filter(None, ("" if self.only_answer is None else always, self.unread)))

    def __repr__(self) -> str:
        """Return the folder, and the numbers of grasp types, switches and joints."""
        types, switches, joints = self.tables.n_classes, self.tables.n_switches, self.tables.n_joints
        return f"<BuildReport {self.folder}: {types} grasp types, {switches} switches, {joints} joints>"


@dataclass(frozen=True, slots=True, eq=False)
class Documents:
    """`report.html` and, where switches are kept, `spec/`, to be written into a build's folder.

    Parameters
    ----------
    hand : HandShape, optional
        The recorded glove, laid flat: pictures show the switches on it, if it has them all.
    parts : mapping, optional
        The part of a price list for each sensor of the glove, by name, for the bill of materials.
    frontier, point : Frontier and int, optional
        The frontier from which a point is built, and the point's number.
    """

    hand: HandShape | None = None
    frontier: "Frontier | None" = None
    point: int | None = None
    parts: "Mapping[str, Part] | None" = None

    def files(self, made: BuildReport) -> Mapping[str, bytes]:
        """Return path in the build's folder -> content."""
        from ..glove.files import spec_files

        files = {REPORT_NAME: self._report(made)}
        if names := list(dict.fromkeys(switch.source for switch in made.manifest.switches)):
            hand = None if self.hand is None else self.hand.fitted(names)
            spec = spec_files(made.manifest, made.scan, made.harness, hand, self.parts)
            files |= {f"{SPEC_FOLDER}/{name}": content for name, content in spec.items()}
        return files

    def _report(self, made: BuildReport) -> bytes:
        from ..report.content import ReportContent
        from ..report.page import report_html
        from ..report.tryout import page_data

        rows = made.recogniser.read(made.recogniser.samples)
        tables = tables_to_bytes(made.tables)
        names = [switch.name for switch in made.manifest.switches]
        return report_html(
            ReportContent(
                manifest=made.manifest,
                tables=made.tables,
                facts=made.facts,
                data=page_data(made.manifest, tables, made.drawing, rows.switches, rows.codes, rows.labels),
                warnings=made.warnings,
                tree=made.recogniser.selection.tree,
                confusion=made.confusion,
                frontier=self.frontier,
                point=self.point,
                hand=None if self.hand is None else self.hand.fitted(made.grasp_set.element_names),
                scan=made.scan,
                harness=made.harness,
                transitions=_transitions(made.grasp_set),
                comparison=made.comparison,
                faults=made.faults,
                worst=worst_case(made.recogniser.model, made.tables, made.comparison, made.manifest.grasps, names),
            )
        )


def _transitions(grasp_set: GraspSet) -> "Transitions | None":
    """Return which type follows which, where the rows are whole movements, else None."""
    from ..movements.transitions import Transitions
    from ..recordings import RecordingError

    try:
        return Transitions.of_set(grasp_set) if grasp_set.is_none.any() else None
    except RecordingError:
        return None


def report_of_build(folder: str | Path) -> bytes:
    """Return the page of the build in `folder`: its `report.html`, or else one made of what the folder states.

    Raises BuildError or FormatError if the folder is not a valid build.
    """
    where = Path(folder)
    build = Build.load(where)
    if (where / REPORT_NAME).is_file():
        return (where / REPORT_NAME).read_bytes()
    bits, codes = np.zeros((0, build.tables.n_switches), bool), np.zeros((0, build.tables.n_joints), np.uint16)
    return stated_report(build, load_hand(where, build.manifest), bits, codes, np.zeros(0, np.intp))


def stated_report(
    build: Build,
    hand: HandDrawing,
    bits: NDArray[np.bool_],
    codes: NDArray[np.uint16],
    labels: NDArray[np.intp],
    firmware: str = "",
    confusion: NDArray[np.intp] | None = None,
) -> bytes:
    """Return the page of a build, made of what the build states itself.

    Rows of its inputs (n, s) and (n, j) with labels (n,) can be tried. `firmware` and `confusion` are as in a
    BuildReport.
    """
    from ..report.content import ReportContent
    from ..report.page import report_html
    from ..report.tryout import page_data

    tables = tables_to_bytes(build.tables)
    data = page_data(build.manifest, tables, hand, bits, codes, labels)
    about = facts(build.manifest, tables_bytes=len(tables), firmware=firmware)
    return report_html(ReportContent(build.manifest, build.tables, about, data, confusion=confusion))

"""What `thenar compile` writes beside a build: its report, and the spec of its glove."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .hand import hand_of

if TYPE_CHECKING:
    from ..compiler.build.made import Made
    from ..compiler.evaluation.study import Study
    from ..compiler.frontier.points import Frontier
    from ..compiler.recordings.graspset import GraspSet

    Report = Callable[[int, int], None]

REPORT_NAME, SPEC_FOLDER = "report.html", "spec"


@dataclass(frozen=True, slots=True)
class Papers:
    """Writes `report.html` and, where switches are kept, `spec/`.

    study        the paper's tables for the recordings, None for none
    frontier     the frontier that the build was picked from
    hand_length  of whom the glove is for, mm; None: the usual hand
    """

    study: "Study | None" = None
    frontier: "Frontier | None" = None
    hand_length: float | None = None

    def __call__(self, made: "Made") -> Mapping[str, bytes]:
        """Return path in the build's folder -> content."""
        from ..compiler.spec.files import spec_files

        files = {REPORT_NAME: self._report(made)}
        if made.manifest.switches:
            hand = hand_of([switch.name for switch in made.manifest.switches], self.hand_length)
            spec = spec_files(made.manifest, made.scan, made.harness, hand)
            files |= {f"{SPEC_FOLDER}/{name}": content for name, content in spec.items()}
        return files

    def _report(self, made: "Made") -> bytes:
        from ..compiler.report.content import ReportContent
        from ..compiler.report.guarantee import guarantee_of
        from ..compiler.report.page import report_html

        return report_html(
            ReportContent(
                manifest=made.manifest,
                tables=made.tables,
                tables_bytes=made.tables_bytes,
                rounds=made.trained.stumps.n_rounds,
                firmware=made.firmware,
                only_answer=made.only_answer,
                tree=made.trained.tree,
                confusion=made.confusion,
                study=self.study,
                frontier=self.frontier,
                hand=hand_of(made.grasp_set.switch_names),
                scan=made.scan,
                harness=made.harness,
                guarantee=guarantee_of(made.trained.stumps, made.tables, made.comparison, made.manifest.grasps),
            )
        )


def study_of(grasp_set: "GraspSet", rounds: int, folds: int, report: "Report") -> "Study | None":
    """Return the paper's tables for the recordings, honest and once; None where they cannot be cut so."""
    from ..compiler.evaluation.errors import EvaluationError
    from ..compiler.evaluation.study import Options, evaluate

    options = Options(
        folds=folds,
        repeats=1,
        rounds=rounds,
        protocols=("honest",),
        tables=("compositions", "generality", "pruning"),
    )
    try:
        return evaluate(grasp_set, options, progress=report)
    except EvaluationError:
        return None

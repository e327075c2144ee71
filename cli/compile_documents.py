"""What `thenar compile` writes beside a build: its report, and the spec of its glove."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from thenar.compiler.artifact.made import REPORT_NAME, SPEC_FOLDER

from .hand import hand_of

if TYPE_CHECKING:
    from thenar.compiler.artifact.made import Made
    from thenar.compiler.evaluation.study import Study
    from thenar.compiler.frontier.picked import Picked

    Progress = Callable[[int, int], None]

_SMALL = 5000  # rows times rounds


@dataclass(frozen=True, slots=True)
class BuildDocuments:
    """Writes `report.html` and, where switches are kept, `spec/`.

    report       called with what is done and to do of the paper's tables
    picked       the point of a frontier that is built, if it is one
    hand_length  of whom the glove is for, mm; None: the usual hand
    """

    report: "Progress | None" = None
    picked: "Picked | None" = None
    hand_length: float | None = None

    def __call__(self, made: "Made") -> Mapping[str, bytes]:
        """Return path in the build's folder -> content."""
        from thenar.compiler.glove.files import spec_files

        files = {REPORT_NAME: self._report(made)}
        if made.manifest.switches:
            hand = hand_of([switch.name for switch in made.manifest.switches], self.hand_length)
            spec = spec_files(made.manifest, made.scan, made.harness, hand)
            files |= {f"{SPEC_FOLDER}/{name}": content for name, content in spec.items()}
        return files

    def _report(self, made: "Made") -> bytes:
        from thenar.compiler.report.content import ReportContent
        from thenar.compiler.report.guarantee import guarantee_of
        from thenar.compiler.report.page import report_html

        study, no_study = self._study(made)
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
                study=study,
                no_study=no_study,
                frontier=None if self.picked is None else self.picked.frontier,
                point=None if self.picked is None else self.picked.point.number,
                hand=hand_of(made.grasp_set.switch_names),
                scan=made.scan,
                harness=made.harness,
                guarantee=guarantee_of(made.trained.stumps, made.tables, made.comparison, made.manifest.grasps),
            )
        )

    def _study(self, made: "Made") -> "tuple[Study | None, str]":
        """Return the paper's tables, honest and once, of the build's own folds, rounds and seed; or why there are none.

        Last of all: by then, nothing is wrong with the build.
        """
        from thenar.compiler.evaluation.errors import EvaluationError
        from thenar.compiler.evaluation.study import Options, evaluate

        asked = made.manifest.options
        if not asked.folds:
            return None, "The build was compiled without folds."
        options = Options(
            folds=asked.folds,
            repeats=1,
            rounds=asked.rounds,
            protocols=("honest",),
            tables=("compositions", "generality", "pruning"),
            seed=asked.seed,
        )
        # Little work is done before other processes are up.
        jobs = 1 if len(made.grasp_set) * asked.rounds < _SMALL else -1
        try:
            return evaluate(made.grasp_set, options, jobs, self.report), ""
        except EvaluationError as reason:
            return None, f"These recordings have none: {reason}."

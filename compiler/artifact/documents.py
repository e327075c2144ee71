"""The documents that go with a build: its report, and the spec of its glove."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ..evaluation.errors import EvaluationError
from ..evaluation.study import Options, Study, evaluate
from ..frontier.points import Frontier
from ..glove.files import spec_files
from ..hand import HandShape
from ..report.content import ReportContent
from ..report.guarantee import guarantee_of
from ..report.page import report_html
from .made import REPORT_NAME, SPEC_FOLDER, Made

_SMALL = 5000  # rows times rounds


@dataclass(frozen=True, slots=True)
class BuildDocuments:
    """Makes `report.html` and, where switches are kept, `spec/`: the `documents` of `compile_build`.

    Parameters
    ----------
    hand : HandShape, optional
        The glove laid flat. It is drawn where it has all the switches; without one, no switch has a place.
    hand_length : float, optional
        Length of the wearer's hand in mm, for the spec. The default is the length of `hand`.
    frontier : Frontier, optional
        The frontier that the report shows.
    point : int, optional
        Number of the frontier's point that is built.
    progress : callable, optional
        `progress(done, total)` is called as the paper's tables are made.
    """

    hand: HandShape | None = None
    hand_length: float | None = None
    frontier: Frontier | None = None
    point: int | None = None
    progress: Callable[[int, int], None] | None = None

    def __call__(self, made: Made) -> Mapping[str, bytes]:
        """Return path in the build's folder -> content."""
        files = {REPORT_NAME: self._report(made)}
        if made.manifest.switches:
            kept = [switch.name for switch in made.manifest.switches]
            hand = None if self.hand is None else self.hand.fitted(kept, self.hand_length)
            spec = spec_files(made.manifest, made.scan, made.harness, hand)
            files |= {f"{SPEC_FOLDER}/{name}": content for name, content in spec.items()}
        return files

    def _report(self, made: Made) -> bytes:
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
                frontier=self.frontier,
                point=self.point,
                hand=None if self.hand is None else self.hand.fitted(made.grasp_set.switch_names),
                scan=made.scan,
                harness=made.harness,
                guarantee=guarantee_of(made.trained.stumps, made.tables, made.comparison, made.manifest.grasps),
            )
        )

    def _study(self, made: Made) -> tuple[Study | None, str]:
        """Return the paper's tables, honest and once, of the build's own folds, rounds and seed; or why there are none.

        Last of all: by then, nothing is wrong with the build.
        """
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
            return evaluate(made.grasp_set, options, jobs, self.progress), ""
        except EvaluationError as reason:
            return None, f"These recordings have none: {reason}."

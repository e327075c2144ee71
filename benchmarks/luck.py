"""Coverage, on fresh grasps, of the interval that a frontier promises for the point that it selects.

Usage:
    python benchmarks/luck.py

Each case records the switches of scene kamakura under another seed, a few repetitions, searches, selects the best point
within a budget, and lets its tables, trained on all rows, classify fresh grasps: of the same hands, or of other ones.
The output is the number of intervals that cover the fresh rate, and the promised rate minus the fresh one, with and
without its correction.
"""

import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.frontier.cache import Cache, Store
from thenar.compiler.frontier.designs import best_designs, designs_of, lucks
from thenar.compiler.frontier.finalists import evaluate_finalists, screen, select_finalists
from thenar.compiler.frontier.points import By
from thenar.compiler.frontier.price import ClassifyModel, Equipment
from thenar.compiler.frontier.search import Search
from thenar.compiler.frontier.survey import Cuts, Survey
from thenar.compiler.frontier.wirings import overhead_of, wirings
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.merging import merge
from thenar.compiler.samples import Samples
from thenar.compiler.workers import in_workers
from thenar.runtime.model.integers import tables_from_bytes
from thenar.simulator import load_scene, simulate

SCENE, TARGET = "kamakura", "avr2560"
# Repetitions of every grasp type by every subject: recorded; fresh, of the same hands; of hands that nobody recorded.
REPETITIONS, MORE, OTHERS = 12, 16, 8
BUDGET_US = 700.0
CASES = 100
FIRST_OTHER = 100_000


@dataclass(frozen=True)
class Case:
    """Recordings of one seed, with the promised and the fresh rate of their best point within a budget."""

    rate: Rate
    luck: float
    fresh: float

    @property
    def covered(self) -> bool:
        """Whether the promised interval contains the fresh rate."""
        return self.rate.low <= self.fresh <= self.rate.high


def recorded(seed: int, repetitions: int = REPETITIONS, more: int | None = None) -> GraspSet:
    """Return the switches of grasps of one seed; with `more`, of this many fresh ones of the same hands."""
    found = simulate(load_scene(SCENE).varied(repetitions, seed, more=more), jobs=1).grasp_set
    return replace(found, codes=found.codes[:, :0], joints=())


def strangers() -> GraspSet:
    """Return grasps of hands that no case records."""
    sets = [recorded(FIRST_OTHER + number) for number in range(OTHERS)]
    return merge({str(number): each for number, each in enumerate(sets)}, each="subject")


def played(asked: tuple[int, GraspSet | None, Equipment]) -> Case:
    """Return the case of one seed: its rate with new subjects on the grasps of `others`, else on its own fresh ones."""
    seed, others, equipment = asked
    grasp_set = recorded(seed)
    search = Search(
        methods=("id3",),
        folds=6,
        repeats=1,
        screening=10,
        rounds=10,
        finalists=2,
        seed=seed,
        by="trial" if others is None else "subject",
    )
    samples = Samples.of(grasp_set)
    cuts = Cuts.of(samples, search)
    with tempfile.TemporaryDirectory() as folder, Store(Path(folder) / "store", "") as store:
        asking = Cache(store, lambda _done, _all: None, jobs=1)
        survey = Survey(grasp_set, SCENE, samples, None, search, cuts, equipment, asking)
        screened = screen(survey)
        finalists = evaluate_finalists(survey, select_finalists(screened, [], search.finalists))
    designs = [design for finalist in finalists for design in designs_of(finalist)]
    luck = lucks(designs, screened, survey)
    by_time, _ = best_designs(designs)
    fresh = recorded(seed, more=MORE) if others is None else others
    best = [design for design in by_time if design.frame.us <= BUDGET_US or design is by_time[0]][-1]
    tables = tables_from_bytes(best.tables.content)
    columns = [element.column for element in best.finalist.screened.elements]
    predicted = tables.scores(fresh.switches[:, columns], fresh.codes[:, : tables.n_joints]).argmax(axis=1)
    truth = np.array([samples.grasps.index(grasp) for grasp in fresh.grasps.tolist()])
    lucky = luck[best.judged]
    return Case(best.judged.rate.corrected(lucky), lucky, float((predicted == truth).mean()))


def cases(seeds: Iterable[int], by: By, jobs: int) -> list[Case]:
    """Return the cases of these seeds, in any order."""
    equipment = Equipment(ClassifyModel(TARGET), wirings(None, TARGET), overhead_of(TARGET))
    others = strangers() if by == "new subject" else None
    asked = [(seed, others, equipment) for seed in seeds]
    found: list[Case] = []
    for case in in_workers(played, asked, jobs):
        found.append(case)
        print(f"{len(found)} of {len(asked)}", end="\r", file=sys.stderr, flush=True)
    return found


def summary(found: Sequence[Case]) -> str:
    """Return the number of covered cases and the mean errors of rates, in a line."""
    columns = [(case.rate.mean - case.fresh, case.luck, case.fresh, case.rate.high - case.rate.low) for case in found]
    gap, luck, fresh, width = 100 * np.mean(columns, axis=0)
    return (
        f"{sum(case.covered for case in found)} of {len(found)} covered; fresh {fresh:.1f} %, promised {gap:+.1f} "
        f"({gap + luck:+.1f} uncorrected), luck {luck:.1f}, half-width {width / 2:.1f}"
    )


def main() -> None:
    """Print, for each kind of rate, the number of covered cases and the mean errors of rates."""
    kinds: tuple[By, ...] = ("new subject", "pooled")
    for by in kinds:
        found = cases(range(1, CASES + 1), by, -1)
        print(f"{by}, the best within {BUDGET_US:g} µs: {summary(found)}")


if __name__ == "__main__":
    main()

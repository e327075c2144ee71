"""From finalists to points: all designs of each finalist, and those on a front."""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from msgspec.structs import replace as changed_to

from thenar.runtime.recipe import Recipe

from ..evaluation.rates import Draws, Rate
from ..trainers.base import TRAINERS, Training
from .finalists import EvaluatedFinalist, Screened
from .points import FrontierPoint, PointSetting, PointTime, front
from .price import Classified, PricedTables
from .search import placement_of
from .survey import Survey, TrialAccuracy
from .wirings import NO_TIME, ScanTimes


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """One design of a finalist: these tables, and the scan of its switches (None: it reads none).

    transfer  time of reading the joints
    measured  time of classifying, simulated or measured; None: the model's estimate
    """

    finalist: EvaluatedFinalist
    tables: PricedTables
    classified: Classified
    wired: ScanTimes | None
    transfer: PointTime
    measured: PointTime | None = None

    @property
    def judged(self) -> TrialAccuracy:
        """The evaluation of these tables by which points are chosen."""
        return self.finalist.tables[self.tables.recipe]

    @property
    def rate(self) -> float:
        """The accuracy of these tables."""
        return self.judged.rate.mean

    @property
    def size(self) -> int:
        """The number of elements that are read, or of sensors if these were chosen."""
        return self.finalist.screened.size

    @property
    def scan(self) -> PointTime:
        """Time of reading the switches."""
        return NO_TIME if self.wired is None else PointTime(self.wired.us, self.wired.how)

    @property
    def classify(self) -> PointTime:
        """Time of classifying."""
        return self.measured or PointTime(self.classified.us, self.classified.how)

    @property
    def frame(self) -> PointTime:
        """Time of reading everything, on separate lines in parallel, and classifying."""
        return PointTime(max(self.scan.us, self.transfer.us) + self.classify.us, self.classify.how)


def designs_of(finalist: EvaluatedFinalist, read: PointTime = NO_TIME) -> Iterator[Design]:
    """Yield all designs of a finalist, whose joints take `read`."""
    for tables in finalist.priced:
        if tables.classified is not None:
            scans = tables.scans if finalist.screened.elements else (None, *tables.scans)
            yield from (Design(finalist, tables, tables.classified, scan, read) for scan in scans)


def best_designs(designs: Sequence[Design]) -> tuple[list[Design], list[Design]]:
    """Return the designs on the front of accuracy against frame time, and those against the number of switches.

    Of equal designs, take the one with fewer chips, then fewer ports, less reading and less flash.
    """
    designs = sorted(designs, key=_effort)
    by_time = front(designs, lambda design: design.frame.us, lambda design: design.rate)
    designs.sort(key=lambda design: design.frame.us)
    return by_time, front(designs, lambda design: design.size, lambda design: design.rate)


def lucks(designs: Sequence[Design], screened: Sequence[Screened], survey: Survey) -> dict[TrialAccuracy, float]:
    """Return the optimism of the accuracies of tables on the fronts of frame time and of the number of switches.

    A point is the best of everything cheaper than the next point of its front: tables of finalists, and placements that
    were only screened. Of two fronts the greater optimism counts.
    """
    # Not all tables were priced: those of the same shape take nearly the same time.
    quickest = dict[tuple[EvaluatedFinalist, Recipe], float]()
    for design in designs:
        recipe = changed_to(design.tables.recipe, rounds=None)
        quickest[design.finalist, recipe] = min(design.frame.us, quickest.get((design.finalist, recipe), np.inf))
    finalists = list(dict.fromkeys(design.finalist for design in designs))
    chosen = {finalist.screened.recipe for finalist in finalists}
    picked_from = [
        (judged, us, finalist.screened.size)
        for finalist in finalists
        for recipe, judged in finalist.tables.items()
        if (us := quickest.get((finalist, changed_to(recipe, rounds=None)))) is not None
    ]
    picked_from += [(one.judged, one.frame_us, one.size) for one in screened if one.recipe not in chosen]
    judged, *costs = zip(*picked_from, strict=True)
    most = max(each.repeats for each in judged)
    hits = np.array([each.hits * (most // each.repeats) for each in judged])
    units = survey.cuts.people if survey.cuts.by == "new subject" else np.arange(hits.shape[1])
    draws = Draws.of(hits, units, survey.search.seed)
    found: dict[TrialAccuracy, float] = {}
    prices: tuple[Callable[[Design], float], ...] = (lambda design: design.frame.us, lambda design: design.size)
    for best, price, cost in zip(best_designs(designs), prices, costs, strict=True):
        beyond = [price(design) for design in best[1:]]
        for design, luck in zip(best, draws.luck(np.array(cost), [*beyond, np.inf]), strict=True):
            # As a share: the draws count hits in all repeats.
            found[design.judged] = max(luck / most, found.get(design.judged, 0.0))
    return found


def _effort(design: Design) -> tuple[float, ...]:
    parts = (design.wired.chips, design.wired.ports) if design.wired else (0, 0)
    return (*parts, design.scan.us, design.classified.flash, design.tables.recipe.rounds or 1)


def points_of(
    designs: Sequence[Design],
    luck: Mapping[TrialAccuracy, float],
    adapted: Mapping[Recipe, tuple[Rate, Rate]],
    survey: Survey,
) -> tuple[FrontierPoint, ...]:
    """Return the points on a front, numbered from the fastest frame on; `luck` is subtracted from each rate, `adapted`
    has those before and after adaptation.
    """
    fronts = dict(zip(("frame", "switches"), best_designs(designs), strict=True))
    best = [design for design in designs if any(design in some for some in fronts.values())]
    points = []
    for number, design in enumerate(sorted(best, key=lambda design: (design.frame.us, design.size)), 1):
        wired, finalist, recipe = design.wired, design.finalist, design.finalist.screened.recipe
        joints = survey.some_joints(recipe)
        points.append(
            FrontierPoint(
                number=number,
                setting=_setting(design, survey.training(recipe), joints),
                switches=survey.names(recipe),
                rate=design.judged.rate.corrected(luck[design.judged]),
                luck=luck[design.judged],
                frames=finalist.frames.get(design.tables.recipe),
                other_rate=finalist.other.get(design.tables.recipe),
                scan=design.scan,
                transfer=design.transfer,
                classify=design.classify,
                frame=design.frame,
                flash=design.classified.flash,
                ram=design.classified.ram,
                ports=0 if wired is None else wired.ports,
                chips=0 if wired is None else wired.chips,
                fronts=tuple(name for name, some in fronts.items() if design in some),
                joints=joints,
                adapted=adapted.get(design.tables.recipe),
            )
        )
    return tuple(points)


def _setting(design: Design, training: Training, joints: Sequence[str]) -> PointSetting:
    """Return the choices of a point: of its recipe, and what the recipe leaves open."""
    wired, recipe, trainer = design.wired, design.tables.recipe, TRAINERS.named(training.trainer)
    inputs = recipe.inputs
    if recipe.sensors is not None and not (joints and design.finalist.screened.elements):
        inputs = "joints" if joints else "switches"
    usual = {setting.name: setting.default for setting in trainer.settings}
    own: dict[str, Any] = {name: value for name, value in training.settings.items() if value not in (usual[name], None)}
    return PointSetting(
        placement=placement_of(recipe),
        inputs=inputs,
        rounds=recipe.rounds if trainer.staged else None,
        width=recipe.width,
        wiring="" if wired is None else wired.wiring,
        clock_hz=0 if wired is None else wired.clock_hz,
        table_bits=recipe.table_bits,
        max_bins=own.pop("max_bins", None),
        # msgspec omits a name that equals the default only if it is the very same string.
        trainer=sys.intern(training.trainer),
        settings=own,
        keep_joints=recipe.keep_joints,
        levels=recipe.levels,
    )

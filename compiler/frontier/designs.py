"""From finalists to points: all designs of each finalist, their decisions, and those on a front."""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..evaluation.luck import Draws
from ..evaluation.rates import Rate
from ..trainers.base import TRAINERS, Training
from .finalists import EvaluatedFinalist
from .latency import POLICIES
from .points import DecisionKind, FrontierPoint, Latency, PointSetting, PointTime, front
from .price import PricedTables, Wired
from .screen import Screened
from .search import Candidate, Shape
from .survey import Cuts, TrialAccuracy
from .timing.classify_times import Classified
from .timing.scan_times import NO_TIME


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """One design of a finalist: these tables, and the scan of its switches (None: it reads none).

    transfer  time of reading the joints
    measured  time of classifying, simulated or measured; None: the model's estimate
    """

    close: EvaluatedFinalist
    tables: PricedTables
    classified: Classified
    wired: Wired | None
    transfer: PointTime
    measured: PointTime | None = None

    @property
    def judged(self) -> TrialAccuracy:
        """The evaluation of these tables by which points are chosen."""
        return self.close.tables[self.tables.tabled]

    @property
    def rate(self) -> float:
        """The accuracy of these tables."""
        return self.judged.rate.mean

    @property
    def n_switches(self) -> int:
        """The number of switches that are read."""
        return len(self.close.screened.elements)

    @property
    def scan(self) -> PointTime:
        """Time of reading the switches."""
        return PointTime(0.0, "wire") if self.wired is None else PointTime(self.wired.scan.us, self.wired.scan.how)

    @property
    def classify(self) -> PointTime:
        """Time of classifying."""
        return self.measured or PointTime(self.classified.us, self.classified.how)

    @property
    def frame(self) -> PointTime:
        """Time of reading everything, on separate lines in parallel, and classifying."""
        return PointTime(max(self.scan.us, self.transfer.us) + self.classify.us, self.classify.how)


Latencies = Mapping[tuple[Design, DecisionKind], Latency]


def designs(close: EvaluatedFinalist, read: PointTime = NO_TIME) -> Iterator[Design]:
    """Yield all designs of a finalist, whose joints take `read`."""
    for tables in close.priced:
        if tables.classified is not None:
            wirings = tables.wired if close.screened.elements else (None, *tables.wired)
            yield from (Design(close, tables, tables.classified, wired, read) for wired in wirings)


def best_designs(several: Sequence[Design]) -> tuple[list[Design], list[Design]]:
    """Return the designs on the front of accuracy against frame time, and those against the number of switches.

    Of equal designs, take the one with fewer chips, then fewer ports, less reading and less flash.
    """
    times = {design: design.frame.us for design in several}
    cheapest = sorted(several, key=_effort)
    by_time = front(cheapest, times.__getitem__, lambda design: design.rate)
    cheapest.sort(key=times.__getitem__)
    return by_time, front(cheapest, lambda design: design.n_switches, lambda design: design.rate)


def lucks(
    fronts: tuple[Sequence[Design], Sequence[Design]],
    several: Sequence[Design],
    screened: Sequence[Screened],
    cuts: Cuts,
    seed: int,
) -> dict[TrialAccuracy, float]:
    """Return the optimism of the accuracies of tables on the fronts of frame time and of the number of switches.

    A point is the best of everything cheaper than the next point of its front: tables of finalists, and placements that
    were only screened. Of two fronts the greater optimism counts.
    """
    quickest: dict[tuple[EvaluatedFinalist, Shape], float] = {}
    for design in several:
        key = (design.close, design.tables.tabled.shape)
        quickest[key] = min(design.frame.us, quickest.get(key, np.inf))
    closes = list(dict.fromkeys(design.close for design in several))
    chosen = {close.screened.choice for close in closes}
    picked_from = [
        (judged, quickest[close, tabled.shape], len(close.screened.elements))
        for close in closes
        for tabled, judged in close.tables.items()
        if (close, tabled.shape) in quickest
    ]
    picked_from += [(one.judged, one.frame_us, len(one.elements)) for one in screened if one.choice not in chosen]
    judged, *costs = zip(*picked_from, strict=True)
    most = max(each.repeats for each in judged)
    hits = np.array([each.hits * (most // each.repeats) for each in judged])
    draws = Draws.of(hits, cuts.people if cuts.by == "new subject" else np.arange(hits.shape[1]), seed)
    found: dict[TrialAccuracy, float] = {}
    prices: tuple[Callable[[Design], float], ...] = (lambda design: design.frame.us, lambda design: design.n_switches)
    for best, price, cost in zip(fronts, prices, costs, strict=True):
        limits = [*(price(design) for design in best[1:]), np.inf]
        for design, luck in zip(best, draws.luck(np.array(cost), limits), strict=True):
            # As a share: the draws count hits in all repeats.
            found[design.judged] = max(luck / most, found.get(design.judged, 0.0))
    return found


def _effort(design: Design) -> tuple[float, ...]:
    parts = (design.wired.scan.chips, design.wired.scan.ports) if design.wired else (0, 0)
    return (*parts, design.scan.us, design.classified.flash, design.tables.tabled.rounds)


def points_of(
    several: Sequence[Design],
    latencies: Latencies,
    luck: Mapping[TrialAccuracy, float],
    names: Callable[[Candidate], Sequence[str]],
    training: Callable[[Candidate], Training],
    joints: Callable[[Candidate], Sequence[str]] = lambda _: (),
) -> tuple[FrontierPoint, ...]:
    """Return the points on a front, numbered from the fastest frame on.

    luck   the optimism to subtract from each rate
    names  of the elements of a choice
    training  of a choice
    joints    the names of its joints, if not all or none
    """
    fronts = _fronts(several, latencies)
    ordered = sorted(several, key=lambda design: (design.frame.us, design.n_switches))
    found = [(design, kind) for design in ordered for kind in POLICIES if fronts[design, kind]]
    return tuple(
        _point(
            number,
            design,
            kind,
            latencies[design, kind],
            luck[design.judged],
            fronts[design, kind],
            tuple(names(design.close.screened.choice)),
            training(design.close.screened.choice),
            tuple(joints(design.close.screened.choice)),
        )
        for number, (design, kind) in enumerate(found, 1)
    )


def _fronts(several: Sequence[Design], latencies: Latencies) -> dict[tuple[Design, DecisionKind], tuple[str, ...]]:
    found: dict[tuple[Design, DecisionKind], tuple[str, ...]] = dict.fromkeys(latencies, ())
    for name, best in zip(("frame", "switches"), best_designs(several), strict=True):
        for design in best:
            found[design, "single"] += (name,)
    for kind in POLICIES:
        waits = {design: latencies[design, kind].mean_us for design in several}
        for design in front(list(waits), waits.__getitem__, lambda design: design.rate):
            found[design, kind] += ("latency",)
    return found


def corrected(rate: Rate, luck: float) -> Rate:
    """Return the rate of a selected point, corrected for selection. The upper end of its interval stays: the optimism
    is an estimate, and models trained on all rows do a little better than those of the folds.
    """
    return replace(rate, mean=max(rate.mean - luck, 0.0), low=max(rate.low - luck, 0.0))


def _trained(training: Training) -> dict[str, Any]:
    """Return the `PointSetting` fields of the trainer, except for rounds."""
    usual = {setting.name: setting.default for setting in TRAINERS.named(training.trainer).settings}
    own = {name: value for name, value in training.settings.items() if value not in (usual[name], None)}
    # msgspec omits a name that equals the default only if it is the very same string.
    return {"trainer": sys.intern(training.trainer), "max_bins": own.pop("max_bins", None), "settings": own}


def _point(
    number: int,
    design: Design,
    kind: DecisionKind,
    latency: Latency,
    luck: float,
    fronts: tuple[str, ...],
    names: tuple[str, ...],
    training: Training,
    joints: tuple[str, ...],
) -> FrontierPoint:
    wired, tabled, close = design.wired, design.tables.tabled, design.close
    choice = close.screened.choice
    return FrontierPoint(
        number=number,
        setting=PointSetting(
            placement=choice.placement,
            inputs=choice.inputs,
            rounds=tabled.rounds if TRAINERS.named(training.trainer).staged else None,
            width=tabled.shape.width,
            decision=kind,
            wiring="" if wired is None else wired.wiring,
            clock_hz=0 if wired is None else wired.clock_hz,
            table_bits=tabled.shape.table_bits,
            keep_joints=choice.keep_joints,
            levels=choice.levels,
            **_trained(training),
        ),
        switches=names,
        rate=corrected(design.judged.rate, luck),
        luck=luck,
        frames=close.frames.get(tabled),
        other_rate=close.other.get(tabled),
        scan=design.scan,
        transfer=design.transfer,
        classify=design.classify,
        frame=design.frame,
        latency=latency,
        flash=design.classified.flash,
        ram=design.classified.ram,
        ports=0 if wired is None else wired.scan.ports,
        chips=0 if wired is None else wired.scan.chips,
        compile_s=round(close.choosing_s + design.tables.seconds, 2),
        fronts=fronts,
        joints=joints,
    )

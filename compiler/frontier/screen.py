"""Screening: train every placement once, on the folds of one repeat, and price it in the fastest of its wirings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..placement.elements import Elements
from ..placement.methods.base import METHODS
from .points import Curve
from .price import Tabled, price
from .search import JOINTS, NO_SWITCHES, Candidate, Shape, available_inputs, curve_placements, tried_placements
from .survey import Survey, TrialAccuracy

# The frame time hardly depends on the numbers of rounds and rows: tables of few suffice.
_TABLED = Tabled(12, Shape(16))
_FEW_ROWS = 1000


@dataclass(frozen=True, slots=True)
class Screened:
    """A choice after screening: its elements when chosen from all rows, its rate, its frame time (us)."""

    choice: Candidate
    elements: Elements
    judged: TrialAccuracy
    frame_us: float

    @property
    def mean(self) -> float:
        """The rate."""
        return self.judged.rate.mean


def screen(survey: Survey) -> tuple[tuple[Screened, ...], tuple[Curve, ...]]:
    """Return the accuracy and frame time of every choice that can be built, with the first trainer; and the curves of
    all methods, including the baselines.
    """
    search, cuts, sizes = survey.search, survey.cuts, {most: survey.size(most) for most in survey.levels}
    inputs, first = available_inputs(sizes[survey.levels[-1]], survey.n_joints), search.trainers[0]
    every = [
        (choice, most)
        for most, size in sizes.items()
        for name in search.methods
        for choice in tried_placements(name, size)
    ]
    choices = [
        Candidate(choice, kind, first, levels=most)
        for kind in inputs
        for choice, most in (every if kind != "joints" else ((NO_SWITCHES, None),))
    ]
    baselines = [
        Candidate(choice, "switches", first, levels=survey.levels[-1])
        for name in search.baselines
        for choice in curve_placements(name, sizes[survey.levels[-1]])
    ]
    survey.choose(choices, (cuts.everything, *cuts.screening))
    # Drop placements that keep nothing.
    choices = [one for one in choices if one.placement == NO_SWITCHES or survey.elements(one)]
    survey.choose(baselines, cuts.screening)
    rates = _rates(survey, choices, baselines)
    names = dict.fromkeys([*search.methods, *search.baselines])
    curves = tuple(_curve(survey, name, rates) for name in names if "switches" in inputs)
    return _screened(survey, choices, rates), curves


def screen_fewer(survey: Survey, worth: Sequence[Screened]) -> tuple[Screened, ...]:
    """Return those `worth` it, screened with fewer joints, if joints take time."""
    cuts, sizes = survey.cuts, [size for size in JOINTS if size < survey.n_joints]
    mine = [one.choice for one in worth if one.choice.joints] if survey.equipment.records.each_us else []
    choices = [replace(choice, keep_joints=size) for choice in mine for size in sizes]
    survey.choose_joints(choices, (cuts.everything, *cuts.screening))
    return _screened(survey, choices, _rates(survey, choices))


def screen_others(survey: Survey, worth: Sequence[Screened]) -> tuple[Screened, ...]:
    """Return those `worth` it, screened with each of the other trainers."""
    choices = [replace(one.choice, trainer=name) for name in survey.search.trainers[1:] for one in worth]
    return _screened(survey, choices, _rates(survey, choices))


def _rates(
    survey: Survey, choices: Sequence[Candidate], baselines: Sequence[Candidate] = ()
) -> dict[Candidate, TrialAccuracy]:
    """Return the rates of choices and baselines; baselines choose within the folds only and tune nothing."""
    search, cuts, every = survey.search, survey.cuts, [*choices, *baselines]
    survey.tune(survey.typical(choices), (cuts.everything, *cuts.screening))
    rounds = {name: search.alone(name).screened for name in search.trainers}
    fits = survey.fit(every, cuts.screening, lambda one: ((rounds[one.trainer],), ()))
    return {one: cuts.judged(cuts.by, {fold: fits[one, fold].stages[-1] for fold in cuts.screening}) for one in every}


def _screened(
    survey: Survey, choices: Sequence[Candidate], rates: Mapping[Candidate, TrialAccuracy]
) -> tuple[Screened, ...]:
    """Return the choices that can be built."""
    rows = len(survey.samples.labels)
    few = np.linspace(0, rows - 1, min(_FEW_ROWS, rows)).astype(np.intp)
    calls = []
    for choice in choices:
        names, training = survey.names(choice), survey.training(choice)
        calls.append(
            (survey.samples, names, few, survey.selection(choice), (_TABLED,), training, survey.equipment, False)
        )
    found = []
    for choice, (priced,) in zip(choices, survey.cache.ask(price, calls), strict=True):
        us = priced.fastest_us(survey.transfer(choice).us)
        if us is not None and (priced.wired or choice.placement == NO_SWITCHES):
            found.append(Screened(choice, survey.elements(choice), rates[choice], us))
    return tuple(found)


def _curve(survey: Survey, name: str, rates: dict[Candidate, TrialAccuracy]) -> Curve:
    """Return a method's rates by the mean number of switches that it kept in the folds, switches alone."""
    folds, points = survey.cuts.screening, {}
    for choice, judged in rates.items():
        if (choice.placement.method, choice.inputs, choice.levels) == (name, "switches", survey.levels[-1]):
            points[sum(len(survey.elements(choice, fold)) for fold in folds) / len(folds)] = judged.rate
    sizes = tuple(sorted(points))
    return Curve(name, METHODS[name].help, METHODS[name].ours, sizes, tuple(points[size] for size in sizes))

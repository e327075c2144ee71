"""Screening: train every placement once, on the folds of one repeat, and price it in the fastest of its wirings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from thenar.runtime.recipe import Recipe

from ..placement.elements import Elements
from ..placement.methods.base import METHODS
from .points import Curve
from .search import CURVE_SIZES, JOINTS, available_inputs, candidates, placed, tabled
from .survey import Survey, TrialAccuracy

# The frame time hardly depends on the numbers of rounds and rows: tables of few suffice.
_ROUNDS, _FEW_ROWS = 12, 1000


@dataclass(frozen=True, slots=True)
class Screened:
    """A choice after screening: its elements when chosen from all rows, its rate, its frame time (us)."""

    choice: Recipe
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
    first, most = search.trainers[0], survey.levels[-1]
    inputs = available_inputs(sizes[most], survey.n_joints)
    choices: list[Recipe] = []
    for kind in inputs:
        if kind == "joints":
            choices.append(Recipe(trainer=first, inputs=kind))
            continue
        for levels, size in sizes.items():
            for name in search.methods:
                choices += candidates(name, size, first, kind, levels)
    baselines = [
        placed(name, size, first, "switches", most)
        for name in search.baselines
        for size in CURVE_SIZES
        if size <= sizes[most]
    ]
    survey.choose(choices, (cuts.everything, *cuts.screening))
    # Drop placements that keep nothing.
    choices = [one for one in choices if one.inputs == "joints" or survey.elements(one)]
    survey.choose(baselines, cuts.screening)
    rates = _rates(survey, choices, baselines)
    names = dict.fromkeys([*search.methods, *search.baselines])
    curves = tuple(_curve(survey, name, rates) for name in names if "switches" in inputs)
    return _screened(survey, choices, rates), curves


def screen_fewer(survey: Survey, worth: Sequence[Screened]) -> tuple[Screened, ...]:
    """Return those `worth` it, screened with fewer joints, if joints take time."""
    cuts, sizes = survey.cuts, [size for size in JOINTS if size < survey.n_joints]
    mine = [one.choice for one in worth] if survey.equipment.records.each_us else []
    choices = [replace(choice, keep_joints=size) for choice in mine for size in sizes]
    survey.choose_joints(choices, (cuts.everything, *cuts.screening))
    return _screened(survey, choices, _rates(survey, choices))


def screen_others(survey: Survey, worth: Sequence[Screened]) -> tuple[Screened, ...]:
    """Return those `worth` it, screened with each of the other trainers."""
    choices = [replace(one.choice, trainer=name) for name in survey.search.trainers[1:] for one in worth]
    return _screened(survey, choices, _rates(survey, choices))


def _rates(survey: Survey, choices: Sequence[Recipe], baselines: Sequence[Recipe] = ()) -> dict[Recipe, TrialAccuracy]:
    """Return the rates of choices and baselines; baselines choose within the folds only and tune nothing."""
    search, cuts, every = survey.search, survey.cuts, [*choices, *baselines]
    survey.tune(survey.typical(choices), (cuts.everything, *cuts.screening))
    rounds = {name: search.alone(name).screened for name in search.trainers}
    fits = survey.fit(every, cuts.screening, lambda one: ((rounds[one.trainer],), ()))
    return {one: cuts.judged(cuts.by, {fold: fits[one, fold].stages[-1] for fold in cuts.screening}) for one in every}


def _screened(survey: Survey, choices: Sequence[Recipe], rates: Mapping[Recipe, TrialAccuracy]) -> tuple[Screened, ...]:
    """Return the choices that can be built."""
    rows = len(survey.samples.labels)
    few = np.linspace(0, rows - 1, min(_FEW_ROWS, rows)).astype(np.intp)
    prices = survey.prices([(choice, (tabled(choice, _ROUNDS),)) for choice in choices], few)
    found = []
    for choice, (priced,) in zip(choices, prices, strict=True):
        us = priced.fastest_us(survey.transfer(choice).us)
        if us is not None and (priced.scans or choice.inputs == "joints"):
            found.append(Screened(choice, survey.elements(choice), rates[choice], us))
    return tuple(found)


def _curve(survey: Survey, name: str, rates: Mapping[Recipe, TrialAccuracy]) -> Curve:
    """Return a method's rates by the mean number of switches that it kept in the folds, switches alone."""
    folds, points = survey.cuts.screening, {}
    for choice, judged in rates.items():
        if (choice.placement, choice.inputs, choice.levels) == (name, "switches", survey.levels[-1]):
            points[sum(len(survey.elements(choice, fold)) for fold in folds) / len(folds)] = judged.rate
    sizes = tuple(sorted(points))
    return Curve(name, METHODS[name].help, METHODS[name].ours, sizes, tuple(points[size] for size in sizes))

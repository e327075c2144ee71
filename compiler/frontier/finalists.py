"""From recipes to finalists: screen every placement, select those worth full evaluation, and evaluate all their rounds
and tables in all folds.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from math import log

import numpy as np
from msgspec.structs import replace as changed_to

from thenar.runtime.recipe import Inputs, Recipe

from ..evaluation.folds import Fold
from ..evaluation.rates import Rate
from ..placement.elements import Elements
from ..placement.methods.base import BEST, METHODS, PAPERS
from .points import STEP, By, ReferencePoint, front
from .price import PricedTables
from .search import JOINTS, PAPERS_ROUNDS, SHAPES, Search, placed, tabled
from .survey import FoldHits, Survey, TrialAccuracy

# The inputs that need a placement; without joints, only the second.
ALL_INPUTS: tuple[Inputs, ...] = ("both", "switches")
# Screening: the frame time hardly depends on the numbers of rounds and rows, so tables of few suffice.
_ROUNDS, _FEW_ROWS = 12, 1000
# The paper's S.
_PAPERS = 62

# Share of the best accuracy; the least gain that counts on a front of screened rates; the threshold of a tie.
_USEFUL, _STEP, _LEVEL = 0.75, 0.003, 0.005
# The share of errors below which differences do not count: too small for a screening of some hundred rows.
_FEWEST = 0.002


@dataclass(frozen=True, slots=True)
class Screened:
    """A recipe after screening: its elements when chosen from all rows, its rate, its frame time (us)."""

    recipe: Recipe
    elements: Elements
    judged: TrialAccuracy
    frame_us: float

    @property
    def mean(self) -> float:
        """The rate."""
        return self.judged.rate.mean

    @property
    def size(self) -> int:
        """The number of its elements, or of its sensors if it was chosen by these."""
        return self.recipe.sensors or len(self.elements)


@dataclass(frozen=True, slots=True, eq=False)
class EvaluatedFinalist:
    """A finalist: its evaluation after every stage (by the ensemble) and with each of the tables; with the same tables,
    its accuracy on single frames (none: a trial has one), and on trials in the other folds (none: only one subject);
    the costs of the tables worth building. The tables are those of recipes with rounds and a shape.
    """

    screened: Screened
    stages: dict[int, Rate]
    tables: dict[Recipe, TrialAccuracy]
    frames: dict[Recipe, Rate]
    other: dict[Recipe, Rate]
    priced: tuple[PricedTables, ...]


def screen(survey: Survey) -> tuple[Screened, ...]:
    """Train every placement once, on the folds of one repeat, and price it in the fastest of its wirings.

    Return the accuracy and frame time of every recipe that can be built, with the first trainer.
    """
    search, cuts, trainer = survey.search, survey.cuts, survey.search.trainers[0]
    if search.by_sensors:
        return _screened_sensors(survey, trainer)
    sizes = {levels: survey.size(levels) for levels in survey.levels}
    kinds = ALL_INPUTS if survey.inputs.n_joints else ALL_INPUTS[1:]
    recipes = [
        placed(method, number, trainer, inputs, levels)
        for inputs in kinds
        for levels, n_elements in sizes.items()
        if n_elements
        for method in search.methods
        for number in METHODS[method].ladder(n_elements)
    ]
    survey.choose(recipes, (cuts.everything, *cuts.screening))
    # Drop placements that keep nothing. Joints alone need no placement.
    recipes = [recipe for recipe in recipes if survey.elements(recipe)]
    recipes += [Recipe(trainer=trainer, inputs="joints")] if survey.inputs.n_joints else []
    survey.tune(recipes, (cuts.everything, *cuts.screening))
    return _screened(survey, recipes, _rates(survey, recipes))


def _screened_sensors(survey: Survey, trainer: str) -> tuple[Screened, ...]:
    """Return the best sensors of each number that is tried, screened."""
    folds = (survey.cuts.everything, *survey.cuts.screening)
    every = Recipe(sensors=survey.search.sensors, price=survey.search.price, trainer=trainer)
    numbers = survey.search.numbers(survey.size_of(every))
    recipes = [changed_to(every, sensors=number, levels=levels) for levels in survey.levels for number in numbers]
    survey.choose(recipes, folds)
    recipes = [recipe for recipe in recipes if survey.size_of(recipe) == recipe.sensors]
    survey.tune(recipes, folds)
    return _screened(survey, recipes, _rates(survey, recipes))


def screen_fewer(survey: Survey, screened: Sequence[Screened]) -> tuple[Screened, ...]:
    """Return the same recipes, screened with fewer joints, if joints take time."""
    # Joints that take no time are all read.
    most = survey.inputs.n_joints if survey.equipment.records.each_us else 0
    numbers = [number for number in JOINTS if number < most and not survey.search.by_sensors]
    recipes = [changed_to(one.recipe, keep_joints=number) for one in screened for number in numbers]
    survey.choose_joints(recipes, (survey.cuts.everything, *survey.cuts.screening))
    survey.tune(recipes, (survey.cuts.everything, *survey.cuts.screening))
    return _screened(survey, recipes, _rates(survey, recipes))


def screen_others(survey: Survey, screened: Sequence[Screened]) -> tuple[Screened, ...]:
    """Return the same recipes, screened with each of the other trainers."""
    recipes = [changed_to(one.recipe, trainer=name) for name in survey.search.trainers[1:] for one in screened]
    survey.tune(recipes, (survey.cuts.everything, *survey.cuts.screening))
    return _screened(survey, recipes, _rates(survey, recipes))


def _rates(survey: Survey, recipes: Sequence[Recipe]) -> dict[Recipe, TrialAccuracy]:
    """Return the rates of recipes that were tuned before, after the rounds of screening."""
    cuts = survey.cuts
    rounds = {name: survey.search.alone(name).screened for name in survey.search.trainers}
    fits = survey.fit(recipes, cuts.screening, lambda recipe: ((rounds[recipe.trainer],), ()))
    return {
        recipe: cuts.judged(cuts.by, {fold: fits[recipe, fold].stages[-1] for fold in cuts.screening})
        for recipe in recipes
    }


def _screened(survey: Survey, recipes: Sequence[Recipe], rates: Mapping[Recipe, TrialAccuracy]) -> tuple[Screened, ...]:
    """Return the recipes that can be built."""
    most = len(survey.samples.labels)
    rows = np.linspace(0, most - 1, min(_FEW_ROWS, most)).astype(np.intp)
    prices = survey.prices({recipe: (tabled(recipe, _ROUNDS),) for recipe in recipes}, rows)
    screened = []
    for recipe, (priced,) in prices.items():
        us = priced.fastest_us(survey.transfer(recipe).us)
        if us is not None and (priced.scans or not survey.elements(recipe)):
            screened.append(Screened(recipe, survey.elements(recipe), rates[recipe], us))
    return tuple(screened)


def select_finalists(screened: Sequence[Screened], recipes: Collection[Recipe], number: int) -> tuple[Screened, ...]:
    """Return at most `number` of `screened`, in their order, plus those of certain recipes.

    They are on a front of accuracy against frame time or, among the same inputs, against the number of switches, and
    are distributed evenly among the kinds of inputs. Of each kind, take the best, then the smallest that ties with it,
    then repeatedly the one whose error rate and frame time differ most from all chosen ones. Choices of the same inputs
    and switches count once; those with less than three quarters of the best accuracy are dropped.
    """
    enough = _USEFUL * max((one.mean for one in screened), default=0.0)
    first = {}
    for one in reversed(screened):
        rest = changed_to(one.recipe, placement=PAPERS, keep=None, prune=0)
        first[rest, *sorted(one.elements)] = one
    best = _fronts([one for one in reversed(first.values()) if one.mean >= enough])
    kinds = dict.fromkeys(one.recipe.inputs for one in best)
    queues = [_spread([one for one in best if one.recipe.inputs == kind]) for kind in kinds]
    turns = [one for turn in zip_longest(*queues) for one in turn if one is not None]
    chosen = {id(one) for one in turns[:number]} | {id(one) for one in screened if one.recipe in recipes}
    return tuple(one for one in screened if id(one) in chosen)


def _fronts(screened: Sequence[Screened]) -> list[Screened]:
    """Return the recipes on a front, in its order."""
    best = front(screened, lambda one: one.frame_us, lambda one: one.mean, _STEP)
    for kind in dict.fromkeys(one.recipe.inputs for one in screened):
        pool = [one for one in screened if one.recipe.inputs == kind]
        best += front(pool, lambda one: one.size, lambda one: one.mean, _STEP)
    known = {id(one) for one in best}
    return [one for one in screened if id(one) in known]


def _spread(pool: list[Screened]) -> list[Screened]:
    """Return the one or more of a pool in the order in which they merit full evaluation."""
    best = max(pool, key=lambda one: one.mean)
    level = [one for one in pool if one.mean >= best.mean - _LEVEL]
    order = list(dict.fromkeys([best, min(level, key=lambda one: one.size)]))
    left = [one for one in pool if one not in order]
    while left:
        order.append(max(left, key=lambda one: min(_distance(one, known) for known in order)))
        left.remove(order[-1])
    return order


def _distance(one: Screened, other: Screened) -> float:
    """Return how far error rates and frame times differ: halving either is the same distance everywhere."""
    errors, other_errors = (log(1.0 - screened.mean + _FEWEST) for screened in (one, other))
    return abs(errors - other_errors) + abs(log(one.frame_us / other.frame_us))


def evaluate_finalists(survey: Survey, chosen: Sequence[Screened]) -> tuple[EvaluatedFinalist, ...]:
    """Return the finalists with all evaluations, trained to the last round in all folds."""
    recipes = [one.recipe for one in chosen]
    searches = {recipe: survey.search.alone(recipe.trainer) for recipe in recipes}
    survey.choose(recipes, survey.cuts.others)
    survey.choose_joints(recipes, survey.cuts.others)
    survey.tune(recipes, survey.cuts.others)
    folds = (*survey.cuts.screening, *survey.cuts.others)
    fits = survey.fit(recipes, folds, lambda recipe: (searches[recipe].stages, searches[recipe].tabled))
    finalists, tables = [], {}
    for one in chosen:
        of_folds = {fold: fit for (recipe, fold), fit in fits.items() if recipe == one.recipe}
        finalist = _evaluated(survey, one, searches[one.recipe], of_folds)
        papers = papers_tables(one.recipe, searches[one.recipe])
        tables[one.recipe] = tuple(dict.fromkeys([*worthwhile(finalist.tables), papers]))
        finalists.append(finalist)
    prices = survey.prices(tables, survey.cuts.everything.train, lost=True)
    return tuple(replace(finalist, priced=prices[finalist.screened.recipe]) for finalist in finalists)


def recipes_to_mark(survey: Survey) -> dict[Recipe, str]:
    """Return the recipes to mark, with their names: the paper's placement and all switches, alone and with the joints;
    with the most levels of each taxel.
    """
    if survey.search.by_sensors:
        return {}
    trainer, levels = survey.search.trainers[0], survey.levels[-1]
    n_elements = survey.size(levels)
    # Keeping all switches is the same by any method.
    marked = ((PAPERS, _PAPERS, f"paper, S = {_PAPERS}"), (BEST, n_elements, f"all of {n_elements}"))
    kinds: dict[Inputs, str] = {"switches": "", "both": ", joints"} if survey.inputs.n_joints else {"switches": ""}
    return {
        placed(method, number, trainer, inputs, levels): f"{name}{joints}"
        for inputs, joints in kinds.items()
        for method, number, name in marked
        if n_elements
    }


def marks_of(
    recipes: Mapping[Recipe, str], finalists: Sequence[EvaluatedFinalist], survey: Survey
) -> tuple[ReferencePoint, ...]:
    """Return the marks of those recipes that were fully evaluated, with the paper's rounds."""
    marks = []
    for finalist in finalists:
        recipe, size = finalist.screened.recipe, len(finalist.screened.elements)
        if recipe in recipes:
            full = papers_tables(recipe, survey.search)
            priced = next(tables for tables in finalist.priced if tables.recipe == full)
            us = priced.fastest_us(survey.transfer(recipe).us)
            if us is not None:
                marks.append(ReferencePoint(recipes[recipe], size, finalist.tables[full].rate, us))
    return tuple(marks)


def papers_tables(recipe: Recipe, search: Search) -> Recipe:
    """Return a recipe with tables like the paper's: of at most its hundred rounds, at the required width."""
    return tabled(recipe, max(rounds for rounds in search.tabled if rounds <= min(search.rounds, PAPERS_ROUNDS)))


def worthwhile(tables: Mapping[Recipe, TrialAccuracy]) -> tuple[Recipe, ...]:
    """Return, for each shape, the tables of the fewest rounds that reach that shape's best accuracy."""
    alike: dict[Recipe, list[Recipe]] = {}
    for recipe in tables:
        alike.setdefault(changed_to(recipe, rounds=None), []).append(recipe)
    fewest = []
    for recipes in alike.values():
        best = max(tables[recipe].rate.mean for recipe in recipes)
        level = [recipe for recipe in recipes if tables[recipe].rate.mean >= best - STEP]
        fewest.append(min(level, key=lambda recipe: recipe.rounds or 1))
    return tuple(fewest)


def _evaluated(survey: Survey, screened: Screened, search: Search, fits: Mapping[Fold, FoldHits]) -> EvaluatedFinalist:
    """Return a finalist by its fits in all folds, trained for the stages of a search; nothing is priced yet."""
    cuts = survey.cuts
    places = {
        tabled(screened.recipe, rounds, shape): (row, column)
        for row, rounds in enumerate(search.tabled)
        for column, shape in enumerate(SHAPES)
    }

    def tables(by: By) -> dict[Recipe, TrialAccuracy]:
        return {
            full: cuts.judged(by, {fold: fit.tables[row][column] for fold, fit in fits.items()})
            for full, (row, column) in places.items()
        }

    stages = {
        stage: cuts.judged(cuts.by, {fold: fit.stages[number] for fold, fit in fits.items()}).rate
        for number, stage in enumerate(search.stages)
    }
    frames = {
        full: cuts.judged(cuts.by, {fold: fit.frames[row][column] for fold, fit in fits.items()}, "frames").rate
        for full, (row, column) in (places.items() if len(cuts.people) < len(cuts.trials) else ())
    }
    other = {} if cuts.other is None else {full: judged.rate for full, judged in tables(cuts.other).items()}
    return EvaluatedFinalist(screened, stages, tables(cuts.by), frames, other, priced=())

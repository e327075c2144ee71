"""Finalists: select the placements worth full evaluation, and evaluate all their rounds and tables in all folds."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from math import log

from msgspec.structs import replace as changed_to

from thenar.runtime.recipe import Inputs, Recipe

from ..evaluation.folds import Fold
from ..evaluation.rates import Rate
from ..placement.methods.base import BEST, PAPERS
from .points import STEP, By, ReferencePoint, front
from .price import PricedTables
from .screen import Screened
from .search import SHAPES, Search, placed, tabled
from .survey import Cuts, FoldHits, Survey, TrialAccuracy

# The paper's S.
_PAPERS = 62

# Share of the best accuracy; the least gain that counts on a front of screened rates; the threshold of a tie.
_USEFUL, _STEP, _LEVEL = 0.75, 0.003, 0.005
# The share of errors below which differences do not count: too small for a screening of some hundred rows.
_FEWEST = 0.002
# The share of the rows that more rounds than the paper's must win in the first repeat.
_DEEPER = 0.002


@dataclass(frozen=True, slots=True, eq=False)
class EvaluatedFinalist:
    """A finalist: its evaluation after every stage (by the ensemble) and with each of the tables; with the same tables,
    its accuracy on single frames (none: a trial has one), and on trials in the other folds (none: only one subject);
    the costs of the tables worth building. The tables are those of recipes.
    """

    screened: Screened
    stages: dict[int, Rate]
    tables: dict[Recipe, TrialAccuracy]
    frames: dict[Recipe, Rate]
    other: dict[Recipe, Rate]
    priced: tuple[PricedTables, ...]


def finalists(screened: Sequence[Screened], wanted: Collection[Recipe], most: int) -> tuple[Screened, ...]:
    """Return at most `most` of `screened`, in their order, plus the `wanted` ones.

    They are on a front of accuracy against frame time or, among the same inputs, against the number of switches, and
    are distributed evenly among the kinds of inputs. Of each kind, take the best, then the smallest that ties with it,
    then repeatedly the one whose error rate and frame time differ most from all chosen ones. Choices of the same inputs
    and switches count once; those with less than three quarters of the best accuracy are dropped.
    """
    enough = _USEFUL * max((one.mean for one in screened), default=0.0)
    useful = [one for one in _different(screened) if one.mean >= enough]
    pool = _fronts(useful)
    queues = [_spread([one for one in pool if one.choice.inputs == kind]) for kind in _kinds(pool)]
    turns = [one for turn in zip_longest(*queues) for one in turn if one is not None]
    chosen = {id(one) for one in turns[:most]} | {id(one) for one in screened if one.choice in wanted}
    return tuple(one for one in screened if id(one) in chosen)


def _kinds(screened: Sequence[Screened]) -> list[Inputs]:
    return list(dict.fromkeys(one.choice.inputs for one in screened))


def _fronts(screened: Sequence[Screened]) -> list[Screened]:
    """Return the choices on a front, in its order."""
    found = front(screened, lambda one: one.frame_us, lambda one: one.mean, _STEP)
    for kind in _kinds(screened):
        mine = [one for one in screened if one.choice.inputs == kind]
        found += front(mine, lambda one: len(one.elements), lambda one: one.mean, _STEP)
    known = {id(one) for one in found}
    return [one for one in screened if id(one) in known]


def _spread(mine: list[Screened]) -> list[Screened]:
    """Return all of `mine`, in the order in which they merit full evaluation."""
    if not mine:
        return []
    best = max(mine, key=lambda one: one.mean)
    level = [one for one in mine if one.mean >= best.mean - _LEVEL]
    order = list(dict.fromkeys([best, min(level, key=lambda one: len(one.elements))]))
    left = [one for one in mine if one not in order]
    while left:
        order.append(max(left, key=lambda one: min(_distance(one, known) for known in order)))
        left.remove(order[-1])
    return order


def _distance(one: Screened, other: Screened) -> float:
    return abs(_errors(one) - _errors(other)) + abs(log(one.frame_us / other.frame_us))


def _errors(one: Screened) -> float:
    """Return the error rate on a scale on which halving it is the same distance everywhere."""
    return log(1.0 - one.mean + _FEWEST)


def _different(screened: Sequence[Screened]) -> list[Screened]:
    """Return the first of those that keep the same inputs."""
    first = {}
    for one in reversed(screened):
        rest = changed_to(one.choice, placement=PAPERS, keep=None, prune=0)
        first[rest, *sorted(one.elements)] = one
    return list(first.values())[::-1]


def evaluate_finalists(survey: Survey, chosen: Sequence[Screened]) -> tuple[EvaluatedFinalist, ...]:
    """Return the finalists with all evaluations.

    All are trained to the last round in the folds of the first repeat. In the others, those that gain nothing by more
    rounds than the paper's hundred are trained for these alone.
    """
    cuts, choices = survey.cuts, [one.choice for one in chosen]
    searches = {choice: survey.search.alone(choice.trainer) for choice in choices}
    typical = survey.typical(choices)
    survey.choose(choices, cuts.others)
    survey.choose_joints(choices, cuts.others)
    survey.tune(typical, cuts.others)
    fits = survey.fit(choices, cuts.screening, lambda one: (searches[one].stages, searches[one].tabled))
    rows = len(cuts.trials)
    depths = {one: depth_of(searches[one], [fits[one, fold] for fold in cuts.screening], rows) for one in choices}
    fits |= survey.fit(choices, cuts.others, lambda one: (depths[one].stages, depths[one].tabled))
    judged = {
        choice: _judged(cuts, choice, depth, {fold: fits[choice, fold] for fold in (*cuts.screening, *cuts.others)})
        for choice, depth in depths.items()
    }
    worth = [
        (choice, tuple(dict.fromkeys([*worthwhile(judged[choice][1]), papers_tables(choice, searches[choice])])))
        for choice in choices
    ]
    prices = survey.prices(worth, cuts.everything.train, lost=True)
    return tuple(
        EvaluatedFinalist(one, *judged[one.choice], priced) for one, priced in zip(chosen, prices, strict=True)
    )


def choices_to_mark(n_elements: int, n_joints: int, trainer: str, levels: int | None = None) -> dict[Recipe, str]:
    """Return the choices to mark, with their names: the paper's placement and all switches, alone and with the joints;
    with `levels` levels of each taxel.
    """
    # Keeping all switches is the same by any method.
    marked = ((PAPERS, _PAPERS, f"paper, S = {_PAPERS}"), (BEST, n_elements, f"all of {n_elements}"))
    kinds: dict[Inputs, str] = {"switches": "", "both": ", joints"} if n_joints else {"switches": ""}
    return {
        placed(method, number, trainer, inputs, levels): f"{name}{joints}"
        for inputs, joints in kinds.items()
        for method, number, name in marked
        if n_elements
    }


def marks_of(
    named: Mapping[Recipe, str], closes: Sequence[EvaluatedFinalist], survey: Survey
) -> tuple[ReferencePoint, ...]:
    """Return the marks of those choices that were fully evaluated, with the paper's rounds."""
    found = []
    for close in closes:
        choice, size = close.screened.choice, len(close.screened.elements)
        if choice in named:
            recipe = papers_tables(choice, survey.search)
            priced = next(tables for tables in close.priced if tables.recipe == recipe)
            us = priced.fastest_us(survey.transfer(choice).us)
            if us is not None:
                found.append(ReferencePoint(named[choice], size, close.tables[recipe].rate, us))
    return tuple(found)


def papers_tables(choice: Recipe, search: Search) -> Recipe:
    """Return the recipe of a choice with tables like the paper's: of its hundred rounds, at the required width."""
    return tabled(choice, papers_depth(search).tabled[-1])


def papers_depth(search: Search) -> Search:
    """Return the same search, limited to the paper's hundred rounds."""
    return replace(search, rounds=min(100, search.rounds))


def depth_of(search: Search, fits: Sequence[FoldHits], rows: int) -> Search:
    """Return the search with the rounds worth training, by the folds of the first repeat, of `rows` rows."""
    few = papers_depth(search)
    correct = [
        sum(int.from_bytes(fit.stages[number]).bit_count() for fit in fits) for number in range(len(search.stages))
    ]
    gained = max(correct) - max(correct[: len(few.stages)])
    return search if gained > _DEEPER * rows else few


def worthwhile(tables: Mapping[Recipe, TrialAccuracy]) -> tuple[Recipe, ...]:
    """Return, for each shape, the tables of the fewest rounds that reach that shape's best accuracy."""
    alike: dict[Recipe, list[Recipe]] = {}
    for recipe in tables:
        alike.setdefault(changed_to(recipe, rounds=None), []).append(recipe)
    found = []
    for mine in alike.values():
        best = max(tables[recipe].rate.mean for recipe in mine)
        level = [recipe for recipe in mine if tables[recipe].rate.mean >= best - STEP]
        found.append(min(level, key=lambda recipe: recipe.rounds or 1))
    return tuple(found)


def _judged(
    cuts: Cuts, choice: Recipe, search: Search, fits: Mapping[Fold, FoldHits]
) -> tuple[dict[int, Rate], dict[Recipe, TrialAccuracy], dict[Recipe, Rate], dict[Recipe, Rate]]:
    """Return the rates of an EvaluatedFinalist: after every stage; with each of the tables, by trials and frames; and
    with them in the other folds.
    """
    places = {
        tabled(choice, rounds, shape): (row, column)
        for row, rounds in enumerate(search.tabled)
        for column, shape in enumerate(SHAPES)
    }

    def tables(by: By) -> dict[Recipe, TrialAccuracy]:
        return {
            each: cuts.judged(by, {fold: fit.tables[row][column] for fold, fit in fits.items()})
            for each, (row, column) in places.items()
        }

    stages = {
        stage: cuts.judged(cuts.by, {fold: fit.stages[number] for fold, fit in fits.items()}).rate
        for number, stage in enumerate(search.stages)
    }
    frames = {
        each: cuts.frames({fold: fit.frames[row][column] for fold, fit in fits.items()})
        for each, (row, column) in (places.items() if len(cuts.people) < len(cuts.trials) else ())
    }
    other = {} if cuts.other is None else {each: judged.rate for each, judged in tables(cuts.other).items()}
    return stages, tables(cuts.by), frames, other

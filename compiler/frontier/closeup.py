"""A close look at the finalists: all rounds and shapes of tables, in all folds, each subject left out, and priced."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .candidates import Screened, rate_of
from .equipment import Equipment
from .learnt import Fit
from .pareto import STEP
from .points import Rate
from .pricing import Priced, PriceKey, PriceTask, Tabled, find_prices
from .settings import SHAPES, Search, Shape
from .stages import Learner

# Expected seconds of one core: of training twice, and of the layouts of all tables.
PRICE_S = 4.0
# The share of the rows that more rounds than the paper's have to win in the first repeat.
_DEEPER = 0.002


@dataclass(frozen=True, slots=True, eq=False)
class Close:
    """A finalist: what it recognises after every stage (by the ensemble) and with each of the tables; with a subject
    left out, by the same tables (None: only one subject); what the tables worth building cost; how long choosing its
    switches took.
    """

    screened: Screened
    stages: dict[int, Rate]
    rates: dict[Tabled, Rate]
    left_out: dict[Tabled, Rate] | None
    priced: Priced
    choosing_s: float


def look_closely(
    learner: Learner, search: Search, equipment: Equipment, chosen: Sequence[Screened]
) -> tuple[Close, ...]:
    """Return the finalists with all that is to be known of them.

    All are trained to the last round in the folds of the first repeat; in the others, those that gain nothing by more
    rounds than the paper's hundred are trained for these alone.
    """
    cuts, fold = learner.cuts, learner.cuts.screening[0]
    choices = [one.choice for one in chosen]
    others = [fold for fold in cuts.all if fold not in cuts.screening]
    learner.choose("finalists' placements", choices, others)
    fits = learner.fit("finalists", choices, cuts.screening, search.stages, search.tabled, SHAPES)
    depths = {choice: depth_of(search, [fits[choice, fold] for fold in cuts.screening]) for choice in choices}
    for depth in dict.fromkeys(depths.values()):
        alike = [choice for choice in choices if depths[choice] == depth]
        fits |= learner.fit(further(depth.rounds), alike, others, depth.stages, depth.tabled, SHAPES)
    rated = []
    for one in chosen:
        depth = depths[one.choice]
        repeats = [[fits[one.choice, fold] for fold in folds] for folds in cuts.repeats]
        left_out = [[fits[one.choice, fold] for fold in cuts.subjects]] if cuts.subjects else None
        rates, alone = _tabled(depth, repeats), None if left_out is None else _tabled(depth, left_out)
        rated.append((one, _staged(depth, repeats), rates, alone))
    keys = [
        PriceKey(
            one.columns,
            one.choice.joints,
            _to_price(rates, search),
            learner.max_bins,
            equipment.identity,
            cuts.names[fold],
        )
        for one, _, rates, _ in rated
    ]
    tasks = [PriceTask(key, learner.material, equipment, PRICE_S, fold) for key in keys]
    prices = learner.desk.ask("prices", tasks, find_prices, Priced)
    return tuple(
        Close(
            screened=one,
            stages=stages,
            rates=rates,
            left_out=left_out,
            priced=prices[key],
            choosing_s=learner.choosing_s(one.choice),
        )
        for (one, stages, rates, left_out), key in zip(rated, keys, strict=True)
    )


def papers_tables(search: Search) -> Tabled:
    """Return which tables stand for the paper's: of its hundred rounds, as wide as need be."""
    return Tabled(papers_depth(search).rounds, Shape(16))


def papers_depth(search: Search) -> Search:
    """Return the same search, of no more than the paper's hundred rounds."""
    return replace(search, rounds=min(100, search.rounds))


def further(rounds: int) -> str:
    """Return the name of the stage that trains finalists for so many rounds in all folds but the first repeat's."""
    return f"finalists, {rounds} rounds"


def depth_of(search: Search, fits: Sequence[Fit]) -> Search:
    """Return how far a placement is worth following, by what the folds of the first repeat say."""
    few = papers_depth(search)
    correct = np.sum([fit.correct for fit in fits], axis=0)
    total = sum(fit.total for fit in fits)
    return search if correct.max() > correct[: len(few.stages)].max() + _DEEPER * total else few


def _to_price(rates: dict[Tabled, Rate], search: Search) -> tuple[Tabled, ...]:
    return tuple(dict.fromkeys([*worthwhile(rates), papers_tables(search)]))


def worthwhile(rates: dict[Tabled, Rate]) -> tuple[Tabled, ...]:
    """Return, for each shape, the tables of the fewest rounds that recognise as well as any of that shape."""
    found = []
    for shape in dict.fromkeys(tabled.shape for tabled in rates):
        mine = {tabled: rate.mean for tabled, rate in rates.items() if tabled.shape == shape}
        best = max(mine.values())
        found.append(min((tabled for tabled in mine if mine[tabled] >= best - STEP), key=lambda tabled: tabled.rounds))
    return tuple(found)


def _staged(search: Search, repeats: Sequence[Sequence[Fit]]) -> dict[int, Rate]:
    return {
        stage: _rate(repeats, [[fit.correct[number] for fit in fits] for fits in repeats])
        for number, stage in enumerate(search.stages)
    }


def _tabled(search: Search, repeats: Sequence[Sequence[Fit]]) -> dict[Tabled, Rate]:
    return {
        Tabled(rounds, Shape(*shape)): _rate(repeats, [[fit.deployed[row][column] for fit in fits] for fits in repeats])
        for row, rounds in enumerate(search.tabled)
        for column, shape in enumerate(SHAPES)
    }


def _rate(repeats: Sequence[Sequence[Fit]], correct: Sequence[Sequence[int]]) -> Rate:
    return rate_of(tuple(map(sum, correct)), sum(fit.total for fit in repeats[0]))

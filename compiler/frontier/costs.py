"""The expected cost of a search in seconds of one core, by stage."""

from collections.abc import Sequence

from ..placement.methods.base import METHODS
from .finalists import OTHERS, PRICE_S, papers_depth
from .measure import TRIAL_S
from .screen import FEWER_JOINTS, OTHER_TRAINERS, QUICK_PRICE_S
from .search import JOINTS, Search, available_inputs, curve_placements, tried_placements
from .survey import Survey, fit_s, path_s, settle_s

# Placements to screen with the other trainers, as a multiple of the finalists.
WIDER = 3
# Number of placements to try with fewer joints.
FEWER = 5
# Expected seconds of one core to learn what segments cost, and to play a stream.
LEARNT_S = 5.0
# Empirical: number of marked placements in addition to the finalists; of designs of a finalist on a front; the share of
# distinct placements among those tried.
_MARKED, _DESIGNS, _DIFFERENT = 3, 2, 0.8


def estimated_costs(survey: Survey) -> dict[str, float]:
    """Estimate each stage's cost in seconds of one core before any has begun, so that the time left never grows."""
    search, cuts, sizes = survey.search, survey.cuts, [len(survey.elements(most)) for most in survey.levels]
    rows, simulated = len(survey.samples.labels), survey.equipment.model.part is not None
    kinds = available_inputs(sizes[-1], survey.n_joints)
    wired = len(kinds) - ("joints" in kinds)
    train, more = ([len(fold.train) for fold in folds] for folds in (cuts.screening, cuts.others))
    # Once, or for each of the inputs if a method uses joints.
    several = {name: len(sizes) * (wired if METHODS[name].uses_joints else min(wired, 1)) for name in search.methods}
    methods = [name for name, count in several.items() for _ in range(count)]
    choices = sum(len(tried_placements(name, size)) for name in search.methods for size in sizes) * wired + (
        "joints" in kinds
    )
    baselines = sum(len(curve_placements(name, sizes[-1])) for name in search.baselines)
    trainers = [search.alone(name) for name in search.trainers]
    last, again = min(search.finalists + _MARKED, choices), min(WIDER * search.finalists, choices)
    few = papers_depth(search)
    fewer = min(FEWER, choices) * sum(size < survey.n_joints for size in JOINTS)

    def settling(some: Sequence[Search], sizes: Sequence[int]) -> float:
        open_ones = [each for each in some if len(each.candidates) > 1]
        return len(kinds) * sum(settle_s(each, size) for each in open_ones for size in sizes)

    def screening(some: Sequence[Search]) -> float:
        return sum(fit_s(each, ((each.screened,), ()), size) for each in some for size in train)

    return {
        "placements": sum(path_s(name, n) for name in methods for n in (rows, *train)),
        "baselines": sum(path_s(name, n) for name in search.baselines for n in train) if wired else 0.0,
        "settings": settling(trainers[:1], (rows, *train)),
        f"settings{OTHER_TRAINERS}": settling(trainers[1:], (rows, *train)),
        "finalists' settings": settling(trainers, more),
        "screening": (_DIFFERENT * choices + baselines) * screening(trainers[:1]),
        f"screening{FEWER_JOINTS}": fewer * screening(trainers[:1]),
        f"screening{OTHER_TRAINERS}": again * screening(trainers[1:]),
        "times": _DIFFERENT * choices * QUICK_PRICE_S,
        f"times{OTHER_TRAINERS}": again * len(trainers[1:]) * QUICK_PRICE_S,
        "finalists' placements": sum(path_s(name, n) for name in methods for n in more),
        "finalists": last * sum(fit_s(search, (search.stages, search.tabled), n) for n in train),
        OTHERS: last * sum(fit_s(few, (few.stages, few.tabled), n) for n in more),
        "prices": last * PRICE_S,
        "simulations": last * _DESIGNS * TRIAL_S * simulated,
        "latencies": last * (2.0 + _DESIGNS * (LEARNT_S if survey.grasp_set.is_none.any() else 1.0)),
    }

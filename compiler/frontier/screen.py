"""Screening: every placement at one number of rounds on the folds of one repeat, and in the fastest of its wirings."""

from collections.abc import Sequence
from dataclasses import dataclass

from ..placement.methods.base import METHODS
from ..samples import Columns
from .points import Curve
from .price import Tabled, price
from .search import NO_SWITCHES, Candidate, Shape, available_inputs, curve_ways, ways
from .survey import Judged, Survey

# How long a frame takes hardly depends on how many rounds and rows there were: tables of few tell it.
_TABLED = Tabled(12, Shape(16))
QUICK_PRICE_S = 0.5


@dataclass(frozen=True, slots=True)
class Screened:
    """A choice after screening: its switches when chosen from all rows, its rate, its frame time (us)."""

    choice: Candidate
    columns: Columns
    judged: Judged
    frame_us: float

    @property
    def mean(self) -> float:
        """The rate."""
        return self.judged.rate.mean


def screen(survey: Survey) -> tuple[tuple[Screened, ...], tuple[Curve, ...]]:
    """Return how well and how fast every choice is that may be built, and everybody's curves, rivals' included."""
    search, cuts, n_switches = survey.search, survey.cuts, len(survey.switch_names)
    inputs = available_inputs(n_switches, survey.n_joints)
    every = [way for name in search.methods for way in ways(name, n_switches)]
    choices = [
        Candidate(way, kind, trainer)
        for trainer in search.trainers
        for kind in inputs
        for way in (every if kind != "joints" else (NO_SWITCHES,))
    ]
    first = search.trainers[0]
    rivals = [Candidate(way, "switches", first) for name in search.rivals for way in curve_ways(name, n_switches)]
    survey.choose("placements", choices, (cuts.everything, *cuts.screening))
    # A placement that keeps nothing is none.
    choices = [one for one in choices if one.way == NO_SWITCHES or survey.columns(one, cuts.everything)]
    survey.choose("rivals", rivals, cuts.screening)
    survey.settle("settings", survey.typical(choices), (cuts.everything, *cuts.screening))
    shown = [*choices, *rivals]
    fits = survey.fit("screening", shown, cuts.screening, lambda one: ((search.alone(one.trainer).screened,), ()))
    rates = {}
    for choice in shown:
        rates[choice] = cuts.judged(cuts.by, {fold: fits[choice, fold].stages[-1] for fold in cuts.screening})
    frames = _frames_us(survey, choices)
    screened = tuple(
        Screened(choice, survey.columns(choice, cuts.everything), rate, frames[choice])
        for choice, rate in rates.items()
        if choice in frames
    )
    names = dict.fromkeys([*search.methods, *search.rivals])
    curves = {choice: rate for choice, rate in rates.items() if choice.trainer == first}
    return screened, tuple(_curve(survey, name, curves) for name in names if "switches" in inputs)


def _frames_us(survey: Survey, choices: Sequence[Candidate]) -> dict[Candidate, float]:
    """Return the frame times of the choices that can be built."""
    calls = []
    for choice in choices:
        columns = survey.columns(choice, survey.cuts.everything)
        names = tuple(survey.switch_names[column] for column in columns)
        some, training = survey.inputs(choice.joints, few=True), survey.training(choice)
        calls.append(price.call(QUICK_PRICE_S, some, names, columns, (_TABLED,), training, survey.equipment, None))
    found = {}
    for choice, (priced,) in zip(choices, survey.cache.ask("times", calls), strict=True):
        us = priced.fastest_us(survey.equipment.joints.us if choice.joints else 0.0)
        if us is not None and (priced.wired or choice.way == NO_SWITCHES):
            found[choice] = us
    return found


def _curve(survey: Survey, name: str, rates: dict[Candidate, Judged]) -> Curve:
    """Return a method's rates by the mean number of switches that it kept in the folds, switches alone."""
    folds, points = survey.cuts.screening, {}
    for choice, judged in rates.items():
        if choice.way.method == name and choice.inputs == "switches":
            points[sum(len(survey.columns(choice, fold)) for fold in folds) / len(folds)] = judged.rate
    sizes = tuple(sorted(points))
    return Curve(name, METHODS[name].help, METHODS[name].ours, sizes, tuple(points[size] for size in sizes))

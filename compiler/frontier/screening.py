"""Screening: every placement at one number of rounds on the folds of one repeat, and in the fastest of its wirings."""

from collections.abc import Sequence
from dataclasses import dataclass

from ..placement.methods.base import METHODS
from .candidates import NO_SWITCHES, Choice, Screened, rate_of
from .equipment import Equipment
from .learnt import Fit
from .points import Curve, Way
from .pricing import Priced, PricedTables, PriceKey, PriceTask, Tabled, find_prices
from .settings import Search, Shape, available_inputs, curve_ways, ways
from .stages import Learner
from .timing.scan_times import transfer_us

# How long a frame takes hardly depends on how many rounds there were: tables of few tell it.
_ROUNDS = 12
QUICK_PRICE_S = 0.5


@dataclass(frozen=True, slots=True)
class Screening:
    """What screening found: the choices that may be built, and everybody's curves."""

    screened: tuple[Screened, ...]
    curves: tuple[Curve, ...]


def screen(learner: Learner, search: Search, equipment: Equipment) -> Screening:
    """Return how well and how fast every choice is, and how the rivals do beside ours."""
    material, cuts = learner.material, learner.cuts
    n_switches, n_joints = len(material.switch_names), material.codes.shape[1]
    inputs = available_inputs(n_switches, n_joints)
    choices = [
        Choice(way, kind)
        for kind in inputs
        for way in (_all_ways(search, n_switches) if kind != "joints" else (NO_SWITCHES,))
    ]
    rivals = [Choice(way, "switches") for name in search.rivals for way in curve_ways(name, n_switches)]
    learner.choose("placements", choices, (cuts.everything, *cuts.screening))
    # A placement that keeps nothing is none.
    choices = [one for one in choices if one.way == NO_SWITCHES or learner.columns(one, cuts.everything)]
    learner.choose("rivals", rivals, cuts.screening)
    fits = learner.fit("screening", [*choices, *rivals], cuts.screening, (search.screened,))
    totals = {choice: _total([fits[choice, fold] for fold in cuts.screening]) for choice in [*choices, *rivals]}
    frames = _frames_us(learner, choices, equipment)
    screened = tuple(
        Screened(choice, learner.columns(choice, cuts.everything), rate_of((correct,), total), frames[choice])
        for choice, (correct, total) in totals.items()
        if choice in frames
    )
    names = dict.fromkeys([*search.methods, *search.rivals])
    curves = tuple(_curve(learner, name, totals) for name in names if "switches" in inputs)
    return Screening(screened, curves)


def fastest_us(priced: PricedTables, joints: int) -> float | None:
    """Return the least frame time of tables in any wiring, whole scans; None where nothing fits the target."""
    scans = [wired.scan.full_us for wired in priced.wired]
    if not priced.classified:
        return None
    return max(min(scans, default=0.0), transfer_us(joints)) + priced.classified[0].us


def _all_ways(search: Search, n_switches: int) -> list[Way]:
    return [way for name in search.methods for way in ways(name, n_switches)]


def _total(fits: Sequence[Fit]) -> tuple[int, int]:
    return sum(fit.correct[-1] for fit in fits), sum(fit.total for fit in fits)


def _frames_us(learner: Learner, choices: Sequence[Choice], equipment: Equipment) -> dict[Choice, float]:
    """Return the frame times of the choices that can be built of `equipment`."""
    material = learner.material
    tabled = (Tabled(_ROUNDS, Shape(16)),)
    keys = {
        choice: PriceKey(
            learner.columns(choice, learner.cuts.everything),
            choice.joints,
            tabled,
            learner.max_bins,
            equipment.identity,
        )
        for choice in choices
    }
    tasks = [PriceTask(key, material, equipment, QUICK_PRICE_S) for key in keys.values()]
    prices = learner.desk.ask("times", tasks, find_prices, Priced)
    found = {}
    for choice, key in keys.items():
        priced = prices[key].tables[0]
        us = fastest_us(priced, material.codes.shape[1] if choice.joints else 0)
        if us is not None and (priced.wired or not key.columns):
            found[choice] = us
    return found


def _curve(learner: Learner, name: str, totals: dict[Choice, tuple[int, int]]) -> Curve:
    """Return a method's rates by the mean number of switches that it kept in the folds, switches alone."""
    folds, points = learner.cuts.screening, {}
    for choice, (correct, total) in totals.items():
        if choice.way.method == name and choice.inputs == "switches":
            kept = sum(len(learner.columns(choice, fold)) for fold in folds) / len(folds)
            points[kept] = rate_of((correct,), total)
    sizes = tuple(sorted(points))
    return Curve(name, METHODS[name].help, METHODS[name].ours, sizes, tuple(points[size] for size in sizes))

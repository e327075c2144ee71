"""What a frontier's stages will cost, told before any has begun: so the time that is left does not grow on the way."""

from ..placement.methods.base import METHODS
from .closeup import PRICE_S, further, papers_depth
from .material import Cuts, Material
from .measured import TRIAL_S
from .screening import QUICK_PRICE_S
from .settings import SHAPES, Search, available_inputs, curve_ways, ways
from .stages import fit_s, path_s

# As it turns out: so many placements come on top of the finalists, for the marks; so many designs of a finalist are on
# a front; so many of the placements that are tried are different ones; so many layouts are simulated besides.
_MARKED, _DESIGNS, _DIFFERENT, _CHECKED = 3, 2, 0.8, 30


def foreseen(search: Search, material: Material, cuts: Cuts, simulated: bool) -> dict[str, float]:
    """Return the expected seconds of one core of each stage; `simulated`: whether a simulator runs the target."""
    n_switches, rows = len(material.switch_names), len(material.labels)
    kinds = available_inputs(n_switches, material.codes.shape[1])
    wired = [kind for kind in kinds if kind != "joints"]
    train = [len(fold.train) for fold in cuts.screening]
    more = [len(fold.train) for fold in cuts.all if fold not in cuts.screening]
    methods = [name for name in search.methods for _ in _variants(name, len(wired))]
    choices = sum(len(ways(name, n_switches)) for name in search.methods) * len(wired) + ("joints" in kinds)
    rivals = sum(len(curve_ways(name, n_switches)) for name in search.rivals)
    last = min(search.finalists + _MARKED, choices)
    designs = last * _DESIGNS
    few = papers_depth(search)
    return {
        "placements": sum(path_s(name, n) for name in methods for n in (rows, *train)),
        "rivals": sum(path_s(name, n) for name in search.rivals for n in train) if wired else 0.0,
        "screening": (_DIFFERENT * choices + rivals) * sum(fit_s(search.screened, 0, n) for n in train),
        "times": _DIFFERENT * choices * QUICK_PRICE_S,
        "finalists' placements": sum(path_s(name, n) for name in methods for n in more),
        "finalists": last * sum(fit_s(search.rounds, len(search.tabled) * len(SHAPES), n) for n in train),
        further(few.rounds): last * sum(fit_s(few.rounds, len(few.tabled) * len(SHAPES), n) for n in more),
        "prices": last * PRICE_S,
        "simulations": designs * TRIAL_S * simulated,
        "checks": _CHECKED * TRIAL_S * simulated,
        "latencies": last * (2.0 + _DESIGNS),
    }


def _variants(method: str, inputs: int) -> range:
    """Return how often a method's placements are found: once, or for each of the inputs if it learns from joints."""
    return range(inputs if METHODS[method].uses_joints else min(inputs, 1))

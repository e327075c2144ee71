"""All ways to choose switches, by name: the paper's, ours, and the rivals they are held beside."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from ..samples import Columns, Samples
from .baselines import RIVALS
from .boosted_elimination import boosted_elimination_order
from .costaware import PortCosts
from .elimination import elimination_order
from .errors import PlacementError
from .id3_family import cost_aware_chooser, cost_complexity_chooser, id3_chooser, reduced_error_chooser

Chooser = Callable[[float], Columns]


@dataclass(frozen=True, slots=True)
class Method:
    """A way to choose switches.

    what       a sentence for people
    parameter  what its parameter is: the paper's S (rows below which a node of the tree decides nothing), or how many
               switches to keep at most
    ours       whether it is the paper's or thenar's own; False: a rival
    """

    name: str
    what: str
    parameter: Literal["S", "switches"]
    ours: bool


def _first_of(order: Columns) -> Chooser:
    return lambda most: order[: max(int(most), 0)]


_OURS: Mapping[str, tuple[str, Callable[[Samples, PortCosts | None], Chooser]]] = {
    "id3": (
        "The paper's ID3: the switches that decide nodes of at least S rows",
        lambda learning, _: id3_chooser(learning),
    ),
    "id3-cost": (
        "ID3 that weighs information gain against the scan time that a switch adds, largest nodes first",
        cost_aware_chooser,
    ),
    "id3-ccp": (
        "ID3 less its weakest links (cost-complexity pruning by entropy)",
        lambda learning, _: cost_complexity_chooser(learning),
    ),
    "id3-rep": (
        "ID3 pruned by its errors on every third row, which it was not grown on (reduced-error pruning)",
        lambda learning, _: reduced_error_chooser(learning),
    ),
    "elimination": (
        "The switch whose row of the score tables is missed least goes, again and again: tables fitted whole",
        lambda learning, _: _first_of(elimination_order(learning)),
    ),
    "elimination-cost": (
        "Elimination that holds what a switch is worth against its part of the time to read its port",
        lambda learning, ports: _first_of(elimination_order(learning, ports)),
    ),
    "elimination-boosted": (
        "The same on boosted tables: LogitBoost starts anew once the switches whose removal costs least are gone",
        lambda learning, _: _first_of(boosted_elimination_order(learning)),
    ),
}


def _methods() -> Mapping[str, Method]:
    ours = [Method(name, what, "S" if name == "id3" else "switches", True) for name, (what, _) in _OURS.items()]
    rivals = [Method(name, what, "switches", False) for name, (what, _) in RIVALS.items()]
    return MappingProxyType({method.name: method for method in ours + rivals})


METHODS: Mapping[str, Method] = _methods()


def chooser(method: str, learning: Samples, ports: PortCosts | None = None) -> Chooser:
    """Return the placement of `learning` for every parameter of a method; the expensive work is done here, once.

    Numbers of switches are rounded down. `ports` tells the methods that heed scan time what reading takes; without it
    switches cost alike. Ours answer the same on every machine. Raises PlacementError for a method there is not, a set
    without switches, or `ports` of other switches.
    """
    if method not in METHODS:
        raise PlacementError(f"there is no placement method {method!r}: there are {', '.join(METHODS)}")
    if not learning.n_switches:
        raise PlacementError("there are no switches to choose from: the set holds joints only")
    if ports is not None and len(ports.port_of) != learning.n_switches:
        raise PlacementError(f"ports are known of {len(ports.port_of)} switches, the set has {learning.n_switches}")
    if method in _OURS:
        return _OURS[method][1](learning, ports)
    return RIVALS[method][1](learning)

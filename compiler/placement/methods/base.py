"""The interface of a placement method, and the registry of all methods."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.members import Members
from thenar.runtime.names import shortened
from thenar.runtime.recipe import Recipe

from ...samples import Columns, Samples, TrainingError
from ..ports import PortCosts

Chooser = Callable[[float], Columns]
Bits = NDArray[np.bool_]
Labels = NDArray[np.intp]

# The paper's method, and the default of ours.
PAPERS, BEST = "id3", "elimination"

# Numbers of switches; the paper's sizes are near 26 to 66. Baselines get the coarser list.
FINE = (1, 2, 3, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 28, 33, 40, 50, 66, 100, 130)
COARSE = (4, 8, 12, 16, 20, 24, 28, 33, 40, 50, 66)


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """A method that chooses switches, and its properties.

    Parameters
    ----------
    name : str
        The name, as the command line spells it.
    help : str
        One sentence for users, without a full stop.
    learn : callable
        `learn(samples, ports)` does the expensive work once and returns the chooser: a function of the parameter that
        returns the kept switches, as columns of `samples.switches`, in their order. It may keep fewer than requested.
        `ports` is None if the costs of reading are unknown. `ranked` turns a ranking into `learn`.
    parameter : {"switches", "S"}
        The chooser's argument: how many switches to keep at most, or the paper's S, the number of rows below which a
        node of a tree decides nothing.
    ours : bool
        Whether it is the paper's method or thenar's; the others are baselines.
    uses_joints : bool
        Whether the choice depends on the joints' codes, if there are any.
    uses_ports : bool
        Whether the choice depends on the costs of reading the ports.
    sizes : tuple of int
        The parameters that a frontier tries, up to the number of switches.
    nested : bool
        Whether the first of M switches are those of a smaller M, so that one ranking serves all M, with limits too.
    try_all_switches : bool
        Whether a frontier also tries to keep all switches.
    tried : {"always", "wired", "never"}
        When a frontier tries it by default: "wired" if the glove's actual wiring is known.
    label : str
        Its name in the tables of `evaluate`; "" for `name`.
    rank : int
        Its position among thenar's methods. Other packages' methods come after them.

    Raises
    ------
    TrainingError
        If the parameter is neither of the two.
    """

    name: str
    help: str
    learn: Callable[[Samples, PortCosts | None], Chooser]
    parameter: Literal["switches", "S"] = "switches"
    ours: bool = False
    uses_joints: bool = False
    uses_ports: bool = False
    sizes: tuple[int, ...] = COARSE
    nested: bool = False
    try_all_switches: bool = False
    tried: Literal["always", "wired", "never"] = "never"
    label: str = ""
    rank: int = 0

    def __post_init__(self) -> None:
        if self.parameter not in ("switches", "S"):
            raise TrainingError(f"method {self.name!r}: its parameter is 'switches' or 'S', not {self.parameter!r}")

    @property
    def title(self) -> str:
        """Its name in tables."""
        return self.label or self.name

    @property
    def by_number(self) -> bool:
        """Whether it takes a number of switches; else it takes S."""
        return self.parameter == "switches"

    def check_given(self, keep: int | None, prune: int) -> None:
        """Raise TrainingError unless the method's parameter is given, and nothing else."""
        if self.by_number and keep is None:
            raise TrainingError(f"method {self.name!r} needs ``keep`` M: how many switches to keep")
        if self.by_number and prune:
            raise TrainingError(f"method {self.name!r} takes ``keep`` M and no ``prune``")
        if not self.by_number and keep is not None:
            raise TrainingError(f"method {self.name!r} takes ``prune`` S and no ``keep``: choose another ``method``")

    def ladder(self, n_elements: int) -> tuple[int, ...]:
        """Return the parameters that a frontier tries among `n_elements` switches."""
        if not self.by_number:
            return self.sizes
        return (*(size for size in self.sizes if size < n_elements), *([n_elements] if self.try_all_switches else []))

    def chooser(self, samples: Samples, ports: PortCosts | None = None) -> Chooser:
        """Do the expensive work, and return the kept switches as a function of the parameter.

        Numbers of switches are rounded down. Without `ports` all switches cost the same. Raises TrainingError if
        there are no switches, if `ports` are those of other switches, or if the
        method chooses a column twice or one that there is not.
        """
        if not samples.n_switches:
            raise TrainingError("there are no switches to choose from: the set holds joints only")
        if ports is not None and len(ports.port_of) != samples.n_switches:
            raise TrainingError(f"ports are given for {len(ports.port_of)} switches, the set has {samples.n_switches}")
        learnt = self.learn(samples, ports)

        def chosen(parameter: float) -> Columns:
            columns = tuple(learnt(parameter))
            if len(set(columns)) < len(columns) or not all(0 <= column < samples.n_switches for column in columns):
                raise TrainingError(
                    f"method {self.name!r} chose the columns {shortened(str(columns))} of {samples.n_switches}: each "
                    "may be chosen once; report this to the method's authors"
                )
            return columns

        return chosen


METHODS: Members[Method] = Members("placement method", Method, "thenar.compiler.placement.methods", "thenar.methods")


# Choices that count elements or weigh their time, where `sensors` and `price` count and pay for all sensors alike.
_COUNTED_APART = ("keep", "keep_joints", "prune", "robust", "apart_mm", "at_most_taxels", "budget_us")


def check_placement(recipe: Recipe) -> None:
    """Raise SettingError or TrainingError unless the choices of a recipe's placement fit together."""
    method = METHODS.named(recipe.placement)
    if not by_sensors(recipe):
        method.check_given(recipe.keep, recipe.prune)
        return
    given = next((name for name in _COUNTED_APART if getattr(recipe, name)), None)
    given = given or (None if recipe.placement == PAPERS else "method")
    if given:
        raise TrainingError(
            f"``sensors`` and ``price`` choose among switches, pads and joints alike: leave ``{given}`` out"
        )


def by_sensors(recipe: Recipe) -> bool:
    """Return whether a recipe chooses sensors, not elements and joints."""
    return recipe.sensors is not None or recipe.price is not None


def usual(*, wired: bool = False) -> tuple[str, ...]:
    """Return the methods that a frontier tries by default."""
    when = ("always", "wired") if wired else ("always",)
    return tuple(name for name, method in METHODS.items() if method.tried in when)


def first_of(order: Columns) -> Chooser:
    """Return the chooser that keeps the first switches of an order."""
    return lambda most: order[: max(int(most), 0)]


def ranked(rank: Callable[[Bits, Labels], Iterable[int]]) -> Callable[[Samples, PortCosts | None], Chooser]:
    """Return `learn` of a method that ranks switches: a smaller placement is a prefix of a larger one.

    `rank(bits, labels)` returns or yields the columns of bits (n, s), all of which vary, best first; labels (n,) are
    class numbers, of which there are at least two. A generator is consumed only as far as needed. Joints are ignored,
    and switches that never change are never chosen.
    """

    def learn(samples: Samples, _: PortCosts | None) -> Chooser:
        bits, labels = samples.switches, samples.labels
        varying = np.flatnonzero(bits.any(axis=0) & ~bits.all(axis=0))
        order: list[int] = []
        rest: Iterator[int] = iter(())
        if varying.size and np.ptp(labels):
            rest = iter(rank(bits[:, varying], labels))

        def choose(most: float) -> Columns:
            size = min(max(int(most), 0), len(varying))
            if size > len(order):
                order.extend(int(varying[column]) for column in islice(rest, size - len(order)))
            return tuple(order[:size])

        return choose

    return learn

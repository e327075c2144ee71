"""A placement method: what its author supplies, and all methods by their names."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import islice
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.members import Members

from ...samples import Columns, Samples
from ..inputs import PlacementError
from ..ports import PortCosts

Chooser = Callable[[float], Columns]
Bits = NDArray[np.bool_]
Labels = NDArray[np.intp]

# The paper's method, and the one that we take where nothing else is asked for.
PAPERS, BEST = "id3", "elimination"

# Numbers of switches; the paper's own sizes are near 26 to 66. Coarser: of methods that are there to be compared.
FINE = (1, 2, 3, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 28, 33, 40, 50, 66, 100, 130)
COARSE = (4, 8, 12, 16, 20, 24, 28, 33, 40, 50, 66)


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """A way to choose switches, and everything that is true of it.

    Parameters
    ----------
    name : str
        The name, as the command line spells it.
    help : str
        One sentence for people, without a full stop.
    learn : callable
        `learn(samples, ports)` does the expensive work once and returns the chooser: a function of the parameter that
        returns the kept switches, as columns of `samples.switches`, in their order. It may keep fewer than asked for.
        `ports` is None where the costs of reading are not known. `ranked` makes `learn` of a ranking.
    parameter : {"switches", "S"}
        What the chooser takes: how many switches to keep at most, or the paper's S, the number of rows below which a
        node of a tree decides nothing.
    ours : bool
        Whether it is the paper's or thenar's own; the others are baselines, shown for comparison.
    uses_joints : bool
        Whether the choice depends on the joints' codes, where there are any.
    uses_ports : bool
        Whether the choice depends on what reading the ports costs.
    sizes : tuple of int
        The parameters that a frontier tries, as far as there are so many switches.
    nested : bool
        Whether the first of M switches are those of a smaller M: one ranking answers all, with limits as well.
    all_too : bool
        Whether a frontier also tries to keep all switches.
    tried : {"always", "wired", "unwired", "never"}
        When a frontier tries it without being asked to: "wired" where the glove's own wiring is known.
    imports, install : str
        The package that it cannot do without, and what pip calls it; "" where it needs none but scikit-learn.
    seconds : float
        Expected time of a core for all sizes, with 160 switches and 3000 rows: it only predicts the time left.
    label : str
        Its name in the tables of `evaluate`; "" for `name`.
    rank : int
        Its place among thenar's own methods. Other packages' methods come after them.

    Raises
    ------
    PlacementError
        If the parameter is none of the two.
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
    all_too: bool = False
    tried: Literal["always", "wired", "unwired", "never"] = "never"
    imports: str = ""
    install: str = ""
    seconds: float = 0.5
    label: str = ""
    rank: int = 0

    def __post_init__(self) -> None:
        if self.parameter not in ("switches", "S"):
            raise PlacementError(f"method {self.name!r}: its parameter is 'switches' or 'S', not {self.parameter!r}")

    @property
    def installed(self) -> bool:
        """Whether the package that it needs is there."""
        return not self.imports or find_spec(self.imports) is not None

    @property
    def title(self) -> str:
        """Its name in tables."""
        return self.label or self.name

    @property
    def by_number(self) -> bool:
        """Whether it takes a number of switches; else it takes S."""
        return self.parameter == "switches"

    def check_given(self, keep: int | None, prune: int) -> None:
        """Raise PlacementError unless what the method takes is given, and nothing else."""
        if self.by_number and keep is None:
            raise PlacementError(f"method {self.name!r} needs --keep M: how many switches to keep")
        if self.by_number and prune:
            raise PlacementError(f"method {self.name!r} takes --keep M and no --prune")
        if not self.by_number and keep is not None:
            raise PlacementError(f"method {self.name!r} takes --prune S and no --keep: choose another --method")

    def ladder(self, n_switches: int) -> tuple[int, ...]:
        """Return the parameters that a frontier tries among so many switches."""
        if not self.by_number:
            return self.sizes
        return (*(size for size in self.sizes if size < n_switches), *([n_switches] if self.all_too else []))

    def chooser(self, samples: Samples, ports: PortCosts | None = None) -> Chooser:
        """Do the expensive work, and return the kept switches as a function of the parameter.

        Numbers of switches are rounded down. Without `ports` all switches cost the same. Raises PlacementError where
        there are no switches, where `ports` are those of other switches, or where the package needed is missing.
        """
        if not self.installed:
            raise PlacementError(f"{self.name} needs {self.imports}, which is missing: pip install {self.install}")
        if not samples.n_switches:
            raise PlacementError("there are no switches to choose from: the set holds joints only")
        if ports is not None and len(ports.port_of) != samples.n_switches:
            raise PlacementError(f"ports are known of {len(ports.port_of)} switches, the set has {samples.n_switches}")
        return self.learn(samples, ports)


METHODS: Members[Method] = Members("placement method", Method, "thenar.compiler.placement.methods", "thenar.methods")


def usual(*, ours: bool, wired: bool = False) -> tuple[str, ...]:
    """Return the methods, ours or the baselines, that a frontier tries without being asked to."""
    when = ("always", "wired" if wired else "unwired")
    return tuple(name for name, method in METHODS.items() if method.ours == ours and method.tried in when)


def first_of(order: Columns) -> Chooser:
    """Return the chooser that keeps the first so many switches of an order."""
    return lambda most: order[: max(int(most), 0)]


def ranked(rank: Callable[[Bits, Labels], Iterable[int]]) -> Callable[[Samples, PortCosts | None], Chooser]:
    """Return `learn` of a method that ranks switches: fewer of them are the first of more.

    `rank(bits, labels)` returns or yields the columns of bits (n, s), all of which vary, best first; labels (n,) are
    class numbers, of which there are at least two. What is yielded is ranked only as far as is asked for. Joints are
    ignored, and switches that never change are never chosen. What rests on the machine's linear algebra may decide
    near ties otherwise on another machine.
    """

    def learn(samples: Samples, _: PortCosts | None) -> Chooser:
        from threadpoolctl import threadpool_limits

        bits, labels = samples.switches, samples.labels
        varying = np.flatnonzero(bits.any(axis=0) & ~bits.all(axis=0))
        order: list[int] = []
        rest: Iterator[int] = iter(())
        if varying.size and np.ptp(labels):
            # The matrices are small: threads would wait for each other longer than they work.
            with threadpool_limits(1):
                rest = iter(rank(bits[:, varying], labels))

        def choose(most: float) -> Columns:
            size = min(max(int(most), 0), len(varying))
            if size > len(order):
                with threadpool_limits(1):
                    order.extend(int(varying[column]) for column in islice(rest, size - len(order)))
            return tuple(order[:size])

        return choose

    return learn

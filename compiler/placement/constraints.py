"""What a placement must obey: switches and taxels to keep or to leave out, distances, numbers and the time of a scan.

All but what must be kept can only be broken by adding: so whatever order a method puts elements in, those that must be
kept are taken first, and then each that breaks nothing. A method that does not rank looks again without what it may
not have.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import hypot

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.harness.wiring import GloveWiring
from thenar.runtime.manifest import Options
from thenar.runtime.names import list_names, nearest

from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples
from .elements import Elements
from .inputs import PlacementError
from .ports import PortCosts, record_times_us

Bits = NDArray[np.bool_]
Places = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What is asked of a placement, by the names of switches, taxels and joints.

    keep, never  what must be kept, and what must not
    apart_mm     no two that are kept may be nearer to each other, by their `places` (mm); levels of a taxel may
    taxels       the most taxels that may be kept, with however many levels
    budget_us    the most that reading the ports of what is kept may take, and a record of the kept joints meanwhile
    records_us   what a record of one, of two, ... of the joints takes; empty where that is not known, nor limited then
    names        of all switches, `n_switches`, and then of the taxels
    joints       names of the joints
    places       where switches and taxels lie on the hand, where that is known

    Raises PlacementError for a name that is not there, and where these contradict each other.
    """

    names: tuple[str, ...]
    n_switches: int
    joints: tuple[str, ...] = ()
    keep: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    apart_mm: float = 0.0
    taxels: int | None = None
    budget_us: float | None = None
    records_us: tuple[float, ...] = ()
    places: Places = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in (*self.keep, *self.never):
            if name not in (every := (*self.names, *self.joints)):
                raise PlacementError(f"there is no input {name!r} to keep or to leave out{nearest(name, every)}")
        if self.apart_mm and (lost := [name for name in self.names if name not in self.places]):
            raise PlacementError(f"--apart-mm: where {list_names(lost)} lie is not known: --layout takes your glove")
        if both := [name for name in self.keep if name in self.never]:
            raise PlacementError(f"--keep-these and --never both name {list_names(both)}: take it out of one of them")
        for at, name in enumerate(self.keep):
            for other in self.keep[:at] if self.apart_mm and name in self.names else ():
                if other in self.names and self._apart(name, other) < self.apart_mm:
                    raise PlacementError(
                        f"--keep-these {other},{name} are {self._apart(name, other):.1f} mm apart, --apart-mm asks for "
                        f"{self.apart_mm:g}: drop one of them, or allow less"
                    )

    @classmethod
    def of(
        cls, options: Options, grasp_set: GraspSet, places: Places, glove: GloveWiring | None = None
    ) -> "Limits | None":
        """Return what the options of a build ask of a set's elements and joints; None where they ask nothing."""
        asked = (options.keep_these, options.never, options.apart_mm, options.at_most_taxels, options.budget_us)
        if not any(each is not None and each != () for each in asked):
            return None
        return cls(
            names=grasp_set.element_names,
            n_switches=len(grasp_set.switch_names),
            joints=grasp_set.joint_names,
            keep=options.keep_these,
            never=options.never,
            apart_mm=options.apart_mm or 0.0,
            taxels=options.at_most_taxels,
            budget_us=options.budget_us,
            records_us=record_times_us(grasp_set.joint_names, glove),
            places=places,
        )

    def on(self, elements: Elements, ports: PortCosts | None) -> "Bound":
        """Return the limits on these elements, where `ports` says what reading them costs.

        Raises PlacementError where they cannot be obeyed.
        """
        if self.budget_us is not None and ports is None and elements:
            raise PlacementError("--budget-us needs to know what reading the glove costs: name its --glove")
        own = [self.names[element.column] for element in elements]
        if lost := [name for name in self.keep if name in self.names and name not in own]:
            raise PlacementError(f"--keep-these names {list_names(lost)}, and --inputs leaves that out")
        bound = Bound(
            self,
            groups=tuple(
                tuple(at for at, each in enumerate(own) if each == name) for name in self.keep if name in self.names
            ),
            never=np.isin(own, self.never),
            near=self._near(own),
            taxel=np.array([one.column if one.column >= self.n_switches else -1 for one in elements], np.intp),
            ports=ports,
        )
        bound.check()
        return bound

    def on_joints(self, most: int | None) -> tuple[Columns, Columns, int]:
        """Return the joints to keep in any case, those not to keep, and how many to keep at most.

        Raises PlacementError for more to keep than `most`, or than there is time for.
        """
        keep, never = (
            tuple(joint for joint, name in enumerate(self.joints) if name in asked) for asked in (self.keep, self.never)
        )
        if most is not None and len(keep) > most:
            raise PlacementError(f"--keep-these names {len(keep)} joints, --keep-joints allows {most}: name fewer")
        fit = len(self.joints)
        if self.budget_us is not None and self.records_us:
            fit = sum(us <= self.budget_us for us in self.records_us)
        if len(keep) > fit:
            raise PlacementError(
                f"--keep-these names {len(keep)} joints, whose record takes {self.records_us[len(keep) - 1]:.1f} us, "
                f"--budget-us allows {self.budget_us:g}: name fewer, or allow more"
            )
        return keep, never, fit if most is None else min(most, fit)

    def _apart(self, one: str, other: str) -> float:
        (x, y), (u, v) = self.places[one], self.places[other]
        return hypot(x - u, y - v)

    def _near(self, names: Sequence[str]) -> Bits:
        near = np.zeros((len(names), len(names)), np.bool_)
        if self.apart_mm:
            places = np.array([self.places[name] for name in names])
            gaps = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
            near = (gaps < self.apart_mm) & (np.array(names)[:, None] != np.array(names))
        return near


@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """Limits on s elements, by their numbers.

    groups  of each of which one element must be kept: a switch, or the levels of a taxel
    never   (s,) what must not be kept; near (s, s): of which two not both may be
    taxel   (s,) the taxel of a level, -1 of a switch; ports: what reading the elements costs
    """

    limits: Limits
    groups: tuple[Columns, ...]
    never: Bits
    near: Bits
    taxel: NDArray[np.intp]
    ports: PortCosts | None

    def addable(self, kept: Sequence[int]) -> Bits:
        """Return (s,) which elements may be kept besides these."""
        chosen = list(kept)
        free = ~self.never & ~self.near[:, chosen].any(axis=1)
        free[chosen] = False
        taxels = set(self.taxel[chosen].tolist()) - {-1}
        if self.limits.taxels is not None and len(taxels) >= self.limits.taxels:
            free &= (self.taxel < 0) | np.isin(self.taxel, list(taxels))
        if self.limits.budget_us is not None and self.ports is not None:
            on = np.array(self.ports.port_of)
            read = set(on[chosen].tolist())
            left = _ns(self.limits.budget_us) - sum(self._times[port] for port in read)
            free &= np.isin(on, list(read)) | (np.array(self._times)[on] <= left)
        return free

    @property
    def _times(self) -> list[int]:
        """Whole nanoseconds of each port, so that sums are exact."""
        return [_ns(us) for us in self.ports.us] if self.ports is not None else []

    def holds(self, kept: Sequence[int]) -> bool:
        """Return whether these elements obey: each breaks nothing with those before it, and none is lacking."""
        return self.whole(kept) and all(self.addable(kept[:place])[one] for place, one in enumerate(kept))

    def whole(self, kept: Sequence[int]) -> bool:
        """Return whether all that must be kept is among these elements."""
        return all(not set(group).isdisjoint(kept) for group in self.groups)

    def rows(self, among: NDArray[np.intp]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the limits as rows (r, v + extra) and bounds (r,) of an integer program: rows @ (x, y) <= bounds.

        x says which of the v elements `among` are kept; y which taxels are, and which ports are read.
        """
        v, (at, place) = len(among), ({int(one): at for at, one in enumerate(among)}, self.taxel[among])
        taxels = np.unique(place[place >= 0]) if self.limits.taxels is not None else np.zeros(0, np.intp)
        us = np.array(self._times if self.limits.budget_us is not None else [], np.float64) / 1000
        width, found = v + len(taxels) + len(us), list[tuple[dict[int, float], float]]()
        found += [({at: 1.0}, 0.0) for at in np.flatnonzero(self.never[among]).tolist()]
        found += [({at[one]: -1.0 for one in group}, -1.0) for group in self.groups]
        one_, other = np.nonzero(np.triu(self.near[np.ix_(among, among)]))
        found += [({first: 1.0, second: 1.0}, 1.0) for first, second in zip(one_.tolist(), other.tolist(), strict=True)]
        found += [
            ({level: 1.0, v + number: -1.0}, 0.0)
            for number, taxel in enumerate(taxels.tolist())
            for level in np.flatnonzero(place == taxel).tolist()
        ]
        if self.limits.taxels is not None:
            found.append(({v + number: 1.0 for number in range(len(taxels))}, self.limits.taxels))
        if self.limits.budget_us is not None and self.ports is not None:
            first = v + len(taxels)
            on = [self.ports.port_of[one] for one in among.tolist()]
            found += [({element: 1.0, first + port: -1.0}, 0.0) for element, port in enumerate(on)]
            found.append(({first + port: float(each) for port, each in enumerate(us)}, self.limits.budget_us))
        rows = np.zeros((len(found), width))
        for number, (row, _) in enumerate(found):
            rows[number, list(row)] = list(row.values())
        return rows, np.array([most for _, most in found])

    def check(self) -> None:
        """Raise PlacementError where what must be kept breaks a limit."""
        limits, kept = self.limits, self.required(())
        if limits.taxels is not None and len(set(self.taxel[kept].tolist()) - {-1}) > limits.taxels:
            raise PlacementError(
                f"--keep-these names more taxels than --at-most {limits.taxels} taxels allows: name fewer, or allow "
                "more"
            )
        if limits.budget_us is not None and self.ports is not None:
            taken = sum(self._times[port] for port in {self.ports.port_of[one] for one in kept})
            if taken > _ns(limits.budget_us):
                raise PlacementError(
                    f"--keep-these takes {taken / 1000:.1f} us to read, --budget-us allows {limits.budget_us:g}: name "
                    "fewer, or allow more"
                )
        if self.never.size and not kept and not self.addable(()).any():
            raise PlacementError("--never and --budget-us leave nothing to choose: allow more")

    def required(self, order: Sequence[int]) -> list[int]:
        """Return one element of each group that must be kept, the first in `order`."""
        rank = {column: place for place, column in enumerate(order)}
        return [min(group, key=lambda one: (rank.get(one, len(rank)), one)) for group in self.groups]

    def obeyed(self, order: Columns, most: float) -> Columns:
        """Return at most so many of `order`, and what must be kept: each that breaks nothing with those before it."""
        kept = self.required(order)
        if len(kept) > most:
            raise PlacementError(f"--keep-these names {len(kept)}, --keep allows {most:g}: name fewer, or keep more")
        for column in order:
            if len(kept) < most and column not in kept and self.addable(kept)[column]:
                kept.append(column)
        rank = {column: place for place, column in enumerate(order)}
        return tuple(sorted(kept, key=lambda one: rank.get(one, len(rank))))

    def without(self, samples: Samples, columns: Sequence[int] = ()) -> Samples:
        """Return the rows with what must not be kept, and `columns`, always open: no method keeps what never varies."""
        switches = samples.switches & ~self.never
        switches[:, list(columns)] = False
        return replace(samples, switches=switches)


def _ns(us: float) -> int:
    return round(us * 1000)

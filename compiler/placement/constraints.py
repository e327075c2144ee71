"""Constraints on a placement: inputs to keep or leave out, distances, counts and the scan time.

Except for the inputs to keep, a constraint is only ever broken by adding an element. So, in whatever order a method
ranks elements, those that must be kept are taken first, and then each that breaks no constraint. A method that does not
rank runs again without the elements that it may not take.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import hypot

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.harness.wiring import GloveWiring
from thenar.runtime.names import list_names, nearest
from thenar.runtime.recipe import Recipe

from ..recordings.graspset import GraspSet
from ..samples import Columns, Samples, TrainingError
from .elements import Elements
from .ports import PortCosts, record_times_us

Bits = NDArray[np.bool_]
Places = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Constraints on a placement, by the names of switches, taxels and joints.

    keep, never  inputs that must be kept, and inputs that must not
    apart_mm     the least distance between two kept inputs, by their `places` (mm); levels of one taxel are exempt
    taxels       the most taxels to keep, with any number of levels
    budget_us    the most time for reading the ports of the kept inputs, and for a record of the kept joints meanwhile
    price        the most that the kept sensors may cost, those of `have` excepted; prices: of every input, by name
    records_us   time of a record of one, of two, ... of the joints; empty if unknown, and then not limited
    names        of all switches, `n_switches`, and then of the taxels
    joints       names of the joints
    places       known positions of switches and taxels on the hand

    Raises TrainingError for an unknown name, and for constraints that contradict each other.
    """

    names: tuple[str, ...]
    n_switches: int
    joints: tuple[str, ...] = ()
    keep: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    apart_mm: float = 0.0
    taxels: int | None = None
    budget_us: float | None = None
    price: float | None = None
    prices: Mapping[str, float] = field(default_factory=dict)
    records_us: tuple[float, ...] = ()
    places: Places = field(default_factory=dict)

    def __post_init__(self) -> None:
        every_name = (*self.names, *self.joints)
        for name in (*self.keep, *self.never):
            if name not in every_name:
                raise TrainingError(f"there is no input {name!r} to keep or to leave out{nearest(name, every_name)}")
        if self.apart_mm and (lost := [name for name in self.names if name not in self.places]):
            raise TrainingError(
                f"``apart_mm``: the position of {list_names(lost)} is unknown: give ``layout`` your glove"
            )
        if (self.price is not None or self.prices) and (
            lost := [name for name in every_name if name not in self.prices]
        ):
            raise TrainingError(f"``price``: the price of {list_names(lost)} is unknown: add it to ``prices``")
        if both := [name for name in self.keep if name in self.never]:
            raise TrainingError(f"``have`` and ``never`` both name {list_names(both)}: take it out of one of them")
        for at, name in enumerate(self.keep):
            for other in self.keep[:at] if self.apart_mm and name in self.names else ():
                if other in self.names and self._apart(name, other) < self.apart_mm:
                    raise TrainingError(
                        f"``have`` {other},{name} are {self._apart(name, other):.1f} mm apart, ``apart_mm`` "
                        f"requires {self.apart_mm:g}: drop one of them, or allow less"
                    )

    @classmethod
    def of(
        cls,
        options: Recipe,
        grasp_set: GraspSet,
        places: Places,
        glove: GloveWiring | None = None,
        prices: Mapping[str, float] | None = None,
    ) -> "Limits | None":
        """Return the constraints that a build's options put on a set's elements and joints, or None."""
        asked = (options.have, options.never, options.apart_mm, options.at_most_taxels, options.budget_us)
        if not prices and options.price is None and not any(each is not None and each != () for each in asked):
            return None
        return cls(
            names=grasp_set.element_names,
            n_switches=len(grasp_set.switch_names),
            joints=grasp_set.joint_names,
            keep=options.have,
            never=options.never,
            apart_mm=options.apart_mm or 0.0,
            taxels=options.at_most_taxels,
            budget_us=options.budget_us,
            price=options.price,
            prices=prices or {},
            records_us=record_times_us(grasp_set.joint_names, glove),
            places=places,
        )

    def on(self, elements: Elements, ports: PortCosts | None) -> "Bound":
        """Return the constraints on these elements; `ports` holds the costs of reading them.

        Raises TrainingError if they cannot be met.
        """
        if self.budget_us is not None and ports is None and elements:
            raise TrainingError("``budget_us`` needs the cost of reading the glove: name its ``glove``")
        own = [self.names[element.column] for element in elements]
        if lost := [name for name in self.keep if name in self.names and name not in own]:
            raise TrainingError(f"``have`` names {list_names(lost)}, and ``inputs`` leaves that out")
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

        Raises TrainingError if more joints must be kept than `most`, or than the budget allows.
        """
        keep, never = (
            tuple(joint for joint, name in enumerate(self.joints) if name in asked) for asked in (self.keep, self.never)
        )
        if most is not None and len(keep) > most:
            raise TrainingError(f"``have`` names {len(keep)} joints, ``keep_joints`` allows {most}: name fewer")
        fit = len(self.joints)
        if self.budget_us is not None and self.records_us:
            fit = sum(us <= self.budget_us for us in self.records_us)
        if len(keep) > fit:
            raise TrainingError(
                f"``have`` names {len(keep)} joints, whose record takes {self.records_us[len(keep) - 1]:.1f} µs, "
                f"``budget_us`` allows {self.budget_us:g}: name fewer, or allow more"
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
    """Constraints on s elements, by their numbers.

    groups  element groups, a switch or the levels of a taxel; one element of each must be kept
    never   (s,) elements that must not be kept; near (s, s): pairs that must not both be kept
    taxel   (s,) the taxel of a level, -1 for a switch; ports: the cost of reading the elements
    """

    limits: Limits
    groups: tuple[Columns, ...]
    never: Bits
    near: Bits
    taxel: NDArray[np.intp]
    ports: PortCosts | None

    def addable(self, kept: Sequence[int]) -> Bits:
        """Return a mask (s,) of the elements that may be added to these."""
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
        """Nanoseconds of each port, as integers, so that sums are exact."""
        return [_ns(us) for us in self.ports.us] if self.ports is not None else []

    def check(self) -> None:
        """Raise TrainingError if the elements that must be kept break a constraint."""
        limits, kept = self.limits, self.required(())
        if limits.taxels is not None and len(set(self.taxel[kept].tolist()) - {-1}) > limits.taxels:
            raise TrainingError(
                f"``have`` names more taxels than ``at_most`` {limits.taxels} taxels allows: name fewer, or allow more"
            )
        if limits.budget_us is not None and self.ports is not None:
            taken = sum(self._times[port] for port in {self.ports.port_of[one] for one in kept})
            if taken > _ns(limits.budget_us):
                raise TrainingError(
                    f"``have`` takes {taken / 1000:.1f} µs to read, ``budget_us`` allows {limits.budget_us:g}: "
                    "name fewer, or allow more"
                )
        if self.never.size and not kept and not self.addable(()).any():
            raise TrainingError("``never`` and ``budget_us`` leave nothing to choose: allow more")

    def required(self, order: Sequence[int]) -> list[int]:
        """Return one element of each group that must be kept, the first in `order`."""
        rank = {column: place for place, column in enumerate(order)}
        return [min(group, key=lambda one: (rank.get(one, len(rank)), one)) for group in self.groups]

    def obeyed(self, order: Columns, most: float) -> Columns:
        """Return at most `most` of `order`, required elements first, skipping each that would break a constraint."""
        kept = self.required(order)
        if len(kept) > most:
            raise TrainingError(f"``have`` names {len(kept)}, ``keep`` allows {most:g}: name fewer, or keep more")
        for column in order:
            if len(kept) < most and column not in kept and self.addable(kept)[column]:
                kept.append(column)
        rank = {column: place for place, column in enumerate(order)}
        return tuple(sorted(kept, key=lambda one: rank.get(one, len(rank))))

    def without(self, samples: Samples, columns: Sequence[int] = ()) -> Samples:
        """Return rows in which excluded elements and `columns` are always open: methods never keep constant inputs."""
        switches = samples.switches & ~self.never
        switches[:, list(columns)] = False
        return replace(samples, switches=switches)


def _ns(us: float) -> int:
    return round(us * 1000)

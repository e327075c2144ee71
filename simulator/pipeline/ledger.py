"""The ledger: what every step of a pipeline has cost, entered batch by batch and added up across workers."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Self

from ..streams import Draws


@dataclass(slots=True)
class Entry:
    """What one step has done so far.

    own          True for a step that every scene has, False for an effect that the scene lists
    calls        batches
    grasps       repetitions in them
    draws        random numbers
    nanoseconds  wall time
    counters     what the step itself counts: solver steps, bytes sent, ...
    """

    own: bool
    calls: int = 0
    grasps: int = 0
    draws: int = 0
    nanoseconds: int = 0
    counters: Counter[str] = field(default_factory=Counter)

    def add(self, other: Self) -> None:
        """Add what another worker's entry of the same step says."""
        self.calls += other.calls
        self.grasps += other.grasps
        self.draws += other.draws
        self.nanoseconds += other.nanoseconds
        self.counters.update(other.counters)


@dataclass(slots=True)
class Ledger:
    """The entries by the name of the step, in the order in which the steps first ran."""

    entries: dict[str, Entry] = field(default_factory=dict)

    def enter(self, name: str, own: bool, calls: int, grasps: int, nanoseconds: int, draws: Draws) -> None:
        """Enter `calls` calls of step `name`, a batch each, together `grasps` repetitions.

        What `draws` holds under that name are random numbers; under any other name, what the step counted.
        """
        counters = draws.counts.copy()
        drawn = counters.pop(name, 0)
        self._add(name, Entry(own, calls, grasps, drawn, nanoseconds, counters))

    def merge(self, other: Self) -> None:
        """Add another worker's ledger."""
        for name, entry in other.entries.items():
            self._add(name, entry)

    @property
    def nanoseconds(self) -> int:
        """The time of all steps together."""
        return sum(entry.nanoseconds for entry in self.entries.values())

    def shares(self) -> Iterator[tuple[str, float]]:
        """Yield every step with its share of the time, 0 to 1."""
        total = self.nanoseconds
        for name, entry in self.entries.items():
            yield name, entry.nanoseconds / total if total else 0.0

    def _add(self, name: str, entry: Entry) -> None:
        self.entries.setdefault(name, Entry(entry.own)).add(entry)

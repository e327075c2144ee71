"""The hardware options of a glove: the target that classifies, and the possible wirings of its switches."""

from collections.abc import Sequence
from dataclasses import dataclass

from .cache import Cache, stored
from .timing.classify_times import ClassifyModel
from .timing.python_times import PythonCost
from .timing.scan_times import NO_RECORDS, Overhead, Records, overhead_of
from .timing.wirings import WiringOption


@dataclass(frozen=True, slots=True, eq=False)
class Equipment:
    """The target's model, the candidate wirings, the overhead of a transaction, and the time of a record."""

    model: ClassifyModel
    wirings: tuple[WiringOption, ...]
    overhead: Overhead
    records: Records = NO_RECORDS

    def fitting(self, names: Sequence[str]) -> tuple[WiringOption, ...]:
        """Return the wirings with a place for all of these switches; none if there are no switches."""
        return tuple(wiring for wiring in self.wirings if wiring.fits(names)) if names else ()


@stored(1, where="process")
def calibrate(target: str) -> tuple[PythonCost | None, Overhead]:
    """Measure here, if the target requires it, the time of classifying in Python and the overhead of a transaction."""
    return ClassifyModel(target).python, overhead_of(target)


def equipment_for(
    target: str, wirings: tuple[WiringOption, ...], cache: Cache, records: Records = NO_RECORDS
) -> Equipment:
    """Return the hardware options for `target`, measured here once."""
    ((python, overhead),) = cache.ask(calibrate, [(target,)])
    return Equipment(ClassifyModel(target, python=python), wirings, overhead, records)

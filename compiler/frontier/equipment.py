"""What a glove may be built of: the target that classifies, and the wirings that its switches may hang on."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from thenar.runtime.harness.wiring import Harness

from .timing.beside_wire import Beside
from .timing.classify_times import ClassifyModel
from .timing.wirings import Wiring


@dataclass(frozen=True, slots=True, eq=False)
class Equipment:
    """The target's model, the wirings worth trying, and what a transaction takes besides the wire."""

    model: ClassifyModel
    wirings: tuple[Wiring, ...]
    beside: Beside

    def fitting(self, names: Sequence[str]) -> tuple[Wiring, ...]:
        """Return the wirings that have a place for all of these switches; none where there are none to read."""
        return tuple(wiring for wiring in self.wirings if wiring.fits(names)) if names else ()

    @property
    def identity(self) -> tuple[str, ...]:
        """What prices depend on besides the tables."""
        named = (f"{wiring.name}@{wiring.clock_hz}:{_digest(wiring.harness)}" for wiring in self.wirings)
        return (self.model.target, repr(self.beside), repr((self.model.python, self.model.factor)), *named)


def _digest(harness: Harness | None) -> str:
    # All of it: a harness's own fingerprint leaves out clocks and bauds, on which times depend.
    return "" if harness is None else hashlib.sha256(msgspec.json.encode(harness)).hexdigest()[:16]

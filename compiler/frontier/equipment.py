"""What a glove may be built of: the target that classifies, and the wirings that its switches may hang on."""

from collections.abc import Sequence
from dataclasses import dataclass

from .beside_wire import Beside
from .classify_times import ClassifyModel
from .wirings import Wiring


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
        harnesses = (wiring.harness.fingerprint if wiring.harness else "" for wiring in self.wirings)
        named = (
            f"{wiring.name}@{wiring.clock_hz}:{harness}"
            for wiring, harness in zip(self.wirings, harnesses, strict=True)
        )
        return (self.model.target, repr(self.beside), repr(self.model.python), *named)

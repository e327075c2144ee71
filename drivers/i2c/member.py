"""A chip of a bus, and how it is doing."""

from dataclasses import dataclass

from .chip import Chip, Write
from .recognising import watched
from .routes import Route, place


@dataclass(frozen=True, slots=True)
class ChipState:
    """How a chip is doing. `errors` counts what failed, retries that helped included; `last_error` stays."""

    kind: str
    address: int
    mux: int | None
    channel: int | None
    present: bool
    errors: int
    last_error: str


@dataclass(eq=False, slots=True)
class Member:
    """A chip in its place on the bus at `device`. `due` is when it is seen to next; `checked` counts its checks."""

    device: str
    chip: Chip
    used: frozenset[int]
    route: Route | None
    present: bool = False
    errors: int = 0
    last_error: str = ""
    due: float = 0.0
    checked: int = 0

    @property
    def watched(self) -> Write | None:
        """What a reset would lose."""
        return watched(self.chip, self.used)

    @property
    def named(self) -> str:
        """The chip and where it is, for messages."""
        return place(self.device, self.chip.kind, self.chip.address, self.route)

    @property
    def state(self) -> ChipState:
        """What others may know."""
        mux, channel = (self.route.mux, self.route.channel) if self.route else (None, None)
        return ChipState(self.chip.kind, self.chip.address, mux, channel, self.present, self.errors, self.last_error)

    def blame(self, error: str) -> None:
        """Count a failure."""
        self.errors += 1
        self.last_error = error

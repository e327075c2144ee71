"""From finalists to points: every way to build each of them, and those that are on a front."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from .candidates import Choice
from .closeup import Close
from .pareto import front
from .points import Rate, Scan, Time
from .pricing import PricedTables, Tabled, Wired
from .timing.classify_times import Classified
from .timing.scan_times import transfer_us


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """A finalist built in one way: these tables in this layout, their switches read so (None: it reads none)."""

    close: Close
    tables: PricedTables
    classified: Classified
    wired: Wired | None
    scan_kind: Scan
    joints: int

    @property
    def choice(self) -> Choice:
        """What is read, and how its switches were chosen."""
        return self.close.screened.choice

    @property
    def tabled(self) -> Tabled:
        """The rounds and the shape of the tables."""
        return self.tables.tabled

    @property
    def rate(self) -> Rate:
        """What these tables recognise."""
        return self.close.rates[self.tabled]

    @property
    def n_switches(self) -> int:
        """How many switches are read."""
        return len(self.close.screened.columns)

    @property
    def compile_s(self) -> float:
        """How long choosing the switches, training and the tables took."""
        return self.close.choosing_s + self.tables.seconds

    @property
    def scan(self) -> Time:
        """Reading the switches."""
        if self.wired is None:
            return Time(0.0, "wire")
        times = self.wired.scan
        return Time(times.early_us if self.scan_kind == "early" else times.full_us, times.how)

    @property
    def transfer(self) -> Time:
        """One record of the CyberGlove."""
        return Time(transfer_us(self.joints), "wire")

    @property
    def classify(self) -> Time:
        """Classifying, as the model has it."""
        return Time(self.classified.us * self.looks, self.classified.how)

    @property
    def looks(self) -> float:
        """How often a frame is classified, the mean over frames as the time of its scan is: a scan that may end early
        looks at the scores after every port that it reads.
        """
        return self.wired.scan.early_ports if self.scan_kind == "early" and self.wired is not None else 1.0

    @property
    def frame_us(self) -> float:
        """Reading everything, on lines of their own, and classifying, as the model has it."""
        return max(self.scan.us, self.transfer.us) + self.classify.us


def designs(close: Close, joints: int) -> Iterator[Design]:
    """Yield every way to build a finalist; `joints` it has in all."""
    read = joints if close.screened.choice.joints else 0
    for tables in close.priced.tables:
        for classified in tables.classified:
            if not close.screened.columns:
                yield Design(close, tables, classified, None, "full", read)
            for wired in tables.wired:
                # Not where ending early never leaves anything out, as with boards.
                kinds: tuple[Scan, ...] = ("full", "early") if wired.scan.early_us < wired.scan.full_us else ("full",)
                for kind in kinds:
                    yield Design(close, tables, classified, wired, kind, read)


def best_designs(
    all_designs: Sequence[Design], frame_us: Callable[[Design], float]
) -> tuple[list[Design], list[Design]]:
    """Return the designs on the front of rate against frame time, and those on that against the number of switches.

    Of designs that are equal there, the one of fewer chips, fewer ports, less reading and less flash.
    """
    cheapest = sorted(all_designs, key=_effort)
    by_time = front(cheapest, frame_us, lambda design: design.rate.mean)
    cheapest.sort(key=frame_us)
    by_switches = front(cheapest, lambda design: design.n_switches, lambda design: design.rate.mean)
    return by_time, by_switches


def _effort(design: Design) -> tuple[float, ...]:
    parts = (design.wired.scan.chips, design.wired.scan.ports) if design.wired else (0, 0)
    return (*parts, design.scan.us, design.classified.flash, design.tabled.rounds)

"""What `thenar firmware` tells of layouts: as a table, and as a document."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.table import Table

if TYPE_CHECKING:
    from thenar.compiler.firmware.library import Fit
    from thenar.compiler.firmware.measuring import Measured


@dataclass(frozen=True, slots=True)
class LayoutRow:
    """A layout than which none is both faster and smaller: `time` of a frame and bytes, as in ToldCost; `lookup` is how
    many switches share a look-up at most.
    """

    entry_bits: int
    lookup: int
    bins: str
    adding: str
    time: int
    flash: int
    ram: int
    chosen: bool


@dataclass(frozen=True, slots=True)
class ToldCost:
    """What a classifier costs by the model: the `time` of a frame in `unit`, and bytes; `bound` says whether these are
    bounds, as on an AVR, or estimates.
    """

    time: int
    unit: str
    flash: int
    flash_classify: int
    ram: int
    bound: bool


@dataclass(frozen=True, slots=True)
class Told:
    """All that is told of firmware; on this machine nothing is counted, and there is no cost."""

    part: str
    layout: str
    cost: ToldCost | None
    frontier: list[LayoutRow]
    measured: "Measured | None"
    files: list[str]


def cost_told(fit: "Fit") -> ToldCost:
    """Return what the chosen layout costs."""
    cost = fit.choice.cost
    return ToldCost(cost.cycles, fit.unit, cost.flash, cost.flash_classify, cost.ram, fit.target.counted)


def layouts(fit: "Fit") -> list[LayoutRow]:
    """Return the frontier that a layout was chosen from, fastest first."""
    return [
        LayoutRow(
            entry_bits=layout.entry_bits,
            lookup=max(map(len, layout.groups), default=0),
            bins=layout.bins if layout.joints else "",
            adding=layout.adding if fit.target.kind == "avr" else "",
            time=cost.cycles,
            flash=cost.flash,
            ram=cost.ram,
            chosen=layout is fit.choice.layout,
        )
        for layout, cost in fit.choice.frontier
    ]


def frontier_table(fit: "Fit") -> Table:
    """Return the frontier as a table, the chosen layout marked."""
    table = Table(title=f"Layouts for {fit.target.part}, {fit.bound}")
    for heading in ("", "bits", "switches a look-up", "codes", "rows added", fit.unit, "flash", "RAM"):
        table.add_column(heading, justify="left" if heading in ("", "codes", "rows added") else "right")
    for row in layouts(fit):
        numbers = str(row.time), str(row.flash), str(row.ram)
        mark, lookup = "*" if row.chosen else "", str(row.lookup or "")
        table.add_row(mark, str(row.entry_bits), lookup, row.bins, row.adding, *numbers)
    return table

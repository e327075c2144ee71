"""A part, the layout of a build on it, and what that costs there; and the smallest part that holds a build."""

from contextlib import suppress
from dataclasses import dataclass
from textwrap import wrap

from thenar.runtime.model.integers import IntegerTables

from . import FirmwareError
from .costs import Cost
from .layout import GROUPS, Layout
from .targets import TARGETS, Target

_NOTE_WIDTH = 114
# avr-gcc cannot make a larger object.
_LARGEST_ARRAY = 32767
# Switches share lookups, which takes more flash and less time, unless the classifier then takes half of the flash.
_FAST_SHARE = 2


@dataclass(frozen=True, slots=True, eq=False)
class PartFit:
    """A part, the layout of a build on it, and its estimated cost; None where the part has no formula."""

    target: Target
    layout: Layout
    cost: Cost | None

    def notes(self, *more: str) -> tuple[str, ...]:
        """Return lines for an opening comment: the layout, and the notes `more`."""
        return tuple(line for note in (f"Layout {self.words}.", *more) for line in wrap(note, _NOTE_WIDTH))

    @property
    def words(self) -> str:
        """The part, the layout, and what it costs."""
        cost = "" if self.cost is None else f", {in_words(self.cost, self.target)}"
        return f"for {self.target.title or self.target.part}: {features(self.layout)}{cost}"


def features(layout: Layout) -> str:
    """Return how many switches share a lookup, in words."""
    return f"{layout.group} switches a lookup" if layout.group > 1 else "one switch a lookup"


def in_words(cost: Cost, target: Target) -> str:
    """Return a cost in words."""
    return f"about {cost.cycles} {target.unit} a frame, {cost.flash} bytes of flash, {cost.ram} of RAM"


def largest_classifier(target: Target) -> int:
    """Return the default limit of flash for a classifier: three quarters of the part's, so that scanning and sending
    have room; never more than the target's `most_flash`.
    """
    return min(target.flash * 3 // 4, target.most_flash)


def fit_for(target: Target, tables: IntegerTables, flash: int | None = None) -> PartFit:
    """Return the fit of `tables` on a target, whose flash the classifier may fill up to `flash` bytes, by default
    `largest_classifier`.

    Of the layouts, it is the fastest that takes half of the part's flash or less; otherwise the smallest. Raises
    FirmwareError if it does not fit, or the part has less flash than `flash`.
    """
    if target.any_part:
        return smallest_fit(tables, flash=flash)
    if flash is not None and flash > target.flash:
        raise FirmwareError(
            f"the classifier cannot be allowed {flash} bytes of flash: {target.named} has {target.flash} bytes"
        )
    *faster, smallest = GROUPS
    share = target.flash // _FAST_SHARE
    allowed = largest_classifier(target) if flash is None else flash
    for group in faster:
        with suppress(FirmwareError):
            fit = _fit(target, tables, group, allowed)
            if fit.cost is None or fit.cost.flash <= share:
                return fit
    return _fit(target, tables, smallest, allowed)


def _fit(target: Target, tables: IntegerTables, group: int, allowed: int) -> PartFit:
    """Return the fit with a layout, in `allowed` bytes of flash. Raises FirmwareError if it does not fit."""
    layout = Layout(tables, group)
    if target.formula is None:
        return PartFit(target, layout, None)
    rows = 4 * layout.row_pairs * layout.n_rows
    if target.avr and rows > _LARGEST_ARRAY:
        raise FirmwareError(
            f"the rows need {rows} bytes, but an array of an AVR has at most {_LARGEST_ARRAY}: compile with "
            "``linear`` 0 ``max_bins`` 16, or with fewer ``rounds``"
        )
    cost = target.formula.cost(layout, avr=target.avr)
    if cost.flash > allowed or cost.ram > target.ram:
        raise FirmwareError(
            f"the classifier takes about {cost.flash} bytes of flash and {cost.ram} of RAM on {target.named}, but "
            f"{allowed} and {target.ram} are allowed: compile with a higher ``prune``, fewer ``rounds`` or a smaller "
            "``max_bins``, or use a larger part"
        )
    return PartFit(target, layout, cost)


def smallest_fit(tables: IntegerTables, *, kind: str = "", flash: int | None = None) -> PartFit:
    """Return the smallest part that holds the tables, of those that builds carry firmware for, or those of `kind`;
    in `flash` bytes where given, or in all of the part's flash if that is less: then of parts whose flash is estimated.

    Raises FirmwareError, with the reason for the largest part, if there is none.
    """
    candidates = [
        target
        for target in TARGETS.values()
        if (target.kind == kind if kind else target.carried) and (flash is None or target.formula)
    ]
    *smaller, largest = sorted(candidates, key=lambda target: target.flash)
    for target in smaller:
        with suppress(FirmwareError):
            return fit_for(target, tables, flash and min(flash, target.flash))
    return fit_for(largest, tables, flash and min(flash, largest.flash))

"""Choosing the layout for a target: the fastest that fits its flash, and the Pareto front of the alternatives."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations, product
from math import prod
from textwrap import wrap
from typing import get_args

import numpy as np

from thenar.runtime.tables import IntegerTables

from . import FirmwareError
from .costs import Cost
from .layout import (
    LARGEST_GROUP,
    MOST_ROWS,
    SMALLEST_GROUP,
    Adding,
    Bins,
    Layout,
    Ports,
    Shared,
    arrange,
    looked_up,
    seen_by,
)
from .targets import TARGETS, Target

Option = tuple[Layout, Cost]

_NOTE_WIDTH = 114
# avr-gcc cannot make a larger object.
_LARGEST_ARRAY = 32767


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """The layout chosen, the most it costs, and the reason, in a sentence.

    frontier is the Pareto front of cycles and flash, from the fastest to the smallest, including layouts that do not
    fit.
    """

    layout: Layout
    cost: Cost
    why: str
    frontier: tuple[Option, ...]


def choose(
    tables: IntegerTables,
    target: Target,
    *,
    ports: Ports | None = None,
    flash: int | None = None,
    entry_bits: int | None = None,
) -> Choice:
    """Return the layout of `tables` whose classify() is the fastest in at most `flash` bytes, of equally fast ones the
    smallest. Every layout has the same scores, however wide its entries are.

    ports are the wiring of the switches, as in `arrange`.

    flash is by default one of `flash_shares`; entry_bits allows only 8 or 16, by default both where possible.
    Raises FirmwareError if no layout fits, the tables cannot be laid out, or the part has less flash than `flash`.
    """
    if flash is not None and flash > target.flash:
        raise FirmwareError(
            f"the classifier cannot be allowed {flash} bytes of flash: {target.named} has {target.flash} bytes"
        )
    options = [(layout, target.cost(layout)) for layout in _layouts(tables, target, ports, entry_bits)]
    best = frontier(options)
    for allowed in flash_shares(target) if flash is None else (flash,):
        for layout, cost in best:
            if cost.flash <= allowed and cost.ram <= target.ram:
                return Choice(layout, cost, _why(layout, cost, len(options), allowed, target), best)
    smallest = best[-1][1]
    raise FirmwareError(
        f"the smallest layout for {target.part} takes {smallest.flash} bytes of flash and {smallest.ram} of RAM, but "
        f"{allowed} and {target.ram} are allowed: compile with a higher --prune, fewer --rounds or --table-bits 8, "
        "or use a larger part"
    )


def frontier(options: Iterable[Option]) -> tuple[Option, ...]:
    """Return the Pareto front of the options in cycles and flash, from the fastest to the smallest.

    Options of several builds may be mixed, for example of one compiled with 8 and with 16 table bits.
    """
    best: list[Option] = []
    for option in sorted(options, key=lambda option: (option[1].cycles, option[1].flash)):
        if not best or option[1].flash < best[-1][1].flash:
            best.append(option)
    return tuple(best)


def flash_shares(target: Target) -> tuple[int, int]:
    """Return the default bytes of flash for a classifier: half of the part's, so that scanning and sending have room,
    then three quarters, if half is too little; never more than the target's `most_flash`.
    """
    return min(target.flash // 2, target.most_flash), min(target.flash * 3 // 4, target.most_flash)


def _layouts(tables: IntegerTables, target: Target, ports: Ports | None, entry_bits: int | None) -> Iterator[Layout]:
    """Yield all possible layouts. Raises FirmwareError if there is none, with the reason against the widest entries."""
    refused: dict[int, FirmwareError] = {}
    found = False
    sizes = range(SMALLEST_GROUP, LARGEST_GROUP + 1) if tables.n_switches else [SMALLEST_GROUP]
    for bits, size, bins in product((8, 16) if entry_bits is None else (entry_bits,), sizes, _bins(tables)):
        try:
            for shared in _sharings(tables, -(-tables.n_switches // size)):
                layout = arrange(tables, ports=ports, group_size=size, entry_bits=bits, bins=bins, shared=shared)
                rows = layout.n_rows * layout.parts.width * len(layout.parts.firsts) * layout.entry_bits // 8
                if target.avr and rows > _LARGEST_ARRAY:
                    raise FirmwareError(
                        f"the rows need {rows} bytes, but an array of an AVR has at most {_LARGEST_ARRAY}: compile "
                        "with --linear 0 --max-bins 16, or with fewer --rounds"
                    )
                found = True
                yield from (replace(layout, adding=adding) for adding in _addings(target))
        except FirmwareError as reason:
            refused.setdefault(bits, reason)
    if not found:
        raise refused[max(refused)]


def _sharings(tables: IntegerTables, n_groups: int) -> Iterator[tuple[Shared, ...]]:
    """Yield which joints, and groups of switches, share lookups: at first none, then each time the two lookups whose
    merging adds the fewest rows.
    """
    sizes = [len(part) for part in np.array_split(np.arange(tables.n_switches), n_groups)] if n_groups else []
    held: list[tuple[int, Shared]] = [(1 << size, (group, ())) for group, size in enumerate(sizes)]
    seen = {number: dict(seen_by(tables, number)) for number in looked_up(tables)}
    held += [(prod(len(steps) + 1 for steps in of.values()), (None, (number,))) for number, of in seen.items()]
    yield ()
    while True:
        pairs = [
            (one[0] * other[0] - one[0] - other[0], a, b)
            for (a, one), (b, other) in combinations(enumerate(held), 2)
            if one[0] * other[0] <= MOST_ROWS
            and other[1][1]
            and (one[1][0] is None or other[1][0] is None)
            and not any(seen[x].keys() & seen[y].keys() for x, y in product(one[1][1], other[1][1]))
        ]
        if not pairs:
            return
        _, a, b = min(pairs)
        one, other = held[a], held.pop(b)
        joined = one[1][0] if other[1][0] is None else other[1][0], one[1][1] + other[1][1]
        held[a] = one[0] * other[0], joined
        yield tuple(shared for _, shared in held if len(shared[1]) + (shared[0] is not None) > 1)


def _bins(tables: IntegerTables) -> tuple[Bins, ...]:
    return ("search", "trimmed", "direct") if tables.n_joints else ("direct",)


def _addings(target: Target) -> tuple[Adding, ...]:
    """Return the ways of adding rows; where a compiler makes the code, it decides."""
    return get_args(Adding) if target.avr else ("called",)


def features(layout: Layout, target: Target) -> str:
    """Return a description of how `layout` lies in flash, and on an AVR how its rows are added."""
    halves = ", the upper halves of steps" if layout.entry_shift else ""
    parts = [f"{layout.entry_bits}-bit entries{' and sums' if layout.sum_bits == 8 else halves}"]
    if layout.groups:
        parts.append(f"up to {max(map(len, layout.groups))} switches per lookup")
    if layout.joints:
        parts.append(
            {
                "direct": "codes looked up in 256 bytes a joint",
                "trimmed": "codes looked up between the first and the last threshold of a joint",
                "search": "codes compared with thresholds",
            }[layout.bins]
        )
        if (most := max((len(lookup.joints) for lookup in layout.lookups), default=0)) > 1:
            parts.append(f"up to {most} joints per lookup")
    if layout.tables.slopes:
        parts.append("codes multiplied")
    if target.avr:
        parts.append({"called": "rows added by one routine", "unrolled": "rows added in line"}[layout.adding])
    return ", ".join(parts)


def _why(layout: Layout, cost: Cost, tried: int, allowed: int, target: Target) -> str:
    return (
        f"{features(layout, target)}: the fastest of {tried} layouts in {allowed} bytes of flash, "
        f"{target.bound} {cost.cycles} {target.unit} ({cost.update_cycles} by update()) and {cost.flash} bytes"
    )


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A part, and the layout chosen for it."""

    target: Target
    choice: Choice

    def notes(self, *more: str) -> tuple[str, ...]:
        """Return lines for an opening comment: the layout, the reason for it, and the notes `more`."""
        return tuple(line for note in (f"Layout {self.words}.", *more) for line in wrap(note, _NOTE_WIDTH))

    @property
    def words(self) -> str:
        """The layout and the reason for it, in a sentence."""
        if not self.target.own_layout:
            what = features(self.choice.layout, self.target)
            return f"for {self.target.title}: {what}, as on the smallest part that holds the build"
        return f"for {self.target.part}: {self.choice.why}"


def fit_for(target: Target, tables: IntegerTables, flash: int | None = None, ports: Ports | None = None) -> Fit:
    """Return the part of a target, and the layout chosen for it, in `flash` bytes where given; `ports` as in `choose`.

    Raises FirmwareError if no layout fits.
    """
    if target.own_layout:
        return Fit(target, choose(tables, target, ports=ports, flash=flash))
    fit = smallest_fit(tables, flash=flash, ports=ports)
    return fit if target.any_part else Fit(target, fit.choice)


def smallest_fit(tables: IntegerTables, *, kind: str = "", flash: int | None = None, ports: Ports | None = None) -> Fit:
    """Return the smallest part that holds the tables, of those that builds carry firmware for, or those of `kind`;
    in `flash` bytes where given, or in all of the part's flash if that is less.

    Raises FirmwareError, with the reason for the largest part, if there is none.
    """
    candidates = [target for target in TARGETS.values() if (target.kind == kind if kind else target.carried)]
    *smaller, largest = sorted(candidates, key=lambda target: target.flash)
    for target in smaller:
        with suppress(FirmwareError):
            return _fit(tables, target, flash, ports)
    return _fit(tables, largest, flash, ports)


def _fit(tables: IntegerTables, target: Target, flash: int | None, ports: Ports | None) -> Fit:
    most = None if flash is None else min(flash, target.flash)
    return Fit(target, choose(tables, target, ports=ports, flash=most))

"""The cost of a classifier on a part, and with it the layout of a build there, and the smallest part that holds it.

It is estimated without a compiler: flash is the size of the compiled core and the exact bytes of the tables, RAM is
exact. Time is a sum of a few terms, whose coefficients `benchmarks/firmwarefit.py` fits to the cycles that simavr
counts, or the instructions that qemu counts, for the slowest of many frames. A slow test bounds the errors. Or it is
measured: the classifier is compiled, and runs in a simulator.
"""

from contextlib import suppress
from dataclasses import dataclass
from textwrap import wrap

import numpy as np

from thenar.runtime.model.integers import IntegerTables

from . import FirmwareError
from .classifier import Library
from .layout import GROUPS, Layout
from .probes import Predictions, Unit, extreme_frames, joined, random_frames
from .straight import straight
from .targets import TARGETS, Target
from .targets.base import Formula
from .tools import STRICT, call, compile_objects, find, workshop

NAME_BYTES = 16  # of a grasp type's name, its end included, where the names are not known
_NOTE_WIDTH = 114
CORE_SUM = 1288  # bytes of thenar_sum() on an AVR
# avr-gcc cannot make a larger object.
_LARGEST_ARRAY = 32767
# Switches share lookups, which takes more flash and less time, unless the classifier then takes half of the flash.
_FAST_SHARE = 2
_RANDOM = 2000
# The linker can remove uncalled code only if it has a separate section.
_SECTIONS = ("-ffunction-sections", "-fdata-sections")
_CALLED = tuple(f"thenar_{function}" for function in ("init", "set_switch", "set_code", "classify", "name"))


@dataclass(frozen=True, slots=True)
class Cost:
    """The estimated cost of a classifier.

    cycles  of thenar_classify() for the slowest frame; instructions except on an AVR
    flash   bytes of all of it, with names of grasp types of up to 15 bytes, without rejection and segments
    ram     bytes of a hand, without the stack
    """

    cycles: int
    flash: int
    ram: int


def estimate(formula: Formula, layout: Layout, *, avr: bool) -> Cost:
    """Return the cost of a layout on a core."""
    time = sum(np.multiply(formula.cycles, [*terms(layout, avr=avr).values()]))
    flash = formula.flash + table_bytes(layout, avr=avr) + NAME_BYTES * layout.tables.n_classes
    return Cost(round(time), flash, formula.ram + 2 * layout.memory)


def table_bytes(layout: Layout, *, avr: bool) -> int:
    """Return the bytes of flash of the tables, without names and rejection.

    Straight-line code takes the place of tables; the linker then leaves out a part of the core.
    """
    tables = layout.tables
    means = (tables.n_switches + tables.n_joints) * (tables.n_classes + 1)
    if avr and (function := straight(layout)) is not None:
        return means + 2 * len(function.instructions) - CORE_SUM
    bins, lines = len(layout.binned), len(tables.lines)
    slopes = lines * layout.row_pairs * (2 if avr else 4)
    terms = 8 * (bins + lines) + 18 * len(tables.grids)
    return 4 * layout.row_pairs * layout.n_rows + slopes + terms + 2 * len(layout.thresholds) + means


def terms(layout: Layout, *, avr: bool) -> dict[str, int]:
    """Return how often each term of the time occurs in a layout.

    one           for the core
    blocks        of eight grasp types, which are added up at once
    bytes         of switches
    groups        of switches, whose rows are found
    rows, lines   that are added, in all blocks
    distances     of lines, and `shifts` of their codes
    bins, halves  joints whose thresholds are searched, and the comparisons
    classes       whose sums are compared
    calls         of straight-line code instead of the core, and its `cycles`
    """
    tables, blocks = layout.tables, -(-layout.row_pairs // 4)
    function = straight(layout) if avr else None
    core = {
        "one": 1,
        "blocks": blocks,
        "bytes": -(-tables.n_switches // 8),
        "groups": len(layout.groups),
        "rows": layout.found * blocks,
        "lines": len(tables.lines) * blocks,
        "distances": len(tables.lines),
        "shifts": sum(abs(line.shift) for line in tables.lines),
        "bins": len(layout.bins),
        "halves": sum(len(bins.thresholds).bit_length() for bins in layout.bins),
    }
    if function is not None:
        core = dict.fromkeys(core, 0)
    cycles = 0 if function is None else function.cycles
    return core | {"classes": tables.n_classes, "calls": int(function is not None), "cycles": cycles}


@dataclass(frozen=True, slots=True, eq=False)
class PartFit:
    """A part, the layout of a build on it, and its estimated cost; None where the part has no formula."""

    target: Target
    layout: Layout
    cost: Cost | None

    def notes(self, *more: str) -> tuple[str, ...]:
        """Return lines for an opening comment: the cost, and the notes `more`."""
        costs = () if self.cost is None else (f"Cost {self.words}.",)
        return tuple(line for note in (*costs, *more) for line in wrap(note, _NOTE_WIDTH))

    @property
    def words(self) -> str:
        """The part, and what the build costs on it."""
        said = f"for {self.target.title or self.target.part}"
        if (cost := self.cost) is None:
            return said
        return f"{said}: about {cost.cycles} {self.target.unit} a frame, {cost.flash} bytes of flash, {cost.ram} of RAM"


def fit_for(target: Target, tables: IntegerTables, flash: int | None = None) -> PartFit:
    """Return the fit of `tables` on a target, whose flash the classifier may fill up to `flash` bytes, by default three
    quarters, so that scanning and sending have room, and never more than its `most_flash`.

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
    allowed = min(target.flash * 3 // 4, target.most_flash) if flash is None else flash
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
    if target.avr and rows > _LARGEST_ARRAY and straight(layout) is None:
        raise FirmwareError(
            f"the rows need {rows} bytes, but an array of an AVR has at most {_LARGEST_ARRAY}: compile with "
            "trainer ``logit`` and ``max_bins`` 16, or with fewer ``rounds``"
        )
    cost = estimate(target.formula, layout, avr=target.avr)
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


@dataclass(frozen=True, slots=True)
class Measured:
    """The measured cost of a classifier: its slowest frame in `unit`; bytes of stack (None: not measured), flash, RAM.

    flash is that of a program that calls init(), set_switch(), set_code(), classify() and name().
    """

    part: str
    time: int
    unit: Unit
    stack: int | None
    flash: int
    ram: int

    @property
    def note(self) -> str:
        """The measurements, as a sentence."""
        stack = "" if self.stack is None else f" and {self.stack} of stack"
        return (
            f"Measured on {self.part}: at most {self.time} {self.unit} a frame; {self.flash} bytes of flash; "
            f"{self.ram} bytes of RAM{stack}."
        )


def measure(library: Library, fit: PartFit) -> Measured:
    """Compile a classifier, run extreme and random frames, and return the measured maxima.

    Raises FirmwareError where a tool is missing, or for a part whose simulator does not count.
    """
    target = fit.target
    if lack := target.missing():
        raise FirmwareError(f"firmware for {target.part} cannot be measured here: {lack}")
    predictions = run_counted(library, target)
    flash, ram = sizes(library, target)
    return Measured(target.part, predictions.most, predictions.unit, predictions.stack, flash, ram)


def run_counted(library: Library, target: Target) -> Predictions:
    """Return the predictions of extreme and random frames, of which one is among the slowest, and their cost on a
    target that counts it; raise FirmwareError elsewhere.
    """
    tables = library.layout.tables
    frames = joined(extreme_frames(tables), random_frames(tables, _RANDOM, seed=1))
    sent = library.layout.frame_bytes(frames.bits, frames.codes)
    predictions = target.run(library.files, library.name, library.layout, sent)
    if predictions.cost is None:
        raise FirmwareError(f"nothing was counted on {target.part}")
    return predictions


def sizes(library: Library, target: Target) -> tuple[int, int]:
    """Return the bytes of flash and of RAM of a classifier and a hand, without functions that are not called."""
    if target.compiler is None:
        raise FirmwareError(f"the target {target.name} has no compiler here: nothing can be measured")
    name = f"thenar_{library.name}"
    sources = sorted(path for path in library.files if path.endswith(".c"))
    called = [f"-Wl,-u,{symbol}" for symbol in ("hand", "memory", f"{name}_model", *_CALLED)]
    hand = f'#include "{name}.h"\nextern thenar hand;\nextern uint16_t memory[];\nthenar hand;\n'
    hand += f"uint16_t memory[THENAR_{library.name.upper()}_MEMORY];\n"
    with workshop({**library.files, "hand.c": hand}) as folder:
        compiling = [compiler := find(target.compiler), *target.flags]
        objects = compile_objects([*compiling, *STRICT, *_SECTIONS], [*sources, "hand.c"], folder)
        linking = [*compiling, "-nostartfiles", "-nostdlib", "-Wl,--gc-sections,-e,thenar_classify", *called]
        call([*linking, *objects, "-lgcc", "-o", "linked.elf"], folder)
        line = call([compiler.removesuffix("gcc") + "size", "linked.elf"], folder).decode().splitlines()[1]
    text, data, bss = map(int, line.split()[:3])
    return text + data, data + bss

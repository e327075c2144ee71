"""What a layout costs on a target, without compiling it."""

from dataclasses import dataclass

from . import word_costs
from .avr_costs import AvrCosts
from .layout import Layout
from .targets import Target

__all__ = ["Cost", "cost_of"]

NAME_BYTES = 16  # all names take as much room as the longest, and there is one more, which is empty


@dataclass(frozen=True, slots=True)
class Cost:
    """What a classifier takes at most.

    cycles          that classify() takes for any frame; elsewhere than on an AVR instructions
    update_cycles   that update() takes, whatever has changed
    flash           bytes of all of it, with names of grasp types of up to 15 bytes
    flash_classify  of these, bytes that a program has which never calls update(), where the linker leaves out what is
                    not called (--gc-sections; code in C compiled with -ffunction-sections)
    ram             bytes, stack included, whichever of the two is called
    """

    cycles: int
    update_cycles: int
    flash: int
    flash_classify: int
    ram: int


def cost_of(layout: Layout, target: Target) -> Cost:
    """Return a bound on what the classifier of that layout costs on `target`.

    On an AVR the cycles are those of the worst frame that one could think of, counted instruction by instruction, and
    flash and RAM a few bytes more than there are; elsewhere all are rough.
    """
    names = NAME_BYTES * (layout.tables.n_classes + 1)
    if target.kind == "avr":
        costs = AvrCosts(layout, target)
        flash = costs.flash + names
        return Cost(costs.most_cycles, costs.most_update_cycles, flash, flash - costs.update_flash, costs.ram)
    without = word_costs.flash(layout) + names
    whole = without + word_costs.update_flash(layout)
    times = word_costs.instructions(layout, target), word_costs.update_instructions(layout, target)
    return Cost(*times, whole, without, word_costs.ram(layout))

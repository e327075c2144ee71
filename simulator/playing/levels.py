"""Closed switches as the pin levels of the expanders that they hang on."""

from collections.abc import Mapping, Sequence

from thenar.runtime.harness.wiring import ChipWiring

_ALL_HIGH = (1 << 24) - 1


def levels_of(chip: ChipWiring, closed: Sequence[bool], numbers: Mapping[str, int]) -> int:
    """Return the levels of a chip's pins, bit p for pin p: open pins are pulled to where no switch is closed.

    numbers are the places in `closed` of the switches by name; a switch that is not among them is open.
    """
    shut = sum(1 << pin for pin, name in chip.numbered_pins.items() if name in numbers and closed[numbers[name]])
    return shut if chip.closed == "high" else _ALL_HIGH & ~shut

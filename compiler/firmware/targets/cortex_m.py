"""Cortex-M cores with small memories."""

from functools import partial

from ..costs import RAM_OF_32_BITS, Formula
from ..tools import ARM_COMPILER
from .base import Target

_core = partial(
    Target,
    help="a library for this core, to link with the vendor's start-up code",
    compiler=ARM_COMPILER,
    size=(("arm-none-eabi-size",), "binutils-arm-none-eabi"),
)

# The clocks are those of common boards: SAMD21 (Arduino Zero), nRF52840 (Arduino Nano 33 BLE).
MEMBER = (
    _core(
        name="cortex-m0plus",
        part="cortex-m0plus",
        title="Cortex-M0+",
        rank=20,
        flash=128 << 10,
        ram=16 << 10,
        clock_hz=48_000_000,
        formula=Formula(
            cycles={
                "word classes": 8.259,
                "byte classes": 9.346,
                "class passes": 3.748,
                "lookups": 3.293,
                "kept lookups": 0.09885,
                "words": 2.733,
                "entries": 0.1517,
                "offsets": 0.3408,
                "split words": 5.375,
                "fields": 2.773,
                "bins": 10.21,
                "thresholds": 2.692,
                "searches": 3.953,
                "lines": 20.09,
                "line sums": 1.197,
            },
            flash={
                "one": 309.2,
                "word classes": 63.03,
                "byte classes": 52.78,
                "found": 68.57,
                "split code": 1.86,
                "fields": 21.58,
                "thresholds": 10.52,
                "lines": 11.08,
                "padded rows": 0.8684,
                "tables": 1.199,
            },
            ram=RAM_OF_32_BITS,
        ),
        flags=("-mcpu=cortex-m0plus", "-mthumb", "-O2", "-ffreestanding"),
    ),
    _core(
        name="cortex-m4",
        part="cortex-m4",
        title="Cortex-M4",
        rank=21,
        carried=True,
        flash=256 << 10,
        ram=64 << 10,
        clock_hz=64_000_000,
        formula=Formula(
            cycles={
                "one": 7.608,
                "word classes": 6.712,
                "byte classes": 7.74,
                "class passes": 1.735,
                "lookups": 3.71,
                "kept lookups": 3.2,
                "words": 1.642,
                "split words": 2.338,
                "fields": 0.4723,
                "bins": 9.179,
                "thresholds": 2.966,
                "searches": 4.901,
                "lines": 9.009,
                "line sums": 1.156,
            },
            flash={
                "one": 356.9,
                "word classes": 47.04,
                "byte classes": 41.49,
                "found": 62.97,
                "found words": 3.396,
                "split code": 14.37,
                "fields": 19.87,
                "thresholds": 14.28,
                "lines": 18.16,
                "padded rows": 0.8981,
                "tables": 1.318,
            },
            ram=RAM_OF_32_BITS,
        ),
        flags=("-mcpu=cortex-m4", "-mthumb", "-O2", "-ffreestanding"),
    ),
)

"""Cortex-M cores with small memories."""

from functools import partial

from ..costs import Formula
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
                "word classes": 8.81,
                "byte classes": 9.115,
                "class passes": 2.073,
                "lookups": 7.618,
                "words": 2.821,
                "split words": 8.896,
                "fields": 1.16,
                "bins": 9.426,
                "thresholds": 1.838,
                "searches": 6.695,
                "lines": 8.206,
                "line sums": 2.285,
            },
            flash={
                "one": 738.1,
                "word classes": 30.01,
                "byte classes": 36.49,
                "found": 47.55,
                "found words": 0.4321,
                "split code": 69.12,
                "thresholds": 6.641,
                "lines": 28.34,
                "line sums": 2.016,
                "padded rows": 1.034,
                "tables": 1.141,
            },
            ram={
                "one": 7.151,
                "word classes": 6.525,
                "byte classes": 4.112,
                "found": 1.57,
                "sum words": 0.179,
                "compared codes": 1.618,
                "ports": 3.16,
                "input": 2.195,
            },
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
                "one": 3.158,
                "word classes": 6.449,
                "byte classes": 7.557,
                "passes": 13.26,
                "class passes": 1.563,
                "lookups": 2.853,
                "kept lookups": 1.605,
                "words": 1.735,
                "entries": 0.09017,
                "offsets": 0.05878,
                "split words": 3.552,
                "fields": 0.8091,
                "bins": 9.137,
                "thresholds": 2.803,
                "searches": 5.785,
                "lines": 15.47,
                "line sums": 0.5279,
            },
            flash={
                "one": 680.3,
                "word classes": 28.18,
                "byte classes": 32.47,
                "found": 34.54,
                "found words": 12.38,
                "split code": 58.0,
                "fields": 28.04,
                "thresholds": 15.71,
                "lines": 17.5,
                "line sums": 2.992,
                "padded rows": 0.7458,
                "tables": 1.378,
            },
            ram={
                "one": 7.151,
                "word classes": 6.525,
                "byte classes": 4.112,
                "found": 1.57,
                "sum words": 0.179,
                "compared codes": 1.618,
                "ports": 3.16,
                "input": 2.195,
            },
        ),
        flags=("-mcpu=cortex-m4", "-mthumb", "-O2", "-ffreestanding"),
    ),
)

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
                "word classes": 9.864,
                "byte classes": 10.34,
                "class passes": 2.442,
                "lookups": 3.496,
                "kept lookups": 2.245,
                "words": 2.789,
                "offsets": 0.5094,
                "split words": 1.588,
                "fields": 4.119,
                "bins": 10.92,
                "thresholds": 2.815,
                "searches": 4.025,
                "lines": 13.28,
                "line sums": 2.185,
            },
            flash={
                "one": 819.9,
                "word classes": 8.753,
                "byte classes": 23.17,
                "class passes": 17.96,
                "words": 1.951,
                "found": 21.42,
                "found words": 11.91,
                "split code": 80.73,
                "thresholds": 9.43,
                "lines": 40.73,
                "line sums": 5.412,
                "padded rows": 0.8536,
                "tables": 1.185,
            },
            ram={
                "one": 5.841,
                "word classes": 6.592,
                "byte classes": 3.897,
                "found": 0.8046,
                "compared codes": 1.388,
                "ports": 6.219,
                "input": 2.505,
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
                "one": 15.36,
                "word classes": 6.363,
                "byte classes": 7.673,
                "class passes": 1.977,
                "lookups": 2.451,
                "kept lookups": 2.786,
                "words": 1.911,
                "split words": 3.815,
                "fields": 0.07109,
                "bins": 8.678,
                "thresholds": 2.91,
                "searches": 5.71,
                "lines": 13.94,
                "line sums": 0.633,
            },
            flash={
                "one": 667.1,
                "word classes": 31.07,
                "byte classes": 25.97,
                "found": 33.36,
                "found words": 13.91,
                "split code": 62.18,
                "fields": 1.66,
                "bins": 11.13,
                "thresholds": 17.28,
                "lines": 11.74,
                "line sums": 4.863,
                "rows": 0.07532,
                "padded rows": 0.6872,
                "tables": 1.322,
            },
            ram={
                "one": 5.841,
                "word classes": 6.592,
                "byte classes": 3.897,
                "found": 0.8046,
                "compared codes": 1.388,
                "ports": 6.219,
                "input": 2.505,
            },
        ),
        flags=("-mcpu=cortex-m4", "-mthumb", "-O2", "-ffreestanding"),
    ),
)

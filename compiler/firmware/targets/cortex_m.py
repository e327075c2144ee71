"""Cortex-M cores with small memories."""

from functools import partial

from ..tools import ARM_COMPILER
from .base import Formula, Target

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
                "one": 89.82,
                "blocks": 68.67,
                "classes": 8.596,
                "bytes": 16.26,
                "groups": 11.75,
                "rows": 14.72,
                "lines": 18.27,
                "distances": 20.59,
                "bins": 35.78,
                "halves": 8.602,
            },
            flash=1352,
            ram=34,
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
                "one": 59.15,
                "blocks": 63.09,
                "classes": 7.146,
                "bytes": 5.679,
                "groups": 8.195,
                "rows": 12.72,
                "lines": 13.35,
                "distances": 17.21,
                "bins": 18.28,
                "halves": 7.998,
            },
            flash=1340,
            ram=34,
        ),
        flags=("-mcpu=cortex-m4", "-mthumb", "-O2", "-ffreestanding"),
    ),
)

"""Cortex-M cores with small memories."""

from functools import partial

from ..costs import Core, Updating
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
        core=Core(
            fixed=35,
            a_class=7,
            in_parts=12,
            lookup=4,
            found=9,
            part=0,
            pair=3,
            quad=6,
            updating=Updating(
                fixed=0,
                a_class=15,
                in_parts=4,
                noted=16,
                added=1,
                pair=4,
                quad=3,
                split=27,
                moved=11,
                moved_part=14,
                product=4,
                halves=2,
            ),
            product=5,
            compared=3,
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
        flags=("-mcpu=cortex-m4", "-mthumb", "-O2", "-ffreestanding"),
    ),
)

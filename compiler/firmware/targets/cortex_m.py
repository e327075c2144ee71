"""Cortex-M cores with small memories, which match the qemu machines that test such firmware.

qemu 7 has no Cortex-M0+, but a Cortex-M0, on the micro:bit, with the same instructions (ARMv6-M); it rejects those of a
larger core. Code for a Cortex-M4 runs on Arm's MPS2 board with image AN386, which has that core. SysTick counts
instructions; its 24 bits are enough for a million.
"""

from functools import partial

from ..costs import Core, Updating
from ..tools import ARM_COMPILER, ARM_EMULATOR
from .bare import Bare, Machine

_SHIFT = 9

_core = partial(
    Bare,
    architecture="arm",
    prefix="arm-none-eabi-",
    emulator=ARM_EMULATOR,
    help="a library for this core, with start-up, Makefile and a self test in qemu",
    next_step="`make -C {folder} check` compiles and tests it",
    kind="cortex-m",
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
        board="st_nucleo_g0",
        machine=Machine("microbit", 256 << 10, 16 << 10, 16_000_000, _SHIFT),
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
        board="st_nucleo_f4",
        machine=Machine("mps2-an386", 4 << 20, 4 << 20, 25_000_000, _SHIFT),
    ),
)

"""Cores with small memories: Cortex-M, and RV32IMAC, a 32-bit RISC-V core with multiplication and compressed code."""

from functools import partial

from ..tools import ARM_COMPILER, RISCV_COMPILER
from .base import Formula, Target

_core = partial(Target, help="a library for this core, to link with the vendor's start-up code")
_cortex = partial(_core, compiler=ARM_COMPILER, size=(("arm-none-eabi-size",), "binutils-arm-none-eabi"))

# Memories and clocks are those of common boards: SAMD21 (Arduino Zero), nRF52840 (Arduino Nano 33 BLE), GD32VF103CB
# (Longan Nano).
MEMBER = (
    _cortex(
        name="cortex-m0plus",
        part="cortex-m0plus",
        title="Cortex-M0+",
        rank=20,
        flash=128 << 10,
        ram=16 << 10,
        clock_hz=48_000_000,
        formula=Formula((96.78, 72.76, 9.603, 14.78, 17.42, 22.0, 0, 33.64, 8.781, 8.008, 0, 0), 1388, 32),
        flags=("-mcpu=cortex-m0plus", "-mthumb", "-O2", "-ffreestanding"),
    ),
    _cortex(
        name="cortex-m4",
        part="cortex-m4",
        title="Cortex-M4",
        rank=21,
        carried=True,
        flash=256 << 10,
        ram=64 << 10,
        clock_hz=64_000_000,
        formula=Formula((46.37, 66.5, 8.103, 13.06, 13.47, 17.3, 0, 16.47, 8.256, 8.515, 0, 0), 1404, 32),
        flags=("-mcpu=cortex-m4", "-mthumb", "-O2", "-ffreestanding"),
    ),
    _core(
        name="rv32imac",
        part="rv32imac",
        title="RV32IMAC",
        rank=22,
        flash=128 << 10,
        ram=16 << 10,
        clock_hz=108_000_000,
        formula=Formula((73.66, 48.29, 10.25, 13.94, 16.44, 19.31, 0, 19.62, 8.578, 5.663, 0, 0), 1452, 32),
        compiler=RISCV_COMPILER,
        size=(("riscv64-unknown-elf-size",), "binutils-riscv64-unknown-elf"),
        flags=("-march=rv32imac", "-mabi=ilp32", "-misa-spec=2.2", "-O2", "-ffreestanding"),
    ),
)
M0PLUS, M4, RV32 = (core.formula for core in MEMBER)
"""The costs on these cores, which others resemble."""

"""Cores with small memories: Cortex-M, and RV32IMAC, a 32-bit RISC-V core with multiplication and compressed code."""

from functools import partial

from ..tools import ARM_COMPILER, RISCV_COMPILER
from .base import Formula, Target

_core = partial(Target, help="C files for this core, to compile into your project")
_cortex = partial(_core, compiler=ARM_COMPILER)

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
        formula=Formula((112.7, 66.9, 14.47, 12.24, 14.86, 17.76, 20.65, 0, 36.79, 8.557, 6.684, 0, 0), 1456, 32),
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
        formula=Formula((59.97, 62.82, 2.632, 8.438, 13.09, 13.04, 18.43, 0, 16.85, 8.205, 7.766, 0, 0), 1428, 32),
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
        formula=Formula((85.24, 37.89, 8.52, 8.935, 13.89, 16.45, 18.55, 0, 20.28, 8.469, 5.186, 0, 0), 1488, 32),
        compiler=RISCV_COMPILER,
        flags=("-march=rv32imac", "-mabi=ilp32", "-misa-spec=2.2", "-O2", "-ffreestanding"),
    ),
)
M0PLUS, M4, RV32 = (core.formula for core in MEMBER)
"""The costs on these cores, which others resemble."""

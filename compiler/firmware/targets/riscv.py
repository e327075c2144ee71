"""A 32-bit RISC-V core with multiplication and compressed instructions: RV32IMAC, as in a GD32VF103 or an FE310."""

from dataclasses import replace

from ..costs import CORTEX_M4, Updating
from ..tools import RISCV_COMPILER
from .base import Target

# Flash, RAM and clock are those of the GD32VF103CB (Longan Nano).
MEMBER = Target(
    name="rv32imac",
    part="rv32imac",
    title="RV32IMAC",
    help="a library for this core, to link with the vendor's start-up code",
    rank=22,
    flash=128 << 10,
    ram=16 << 10,
    clock_hz=108_000_000,
    core=replace(
        CORTEX_M4,
        fixed=40,
        in_parts=7,
        part=2,
        quad=4,
        updating=Updating(
            fixed=15,
            a_class=6,
            in_parts=3,
            noted=2,
            added=17,
            pair=2,
            quad=2,
            split=3,
            moved=6,
            moved_part=10,
            product=4,
            halves=8,
        ),
    ),
    compiler=RISCV_COMPILER,
    size=(("riscv64-unknown-elf-size",), "binutils-riscv64-unknown-elf"),
    flags=("-march=rv32imac", "-mabi=ilp32", "-misa-spec=2.2", "-O2", "-ffreestanding"),
)

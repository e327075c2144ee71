"""A 32-bit RISC-V core with multiplication and compressed instructions: RV32IMAC, as in a GD32VF103 or an FE310."""

from ..costs import RAM_OF_32_BITS, Formula
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
    formula=Formula(
        cycles={
            "one": 3.74,
            "word classes": 5.295,
            "byte classes": 5.719,
            "class passes": 1.495,
            "lookups": 4.262,
            "kept lookups": 1.654,
            "words": 1.918,
            "split words": 3.927,
            "fields": 1.511,
            "bins": 10.43,
            "thresholds": 2.089,
            "searches": 8.181,
            "lines": 10.08,
            "line sums": 1.448,
        },
        flash={
            "one": 256.3,
            "word classes": 54.65,
            "byte classes": 63.34,
            "found": 85.79,
            "split code": 20.16,
            "fields": 35.81,
            "thresholds": 16.55,
            "lines": 12.85,
            "padded rows": 0.8083,
            "tables": 1.392,
        },
        ram=RAM_OF_32_BITS,
    ),
    compiler=RISCV_COMPILER,
    size=(("riscv64-unknown-elf-size",), "binutils-riscv64-unknown-elf"),
    flags=("-march=rv32imac", "-mabi=ilp32", "-misa-spec=2.2", "-O2", "-ffreestanding"),
)

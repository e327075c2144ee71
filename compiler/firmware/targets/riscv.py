"""A 32-bit RISC-V core with multiplication and compressed instructions: RV32IMAC, as in a GD32VF103 or an FE310."""

from ..costs import Formula
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
            "one": 25.33,
            "word classes": 1.311,
            "byte classes": 4.506,
            "class passes": 3.077,
            "lookups": 1.863,
            "kept lookups": 2.996,
            "words": 2.058,
            "split words": 4.838,
            "fields": 4.996,
            "bins": 9.943,
            "thresholds": 2.381,
            "searches": 8.386,
            "lines": 13.57,
            "line sums": 1.362,
        },
        flash={
            "one": 684.7,
            "word classes": 36.29,
            "byte classes": 53.4,
            "found": 45.14,
            "found words": 6.774,
            "split code": 46.81,
            "fields": 67.3,
            "bins": 105.4,
            "thresholds": 15.88,
            "lines": 29.96,
            "line sums": 4.674,
            "padded rows": 0.8161,
            "tables": 0.9165,
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
    compiler=RISCV_COMPILER,
    size=(("riscv64-unknown-elf-size",), "binutils-riscv64-unknown-elf"),
    flags=("-march=rv32imac", "-mabi=ilp32", "-misa-spec=2.2", "-O2", "-ffreestanding"),
)

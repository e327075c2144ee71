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
            "one": 19.28,
            "word classes": 2.576,
            "byte classes": 4.924,
            "class passes": 2.152,
            "lookups": 4.237,
            "kept lookups": 1.805,
            "words": 1.955,
            "offsets": 0.05349,
            "split words": 4.41,
            "fields": 3.339,
            "bins": 8.181,
            "thresholds": 1.76,
            "searches": 10.56,
            "lines": 12.06,
            "line sums": 1.605,
        },
        flash={
            "one": 708.6,
            "word classes": 31.12,
            "byte classes": 45.97,
            "found": 46.79,
            "found words": 6.19,
            "split code": 47.92,
            "fields": 54.62,
            "bins": 56.49,
            "thresholds": 14.45,
            "lines": 60.59,
            "padded rows": 0.8864,
            "tables": 1.109,
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
    compiler=RISCV_COMPILER,
    size=(("riscv64-unknown-elf-size",), "binutils-riscv64-unknown-elf"),
    flags=("-march=rv32imac", "-mabi=ilp32", "-misa-spec=2.2", "-O2", "-ffreestanding"),
)

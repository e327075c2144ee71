"""A 32-bit RISC-V core with multiplication and compressed instructions: RV32IMAC, as in a GD32VF103 or an FE310."""

from ..tools import RISCV_COMPILER
from .base import Formula, Target

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
            "one": 71.2,
            "blocks": 40.15,
            "classes": 8.067,
            "bytes": 7.477,
            "groups": 9.115,
            "rows": 13.82,
            "lines": 16.65,
            "distances": 18.55,
            "bins": 20.07,
            "halves": 8.599,
        },
        flash=1418,
        ram=34,
    ),
    compiler=RISCV_COMPILER,
    size=(("riscv64-unknown-elf-size",), "binutils-riscv64-unknown-elf"),
    flags=("-march=rv32imac", "-mabi=ilp32", "-misa-spec=2.2", "-O2", "-ffreestanding"),
)

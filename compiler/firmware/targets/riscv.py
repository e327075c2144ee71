"""A 32-bit RISC-V core with multiplication and compressed instructions: RV32IMAC, as in a GD32VF103 or an FE310.

Code runs in qemu on SiFive's board with an E31, which counts retired instructions.
"""

from dataclasses import replace

from ..costs import CORTEX_M4, Updating
from ..tools import RISCV_COMPILER, RISCV_EMULATOR
from .bare import Bare, Machine

# Flash, RAM and clock are those of the GD32VF103CB (Longan Nano); the emulated board has half of its RAM.
MEMBER = Bare(
    architecture="riscv",
    prefix="riscv64-unknown-elf-",
    emulator=RISCV_EMULATOR,
    name="rv32imac",
    part="rv32imac",
    title="RV32IMAC",
    help="a library for this core, with start-up, Makefile and a self test in qemu",
    next_step="`make -C {folder} check` compiles and tests it",
    rank=22,
    flash=128 << 10,
    ram=16 << 10,
    clock_hz=108_000_000,
    kind="riscv",
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
    board="sifive-hifive1-revb",
    machine=Machine("sifive_e", 4 << 20, 16 << 10, 1_000_000_000, flash_at=0x20400000, ram_at=0x80000000),
)

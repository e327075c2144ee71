"""Cortex-M cores with a small memory, which fits the machines of qemu on which such firmware is tested.

qemu 7 has no Cortex-M0+, but a Cortex-M0, on the micro:bit, whose instructions are the same (ARMv6-M): it refuses those
of a larger core. Code for a Cortex-M4 runs on one, of Arm's MPS2 board with image AN386.

Instructions are counted by SysTick. Under `-icount shift=9` qemu's clock advances by 2^9 ns with every instruction and
by nothing else, which is several ticks of SysTick: the difference between two readings, less that of a function of one
instruction, is a whole number of instructions. Its 24 bits last for a million.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from .. import FirmwareError
from ..costs import Core
from ..tools import ARM_COMPILER, ARM_EMULATOR, LIMIT_S, STRICT, call, find, lacking, workshop
from .base import Target

if TYPE_CHECKING:
    from ..classifier import Library
    from ..layout import Layout
    from ..probes import Answers, Frames, Lost

_SHIFT = 9
STACK = 512  # bytes that the linker keeps free: main() and an answer take less


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine of qemu: its memory in bytes and SysTick's clock. Flash is at 0 and RAM at 0x20000000."""

    name: str
    flash: int
    ram: int
    systick_hz: int


@dataclass(frozen=True, kw_only=True)
class CortexM(Target):
    """A core of Arm, and the machine of qemu that runs its code."""

    machine: Machine

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text: the library, a Makefile (program, self test in qemu, size, flash), start-up, linker
        script and main().
        """
        from thenar.firmware_templates.rendering import render

        from ..probes import CHECKS, check_header

        name = library.name
        values = {"name": name, "core": self.title, "objects": library.objects}
        return {
            **library.whole,
            "Makefile": render("cortex_m/Makefile.j2", **values, part=self.part, machine=self.machine.name),
            "main.c": render("cortex_m/main.c.j2", **values, checks=CHECKS),
            f"thenar_{name}_check.h": check_header(name, library.layout, library.names.grasps),
            **bare_files(self.flash, self.ram),
        }

    def missing(self) -> str | None:
        """Return what is missing of compiler and emulator."""
        return lacking(ARM_COMPILER, ARM_EMULATOR)

    def run(
        self,
        files: Mapping[str, str],
        name: str,
        layout: "Layout",
        frames: "Frames",
        *,
        incremental: bool = False,
        lost: "Lost | None" = None,
        limit_s: float = LIMIT_S,
    ) -> "Answers":
        """Return the answers to frames (n, F) in qemu, as the base says, with the instructions that they took.

        limit_s  the emulator is stopped after that time, which is an error
        """
        from ..probes import check_frames, record_files, with_lost

        check_frames(frames, layout)
        assert self.compiler is not None
        compiler, emulator = find(self.compiler), find(ARM_EMULATOR)
        main = record_files(name, layout, "cortex", "update" if incremental else "classify", lost=lost is not None)
        bare = bare_files(self.machine.flash, self.machine.ram)
        sources = sorted(path for path in files if path.endswith(".c"))
        linked = ["-nostdlib", "-T", "link.ld", "main.c", "startup.c", *sources, "-lgcc", "-o", "classifier.elf"]
        quiet = ["-display", "none", "-monitor", "none", "-serial", "none"]
        counted = ["-icount", f"shift={_SHIFT}", "-semihosting-config", "enable=on,target=native"]
        with workshop({**files, **main, **bare, "frames": with_lost(frames, lost).tobytes()}) as folder:
            call([compiler, *STRICT, *self.flags, *linked], folder)
            emulating = [emulator, "-M", self.machine.name, *quiet, *counted, "-kernel", "classifier.elf"]
            call(emulating, folder, limit_s=limit_s)
            return _counted((folder / "answers").read_bytes(), frames, layout, self.machine)


def bare_files(flash: int, ram: int) -> dict[str, str]:
    """Return path -> text of what a bare Cortex-M with so many bytes of flash and RAM needs."""
    from thenar.firmware_templates.rendering import render

    memory = {"flash_origin": "0x00000000", "flash": flash, "ram_origin": "0x20000000", "ram": ram}
    return {
        "link.ld": render("cortex_m/link.ld.j2", **memory, stack=STACK),
        "startup.c": render("cortex_m/startup.c.j2"),
        "semihosting.h": render("cortex_m/semihosting.h.j2"),
    }


def _counted(written: bytes, frames: "Frames", layout: "Layout", machine: Machine) -> "Answers":
    """Return the answers in what the program wrote: names, the ticks of one instruction, each answer and its ticks."""
    import numpy as np

    from ..probes import answers_from, names_in

    size = 2 * len(layout.start) + 2
    names, written = names_in(written, layout)
    if len(written) != 4 + (size + 4) * len(frames):
        raise FirmwareError(f"the program on {machine.name} answered {len(written)} bytes for {len(frames)} frames")
    records = np.frombuffer(written, np.uint8, offset=4).reshape(len(frames), size + 4)
    ticks = np.ascontiguousarray(records[:, size:]).view("<u4")[:, 0].astype(np.int64)
    beyond = ticks - int.from_bytes(written[:4], "little")
    answers = answers_from(records[:, :size].tobytes(), frames, layout)
    instructions = 1 + np.rint(beyond * 1e9 / (machine.systick_hz << _SHIFT)).astype(np.uint32)
    return replace(answers, cost=instructions, unit="instructions", names=names)


_core = partial(
    CortexM,
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
            fixed=40,
            a_class=8,
            in_parts=18,
            lookup=4,
            found=6,
            part=0,
            pair=4,
            quad=9,
            quads=0,
            replaced_pair=10,
            replaced_quad=29,
            replaced_halves=5,
            product=5,
            moved=8,
            compared=6,
        ),
        flags=("-mcpu=cortex-m0plus", "-mthumb", "-O2", "-ffreestanding"),
        machine=Machine("microbit", 256 << 10, 16 << 10, 16_000_000),
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
        machine=Machine("mps2-an386", 4 << 20, 4 << 20, 25_000_000),
    ),
)

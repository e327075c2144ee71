"""Portable C on emulated cores: its predictions and the instructions that each takes.

Instructions are counted by a timer of the machine. Under `-icount` qemu's clock advances by 2^shift ns with every
instruction and by nothing else, which is one or several ticks: the difference between two readings, less that of a
function of one instruction, is a whole number of instructions.

qemu 7 has no Cortex-M0+, but a Cortex-M0, on the micro:bit, with the same instructions (ARMv6-M); it rejects those of a
larger core. Code for a Cortex-M4 runs on Arm's MPS2 board with image AN386, that for RISC-V on SiFive's board with an
E31.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.probes import (
    Frames,
    Lost,
    Predictions,
    answers_in,
    record_files,
    sent_frames,
)
from thenar.compiler.firmware.targets import TARGETS, Target
from thenar.compiler.firmware.tools import LIMIT_S, STRICT, Tool, call, compile_objects, find, lacking, workshop

_HERE = Path(__file__).parent


@dataclass(frozen=True, slots=True)
class Core:
    """A target's core on a qemu machine: sizes and addresses of its memories, clock and shift for counting."""

    target: Target
    emulator: Tool
    machine: str
    flash: int
    ram: int
    hz: int
    shift: int = 0
    flash_at: int = 0
    ram_at: int = 0x20000000

    def missing(self) -> str | None:
        """Return which of compiler and emulator is missing, and how to install it; None if neither is."""
        assert self.target.compiler is not None
        return lacking(self.target.compiler, self.emulator)

    def run(
        self,
        files: Mapping[str, str],
        name: str,
        layout: Layout,
        frames: Frames,
        *,
        lost: Lost | None = None,
        limit_s: float = LIMIT_S,
    ) -> Predictions:
        """Return the predictions of the classifier `name` for frames (n, F), as `Target.run` does, with their costs."""
        sent = sent_frames(frames, lost, layout).tobytes()
        segments = f"thenar_{name}_segments.c" in files
        record = record_files(name, layout, "host", lost=lost is not None, segments=segments)["record.h"]
        main = {path: (_HERE / path).read_text() for path in ("main.c", "ticks.h")}
        given: dict[str, str | bytes] = {
            **files,
            **main,
            "record.h": record,
            "frames": sent,
        }
        written = self.emulate(given, limit_s)
        return self._counted(written, frames, layout)

    def emulate(
        self, files: Mapping[str, str | bytes], limit_s: float = LIMIT_S, flags: Sequence[str] = STRICT
    ) -> bytes:
        """Compile all C of `files` with `flags`, run it in qemu and return the contents of its file "predictions"."""
        assert self.target.compiler is not None
        bare = {path: (_HERE / path).read_text() for path in ("startup.c", "semihosting.h", "link.ld")}
        places = {"FLASH_ORIGIN_": self.flash_at, "FLASH_": self.flash, "RAM_ORIGIN_": self.ram_at, "RAM_": self.ram}
        memory = [f"-Wl,--defsym={name}={value}" for name, value in places.items()]
        sources = sorted(path for path in (*files, "startup.c") if path.endswith(".c"))
        linked = ["-Wl,--gc-sections", "-nostdlib", *memory, "-T", "link.ld"]
        quiet = ["-display", "none", "-monitor", "none", "-serial", "none"]
        counted = ["-icount", f"shift={self.shift}", "-semihosting-config", "enable=on,target=native"]
        with workshop({**files, **bare}) as folder:
            compiling = [find(self.target.compiler), *self.target.flags]
            objects = compile_objects([*compiling, *flags, "-ffunction-sections"], sources, folder)
            call([*compiling, *linked, *objects, "-lgcc", "-o", "classifier.elf"], folder)
            emulating = [find(self.emulator), "-M", self.machine, *quiet, *counted, "-kernel", "classifier.elf"]
            call(emulating, folder, limit_s=limit_s)
            return (folder / "predictions").read_bytes()

    def _counted(self, written: bytes, frames: Frames, layout: Layout) -> Predictions:
        """Return the predictions of the output: names, ticks of one instruction, each prediction and its ticks."""
        size = 2 * layout.tables.n_classes + 10
        *names, written = written.split(b"\0", layout.tables.n_classes)
        if len(frames) and len(written) == 4 + (size + 2) * len(frames):  # each with a state
            size += 2
        if len(written) != 4 + size * len(frames):
            raise FirmwareError(f"the program on {self.machine} wrote {len(written)} bytes for {len(frames)} frames")
        records = np.frombuffer(written, np.uint8, offset=4).reshape(len(frames), size)
        ticks = np.ascontiguousarray(records[:, -4:]).view("<u4")[:, 0]
        printed = b"\0".join([*names, records[:, :-4].tobytes()])
        predictions = answers_in(printed, len(frames), layout)
        instructions = self.instructions(ticks, int.from_bytes(written[:4], "little"))
        return replace(predictions, cost=instructions, unit="instructions")

    def instructions(self, ticks: NDArray[np.uint32], of_one: int) -> NDArray[np.uint32]:
        """Return the instructions for each number of ticks, where one instruction took `of_one`."""
        return 1 + np.rint((ticks.astype(np.int64) - of_one) * 1e9 / (self.hz << self.shift)).astype(np.uint32)


_ARM: Tool = (("qemu-system-arm",), "qemu-system-arm")
_RISCV: Tool = (("qemu-system-riscv32",), "qemu-system-misc")
CORES = {
    "cortex-m0plus": Core(TARGETS["cortex-m0plus"], _ARM, "microbit", 256 << 10, 16 << 10, 16_000_000, 9),
    "cortex-m4": Core(TARGETS["cortex-m4"], _ARM, "mps2-an386", 4 << 20, 4 << 20, 25_000_000, 9),
    "rv32imac": Core(
        TARGETS["rv32imac"],
        _RISCV,
        "sifive_e",
        4 << 20,
        16 << 10,
        1_000_000_000,
        flash_at=0x20400000,
        ram_at=0x80000000,
    ),
}

"""Bare 32-bit cores: start-up, linker script and Makefile, and the qemu machine that runs their code.

Instructions are counted by a timer of the machine. Under `-icount` qemu's clock advances by 2^shift ns with every
instruction and by nothing else, which is one or several ticks: the difference between two readings, less that of a
function of one instruction, is a whole number of instructions.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from .. import FirmwareError
from ..tools import LIMIT_S, STRICT, Tool, call, find, lacking, workshop
from .base import Target

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..classifier import Library
    from ..layout import Layout
    from ..probes import Frames, Lost, Predictions

Architecture = Literal["arm", "riscv", "xtensa"]
STACK = 512  # bytes that the linker reserves: main() and a prediction need less


@dataclass(frozen=True, slots=True)
class Machine:
    """A qemu machine: sizes and addresses of its memories, clock and shift for counting, its core if it has several."""

    name: str
    flash: int
    ram: int
    hz: int
    shift: int = 0
    flash_at: int = 0
    ram_at: int = 0x20000000
    cpu: str = ""

    def instructions(self, ticks: "NDArray[np.uint32]", of_one: int) -> "NDArray[np.uint32]":
        """Return the instructions for each number of ticks, where one instruction took `of_one`."""
        import numpy as np

        return 1 + np.rint((ticks.astype(np.int64) - of_one) * 1e9 / (self.hz << self.shift)).astype(np.uint32)


@dataclass(frozen=True, kw_only=True)
class Bare(Target):
    """A core without an operating system, and the qemu machine that runs its code.

    prefix    of the names of its compiler's programs
    emulator  the program of qemu
    board     a board with the core, by openocd's name, for an example in the Makefile
    """

    architecture: Architecture
    prefix: str
    emulator: Tool
    machine: Machine
    board: str

    def files(self, library: "Library") -> dict[str, str]:
        """Return path -> text: the library, a Makefile (program, self test in qemu, size, flash), start-up, linker
        script and main().
        """
        from thenar.firmware_templates.rendering import render

        from ..probes import CHECKS, check_header

        name = library.name
        values = {"name": name, "core": self.title, "objects": library.objects}
        cpu = " ".join(flag for flag in self.flags if flag.startswith("-m"))
        how = {"prefix": self.prefix, "cpu": cpu, "emulator": self.emulator[0][0], "board": self.board}
        return {
            **library.whole,
            "Makefile": render("bare/Makefile.j2", **values, **how, machine=self.machine.name),
            "main.c": render("bare/main.c.j2", **values, checks=CHECKS),
            f"thenar_{name}_check.h": check_header(name, library.layout, library.names.grasps),
            **self.bare_files(self.flash, self.ram),
        }

    def bare_files(self, flash: int, ram: int) -> dict[str, str]:
        """Return path -> text of the files that the core needs with `flash` and `ram` bytes of memory."""
        from thenar.firmware_templates.rendering import render

        origins = {"flash_origin": f"0x{self.machine.flash_at:08x}", "ram_origin": f"0x{self.machine.ram_at:08x}"}
        values = {**origins, "flash": flash, "ram": ram, "stack": STACK, "architecture": self.architecture}
        return {name: render(f"bare/{name}.j2", **values) for name in ("link.ld", "startup.c", "semihosting.h")}

    def sources(self, library: "Library") -> dict[str, str]:
        """Return the classifier and the decoder of segments, for `run`."""
        return library.files | library.segments

    def missing(self) -> str | None:
        """Return which of compiler and emulator is missing, and how to install it; None if neither is."""
        assert self.compiler is not None
        return lacking(self.compiler, self.emulator)

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
    ) -> "Predictions":
        """Return the predictions for frames (n, F) in qemu, as in the base class, with their numbers of instructions.

        limit_s  time after which the emulator is stopped with an error
        """
        from thenar.firmware_templates.rendering import render

        from ..probes import check_frames, record_files, with_lost

        check_frames(frames, layout)
        main = {"ticks.h": render("checking/ticks.h.j2")}
        main |= record_files(
            name,
            layout,
            "bare",
            "update" if incremental else "classify",
            lost=lost is not None,
            segments=f"thenar_{name}_segments.c" in files,
        )
        given: dict[str, str | bytes] = {**files, **main, "frames": with_lost(frames, lost).tobytes()}
        return _counted(self.emulate(given, limit_s), frames, layout, self.machine)

    def emulate(
        self, files: Mapping[str, str | bytes], limit_s: float = LIMIT_S, flags: Sequence[str] = STRICT
    ) -> bytes:
        """Compile all C of `files` with `flags`, run it in qemu and return the contents of its file "predictions".

        Raises FirmwareError like `run`.
        """
        assert self.compiler is not None
        compiler, emulator, machine = find(self.compiler), find(self.emulator), self.machine
        bare = self.bare_files(machine.flash, machine.ram)
        sources = sorted(path for path in (*files, "startup.c") if path.endswith(".c"))
        # Uncalled code is not linked: an ESP8266 has the division of probability() in its ROM, not in libgcc.
        linked = ["-ffunction-sections", "-Wl,--gc-sections", "-nostdlib", "-T", "link.ld"]
        linked += [*sources, "-lgcc", "-o", "classifier.elf"]
        quiet = ["-display", "none", "-monitor", "none", "-serial", "none"]
        counted = ["-icount", f"shift={machine.shift}", "-semihosting-config", "enable=on,target=native"]
        with workshop({**files, **bare}) as folder:
            call([compiler, *flags, *self.flags, *linked], folder)
            emulating = [
                emulator,
                "-M",
                machine.name,
                *(["-cpu", machine.cpu] if machine.cpu else []),
                *quiet,
                *counted,
                "-kernel",
                "classifier.elf",
            ]
            call(emulating, folder, limit_s=limit_s)
            return (folder / "predictions").read_bytes()


def _counted(written: bytes, frames: "Frames", layout: "Layout", machine: Machine) -> "Predictions":
    """Return the predictions from the output: names, the ticks of one instruction, each prediction and its ticks."""
    import numpy as np

    from ..probes import answers_from, names_in

    size = 2 * len(layout.start) + 10
    names, written = names_in(written, layout)
    if len(frames) and len(written) == 4 + (size + 2) * len(frames):  # each with a state
        size += 2
    if len(written) != 4 + size * len(frames):
        raise FirmwareError(f"the program on {machine.name} wrote {len(written)} bytes for {len(frames)} frames")
    records = np.frombuffer(written, np.uint8, offset=4).reshape(len(frames), size)
    ticks = np.ascontiguousarray(records[:, -4:]).view("<u4")[:, 0]
    predictions = answers_from(records[:, :-4].tobytes(), frames, layout)
    instructions = machine.instructions(ticks, int.from_bytes(written[:4], "little"))
    return replace(predictions, cost=instructions, unit="instructions", names=names)

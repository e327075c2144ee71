"""The compiled classifier on a Cortex-M in qemu: every frame, and the instructions that its answer took.

Instructions are counted by SysTick. Under `-icount shift=9` qemu's clock advances by 2^9 ns with every instruction and
by nothing else, which is several ticks of SysTick: the difference between two readings, less that of a function of one
instruction, is a whole number of instructions. Its 24 bits last for a million.
"""

from collections.abc import Mapping

import numpy as np

from .answers import Answers, Frames, answers_from, check_frames, names_in
from .cortex_files import bare_files
from .errors import FirmwareError
from .layout import Layout
from .machines import Machine, machine_of
from .record import record_files
from .targets import Target
from .tools import ARM_COMPILER, ARM_EMULATOR, LIMIT_S, STRICT, call, find, workshop

_SHIFT = 9


def run(
    files: Mapping[str, str],
    name: str,
    layout: Layout,
    target: Target,
    frames: Frames,
    *,
    incremental: bool = False,
    limit_s: float = LIMIT_S,
) -> Answers:
    """Return what the classifier `name` in `files` (file name -> text, not for AVR) answers to frames (n, F).

    incremental  each answer comes from update(), the change since the frame before, instead of classify();
                 switches are then set by set_switch()
    limit_s      the emulator is stopped after that time, which is an error

    Raises FirmwareError if a tool is missing, or the files do not compile without any warning, do not fit, or do not
    run.
    """
    check_frames(frames, layout)
    machine = machine_of(target)
    compiler, emulator = find(ARM_COMPILER), find(ARM_EMULATOR)
    main = record_files(name, layout, "cortex", "update" if incremental else "classify")
    with workshop({**files, **main, **bare_files(machine.flash, machine.ram), "frames": frames.tobytes()}) as folder:
        call(_compiling(compiler, target, sorted(path for path in files if path.endswith(".c"))), folder)
        call(_emulating(emulator, machine), folder, limit_s=limit_s)
        return _counted((folder / "answers").read_bytes(), frames, layout, machine)


def _compiling(compiler: str, target: Target, sources: list[str]) -> list[str]:
    core = [f"-mcpu={target.part}", "-mthumb", "-O2", "-ffreestanding", "-nostdlib", "-T", "link.ld"]
    return [compiler, *STRICT, *core, "main.c", "startup.c", *sources, "-lgcc", "-o", "classifier.elf"]


def _emulating(emulator: str, machine: Machine) -> list[str]:
    quiet = ["-display", "none", "-monitor", "none", "-serial", "none"]
    counted = ["-icount", f"shift={_SHIFT}", "-semihosting-config", "enable=on,target=native"]
    return [emulator, "-M", machine.name, *quiet, *counted, "-kernel", "classifier.elf"]


def _counted(written: bytes, frames: Frames, layout: Layout, machine: Machine) -> Answers:
    """Return the answers in what the program wrote: names, the ticks of one instruction, each answer and its ticks."""
    size = 2 * len(layout.start) + 2
    names, written = names_in(written, layout)
    if len(written) != 4 + (size + 4) * len(frames):
        raise FirmwareError(f"the program on {machine.name} answered {len(written)} bytes for {len(frames)} frames")
    records = np.frombuffer(written, np.uint8, offset=4).reshape(len(frames), size + 4)
    ticks = np.ascontiguousarray(records[:, size:]).view("<u4")[:, 0].astype(np.int64)
    beyond = ticks - int.from_bytes(written[:4], "little")
    answers = answers_from(records[:, :size].tobytes(), frames, layout)
    instructions = 1 + np.rint(beyond * 1e9 / (machine.systick_hz << _SHIFT)).astype(np.uint32)
    return Answers(answers.scores, answers.classes, instructions, "instructions", names=names)

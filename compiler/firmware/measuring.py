"""What a classifier takes on its part, compiled and run in a simulator of it, beside the bounds of the cost model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from .answers import Unit
from .costs import NAME_BYTES
from .errors import FirmwareError
from .layout import Layout
from .library import Fit
from .probes import Probes, changing_frames, extreme_frames, joined, random_frames
from .running import run, toolchain_missing
from .targets import Target
from .tools import STRICT, Tool, call, find, workshop
from .worst import worst_frame

_RANDOM = 2000
_COMPILERS: Mapping[str, Tool] = {
    "avr": (("avr-gcc",), "gcc-avr"),
    "cortex-m": (("arm-none-eabi-gcc",), "gcc-arm-none-eabi"),
}
# What stands in a section of its own can be left out where nothing calls it.
_SECTIONS = "-ffunction-sections"
_SIZES: Mapping[str, Tool] = {
    "avr": (("avr-size",), "binutils-avr"),
    "cortex-m": (("arm-none-eabi-size",), "binutils-arm-none-eabi"),
}


@dataclass(frozen=True, slots=True)
class Measured:
    """What a classifier took: its slowest frame in `unit`, by classify() and by update(), bytes of stack (None where
    not measured), flash and RAM.

    flash is that of the whole, flash_classify what is left of it in a program that never calls update(). The numbers
    that begin with most_ are those of the cost model: bounds on an AVR, where RAM is with the stack, and elsewhere
    `rough`.
    """

    part: str
    time: int
    update_time: int
    unit: Unit
    stack: int | None
    flash: int
    flash_classify: int
    ram: int
    most_time: int
    most_update_time: int
    most_flash: int
    most_flash_classify: int
    most_ram: int
    rough: bool

    @property
    def holds(self) -> bool:
        """Whether everything is within its bound, where there is one."""
        used = self.ram + (self.stack or 0)
        small = self.flash <= self.most_flash and self.flash_classify <= self.most_flash_classify
        quick = self.time <= self.most_time and self.update_time <= self.most_update_time
        return self.rough or (quick and small and used <= self.most_ram)

    @property
    def note(self) -> str:
        """What was measured, as a sentence."""
        bound = "expected about" if self.rough else "bound"
        stack = "" if self.stack is None else f" and {self.stack} of stack"
        return (
            f"Measured on {self.part}: at most {self.time} {self.unit} a frame ({bound} {self.most_time}), "
            f"{self.update_time} by update() ({bound} {self.most_update_time}); "
            f"{self.flash} bytes of flash ({bound} {self.most_flash}), "
            f"{self.flash_classify} where nothing calls update() ({bound} {self.most_flash_classify}); "
            f"{self.ram} bytes of RAM{stack} ({bound} {self.most_ram})."
        )


def measure(files: Mapping[str, str], name: str, fit: Fit, grasps: Sequence[str]) -> Measured:
    """Compile the classifier `name` of the types `grasps` in `files` (file name -> text), run the frames that
    should take longest, and return what the slowest took.

    Raises FirmwareError where a tool is missing, or for a part on which nobody counts.
    """
    target, layout, cost = fit.target, fit.choice.layout, fit.choice.cost
    if target.kind == "host":
        raise FirmwareError("on no microcontroller that is simulated here the classifier fits: nothing can be measured")
    if lack := toolchain_missing(target):
        raise FirmwareError(f"firmware for {target.part} cannot be measured here: {lack}")
    tried = _frames(layout, target)
    answers = run(files, name, layout, target, layout.frame_bytes(tried.bits, tried.codes))
    changing = joined(changing_frames(layout.tables), tried)
    updated = run(files, name, layout, target, layout.frame_bytes(changing.bits, changing.codes), incremental=True)
    if answers.cost is None or updated.cost is None:
        raise FirmwareError(f"nothing was counted on {target.part}")
    flash, flash_classify, ram = _size(files, name, target)
    long_names = _more_for_names(grasps)
    return Measured(
        part=target.part,
        time=int(answers.cost.max()),
        update_time=int(updated.cost.max()),
        unit=answers.unit,
        stack=None if answers.stack is None or updated.stack is None else max(answers.stack, updated.stack),
        flash=flash,
        flash_classify=flash_classify,
        ram=ram,
        most_time=cost.cycles,
        most_update_time=cost.update_cycles,
        most_flash=cost.flash + long_names,
        most_flash_classify=cost.flash_classify + long_names,
        most_ram=cost.ram,
        rough=target.kind != "avr",
    )


def _frames(layout: Layout, target: Target) -> Probes:
    """Return the frame that takes longest by the model, extreme ones and random ones, should the model be wrong."""
    bits, codes = worst_frame(layout, target if target.kind == "avr" else None)
    worst = Probes(bits.reshape(1, -1), codes.reshape(1, -1))
    return joined(worst, extreme_frames(layout.tables), random_frames(layout.tables, _RANDOM, seed=1))


def _more_for_names(grasps: Sequence[str]) -> int:
    """Return the bytes by which long names exceed those that the cost model allows for."""
    longest = 1 + max(len(grasp.encode()) for grasp in grasps)
    return max(0, longest - NAME_BYTES) * (len(grasps) + 1)


def _size(files: Mapping[str, str], name: str, target: Target) -> tuple[int, int, int]:
    """Return the bytes of flash of the compiled files, of flash without update(), and of RAM."""
    machine = f"-mmcu={target.part}" if target.kind == "avr" else f"-mcpu={target.part}"
    options = ["-Os"] if target.kind == "avr" else ["-mthumb", "-O2", "-ffreestanding"]
    sources = sorted(path for path in files if path.endswith((".c", ".S")))
    kept = [f"-Wl,-u,thenar_{name}_{function}" for function in ("classify", "set_switch", "grasp")]
    with workshop(files) as folder:
        compiler = find(_COMPILERS[target.kind])
        call([compiler, *STRICT, machine, *options, _SECTIONS, "-c", *sources], folder)
        # Variables that are common have no place, and no size for `size`, until they are linked.
        linked = [compiler, machine, "-r", "-nostdlib", "-Wl,-d", *(path.rsplit(".", 1)[0] + ".o" for path in sources)]
        call([*linked, "-o", "whole.elf"], folder)
        call([*linked, *kept, f"-Wl,--gc-sections,-e,thenar_{name}_classify", "-o", "classify.elf"], folder)
        told = call([find(_SIZES[target.kind]), "whole.elf", "classify.elf"], folder).decode().splitlines()[1:]
    (text, data, bss), (less_text, less_data, _) = (map(int, line.split()[:3]) for line in told)
    return text + data, less_text + less_data, data + bss

"""The measured cost of a classifier on its part, compiled and run in a simulator, next to the cost model's bounds."""

from collections.abc import Sequence
from dataclasses import dataclass

from . import FirmwareError
from .avr_costs import worst_frame
from .choose import Fit
from .classifier import Library
from .costs import NAME_BYTES, Unit
from .layout import Layout
from .probes import Predictions, Probes, changing_frames, extreme_frames, joined, random_frames
from .targets import Target
from .tools import STRICT, call, find, workshop

_RANDOM = 2000
# The linker can remove uncalled code only if it has a separate section.
_SECTIONS = ("-ffunction-sections", "-fdata-sections")


@dataclass(frozen=True, slots=True)
class Measured:
    """The measured cost of a classifier: its slowest frame in `unit`, by classify() and by update(), bytes of stack
    (None where not measured), flash and RAM.

    flash is the total, flash_classify the part of it in a program that never calls update() and never marks an input as
    missing. The numbers that begin with most_ are the bounds of the cost model, whose RAM includes the stack.
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

    @property
    def holds(self) -> bool:
        """Whether everything is within its bound, where there is one."""
        used = self.ram + (self.stack or 0)
        small = self.flash <= self.most_flash and self.flash_classify <= self.most_flash_classify
        quick = self.time <= self.most_time and self.update_time <= self.most_update_time
        return quick and small and used <= self.most_ram

    @property
    def note(self) -> str:
        """The measurements, as a sentence."""
        stack = "" if self.stack is None else f" and {self.stack} of stack"
        return (
            f"Measured on {self.part}: at most {self.time} {self.unit} a frame (bound {self.most_time}), "
            f"{self.update_time} by update() (bound {self.most_update_time}); "
            f"{self.flash} bytes of flash (bound {self.most_flash}), "
            f"{self.flash_classify} where only classify() is called (bound {self.most_flash_classify}); "
            f"{self.ram} bytes of RAM{stack} (bound {self.most_ram})."
        )


def measure(library: Library, fit: Fit) -> Measured:
    """Compile a classifier, run the frames that should take longest, and return the measured maxima.

    Raises FirmwareError where a tool is missing, or for a part whose simulator does not count.
    """
    target, layout, cost = fit.target, fit.choice.layout, fit.choice.cost
    if not target.own_layout:
        raise FirmwareError("the classifier fits none of the simulated microcontrollers: nothing can be measured")
    if lack := target.missing():
        raise FirmwareError(f"firmware for {target.part} cannot be measured here: {lack}")
    tried = joined(slow_frames(layout), random_frames(layout.tables, _RANDOM, seed=1))
    predictions = run_counted(library, target, tried)
    updated = run_counted(library, target, joined(changing_frames(layout.tables), tried), incremental=True)
    flash, flash_classify, ram = _size(library, target)
    long_names = _more_for_names(library.names.grasps)
    return Measured(
        part=target.part,
        time=predictions.most,
        update_time=updated.most,
        unit=predictions.unit,
        stack=None if predictions.stack is None or updated.stack is None else max(predictions.stack, updated.stack),
        flash=flash,
        flash_classify=flash_classify,
        ram=ram,
        most_time=cost.cycles,
        most_update_time=cost.update_cycles,
        most_flash=cost.flash + long_names,
        most_flash_classify=cost.flash_classify + long_names,
        most_ram=cost.ram,
    )


def slow_frames(layout: Layout) -> Probes:
    """Return the frame that takes longest by the model, and extreme ones in case the model is wrong."""
    bits, codes = worst_frame(layout)
    return joined(Probes(bits.reshape(1, -1), codes.reshape(1, -1)), extreme_frames(layout.tables))


def run_counted(library: Library, target: Target, frames: Probes, *, incremental: bool = False) -> Predictions:
    """Return the predictions and their cost on a target that counts it; raise FirmwareError elsewhere."""
    sent = library.layout.frame_bytes(frames.bits, frames.codes)
    predictions = target.run(library.files, library.name, library.layout, sent, incremental=incremental)
    if predictions.cost is None:
        raise FirmwareError(f"nothing was counted on {target.part}")
    return predictions


def _more_for_names(grasps: Sequence[str]) -> int:
    """Return the bytes by which long names exceed the size assumed by the cost model."""
    longest = 1 + max(len(grasp.encode()) for grasp in grasps)
    return max(0, longest - NAME_BYTES) * (len(grasps) + 1)


def _size(library: Library, target: Target) -> tuple[int, int, int]:
    """Return the bytes of flash of the compiled files, of flash where only classify() is called, and of RAM."""
    if target.compiler is None or target.size is None:
        raise FirmwareError(
            f"the target {target.name} has no compiler or no program `size` here: nothing can be measured"
        )
    sources = sorted(path for path in library.files if path.endswith((".c", ".S")))
    name = f"thenar_{library.name}"
    called = [f"-Wl,-u,{name}_{function}" for function in ("init", "classify", "set_switch", "grasp")]
    rest = [f"-Wl,-u,{name}_{function}" for function in ("update", "lose_switch", "lose_joint")]
    glove = f'#include "{name}.h"\nextern {name} glove;\n{name} glove;\n'
    with workshop({**library.files, "glove.c": glove}) as folder:
        compiling = [find(target.compiler), *target.flags]
        call([*compiling, *STRICT, *_SECTIONS, "-c", *sources, "glove.c"], folder)
        # Common variables have no address, and no size for `size`, until they are linked.
        objects = [path.rsplit(".", 1)[0] + ".o" for path in (*sources, "glove.c")]
        linked = [*compiling, "-r", "-nostdlib", f"-Wl,-d,--gc-sections,-e,{name}_classify,-u,glove", *objects, *called]
        call([*linked, *rest, "-o", "whole.elf"], folder)
        call([*linked, "-o", "classify.elf"], folder)
        sizes = call([find(target.size), "whole.elf", "classify.elf"], folder).decode().splitlines()[1:]
    (text, data, bss), (less_text, less_data, _) = (map(int, line.split()[:3]) for line in sizes)
    return text + data, less_text + less_data, data + bss

"""The measured cost of a classifier on its part, compiled and run in a simulator."""

from dataclasses import dataclass

from . import FirmwareError
from .choose import Fit
from .classifier import Library
from .costs import Unit
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
    missing.
    """

    part: str
    time: int
    update_time: int
    unit: Unit
    stack: int | None
    flash: int
    flash_classify: int
    ram: int

    @property
    def note(self) -> str:
        """The measurements, as a sentence."""
        stack = "" if self.stack is None else f" and {self.stack} of stack"
        return (
            f"Measured on {self.part}: at most {self.time} {self.unit} a frame, {self.update_time} by update(); "
            f"{self.flash} bytes of flash, {self.flash_classify} where only classify() is called; "
            f"{self.ram} bytes of RAM{stack}."
        )


def measure(library: Library, fit: Fit) -> Measured:
    """Compile a classifier, run extreme and random frames, and return the measured maxima.

    Raises FirmwareError where a tool is missing, or for a part whose simulator does not count.
    """
    target = fit.target
    if lack := target.missing():
        raise FirmwareError(f"firmware for {target.part} cannot be measured here: {lack}")
    tried = slow_frames(library)
    predictions = run_counted(library, target, tried)
    updated = run_counted(library, target, joined(changing_frames(library.layout.tables), tried), incremental=True)
    flash, flash_classify, ram = sizes(library, target)
    return Measured(
        part=target.part,
        time=predictions.most,
        update_time=updated.most,
        unit=predictions.unit,
        stack=None if predictions.stack is None or updated.stack is None else max(predictions.stack, updated.stack),
        flash=flash,
        flash_classify=flash_classify,
        ram=ram,
    )


def slow_frames(library: Library) -> Probes:
    """Return frames of which one is among the slowest: extreme and random ones."""
    tables = library.layout.tables
    return joined(extreme_frames(tables), random_frames(tables, _RANDOM, seed=1))


def run_counted(library: Library, target: Target, frames: Probes, *, incremental: bool = False) -> Predictions:
    """Return the predictions and their cost on a target that counts it; raise FirmwareError elsewhere."""
    sent = library.layout.frame_bytes(frames.bits, frames.codes)
    predictions = target.run(library.files, library.name, library.layout, sent, incremental=incremental)
    if predictions.cost is None:
        raise FirmwareError(f"nothing was counted on {target.part}")
    return predictions


def sizes(library: Library, target: Target) -> tuple[int, int, int]:
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

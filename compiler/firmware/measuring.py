"""The measured cost of a classifier on its part, compiled and run in a simulator."""

from dataclasses import dataclass

from . import FirmwareError
from .choose import PartFit
from .classifier import Library
from .costs import Unit
from .probes import Predictions, Probes, extreme_frames, joined, random_frames
from .targets import Target
from .tools import STRICT, call, find, workshop

_RANDOM = 2000
# The linker can remove uncalled code only if it has a separate section.
_SECTIONS = ("-ffunction-sections", "-fdata-sections")
_CALLED = tuple(f"thenar_{function}" for function in ("init", "set_switch", "set_code", "classify", "name"))


@dataclass(frozen=True, slots=True)
class Measured:
    """The measured cost of a classifier: its slowest frame in `unit`; bytes of stack (None: not measured), flash, RAM.

    flash is that of a program that calls init(), set_switch(), set_code(), classify() and name().
    """

    part: str
    time: int
    unit: Unit
    stack: int | None
    flash: int
    ram: int

    @property
    def note(self) -> str:
        """The measurements, as a sentence."""
        stack = "" if self.stack is None else f" and {self.stack} of stack"
        return (
            f"Measured on {self.part}: at most {self.time} {self.unit} a frame; {self.flash} bytes of flash; "
            f"{self.ram} bytes of RAM{stack}."
        )


def measure(library: Library, fit: PartFit) -> Measured:
    """Compile a classifier, run extreme and random frames, and return the measured maxima.

    Raises FirmwareError where a tool is missing, or for a part whose simulator does not count.
    """
    target = fit.target
    if lack := target.missing():
        raise FirmwareError(f"firmware for {target.part} cannot be measured here: {lack}")
    predictions = run_counted(library, target, slow_frames(library))
    flash, ram = sizes(library, target)
    return Measured(target.part, predictions.most, predictions.unit, predictions.stack, flash, ram)


def slow_frames(library: Library) -> Probes:
    """Return frames of which one is among the slowest: extreme and random ones."""
    tables = library.layout.tables
    return joined(extreme_frames(tables), random_frames(tables, _RANDOM, seed=1))


def run_counted(library: Library, target: Target, frames: Probes) -> Predictions:
    """Return the predictions and their cost on a target that counts it; raise FirmwareError elsewhere."""
    sent = library.layout.frame_bytes(frames.bits, frames.codes)
    predictions = target.run(library.files, library.name, library.layout, sent)
    if predictions.cost is None:
        raise FirmwareError(f"nothing was counted on {target.part}")
    return predictions


def sizes(library: Library, target: Target) -> tuple[int, int]:
    """Return the bytes of flash and of RAM of a classifier and a hand, without functions that are not called."""
    if target.compiler is None or target.size is None:
        raise FirmwareError(
            f"the target {target.name} has no compiler or no program `size` here: nothing can be measured"
        )
    name = f"thenar_{library.name}"
    sources = sorted(path for path in library.files if path.endswith(".c"))
    called = [f"-Wl,-u,{symbol}" for symbol in ("hand", "memory", f"{name}_model", *_CALLED)]
    hand = f'#include "{name}.h"\nextern thenar hand;\nextern uint16_t memory[];\nthenar hand;\n'
    hand += f"uint16_t memory[THENAR_{library.name.upper()}_MEMORY];\n"
    with workshop({**library.files, "hand.c": hand}) as folder:
        compiling = [find(target.compiler), *target.flags]
        call([*compiling, *STRICT, *_SECTIONS, "-c", *sources, "hand.c"], folder)
        objects = [path.replace(".c", ".o") for path in (*sources, "hand.c")]
        linking = [*compiling, "-nostartfiles", "-nostdlib", "-Wl,--gc-sections,-e,thenar_classify", *called]
        call([*linking, *objects, "-lgcc", "-o", "linked.elf"], folder)
        line = call([find(target.size), "linked.elf"], folder).decode().splitlines()[1]
    text, data, bss = map(int, line.split()[:3])
    return text + data, data + bss

"""The cost of recognition on a microcontroller, for thenar's firmware and its peers, from raw bytes to the grasp.

    python benchmarks/firmware.py

33 switches and 16 joints (a byte each) of the simulated scene kamakura, 14 grasp types. Switches are placed and models
trained on the training rows of each fold; accuracy is that of the deployed integers, in four folds and with each
subject left out. libsimavr counts cycles over the test rows of the first fold, median and maximum. Flash and RAM are
those of the whole program. Peers that are not installed are left out (`make bench` installs them), and those that do
not fit are named. On Cortex-M4 and M0+, qemu counts the instructions of thenar's C and of the logistic regressions in
C. Last, a whole pass: all joints set by calibrated readings of a converter of 10 bits, and the frame classified.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from firmwaredata import CUTS, JOINTS, PORTS, SWITCHES, Fold, Predictor, folds, rates, raw, split
from firmwarepeers import peers
from firmwarerun import AVR, CORES, on_avr, on_core
from msgspec import structs
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from rich.table import Table

from thenar.compiler import TRAINERS
from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.costs import fit_for
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.sensors import Sensors, sensors_of
from thenar.compiler.firmware.tools import AVR_COMPILER, call, find, workshop
from thenar.compiler.firmware.words import numbered
from thenar.compiler.model.collapse import collapse
from thenar.compiler.trainers.base import Model
from thenar.runtime.code_line import CodeLine
from thenar.runtime.manifest import Calibration
from thenar.runtime.model.integers import IntegerTables
from thenar.runtime.model.quantise import in_bytes, quantise

ARM = ("cortex-m4", "cortex-m0plus")
# Begins on reset, before main().
PASS = """
#include "thenar_glove_codes.h"
struct { int16_t readings[THENAR_GLOVE_JOINTS]; uint16_t memory[THENAR_GLOVE_MEMORY]; } input;
static thenar hand;
static thenar_glove_codes codes;
__attribute__((constructor)) static void begin(void)
{
    thenar_init(&hand, &thenar_glove_model, input.memory);
    thenar_glove_codes_init(&codes);
}
int predict(void)
{
    for (uint8_t i = 0; i < THENAR_GLOVE_JOINTS; i++) thenar_glove_set_reading(&hand, &codes, i, input.readings[i]);
    return (int)thenar_classify(&hand);
}
"""
CONSOLE = Console(width=170)
COLUMNS = ("", *(f"{cut}, %" for cut in CUTS), "cycles (most)", "flash", "RAM + stack", "differing", "M4 / M0+, most")

# Flags of thenar's Makefiles: functions that are not called are not linked.
_HOW = ("-Os", "-w", "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections")
Frames = NDArray[np.uint8]
Settings = tuple[tuple[str, Any], ...]


@dataclass(frozen=True)
class Ours:
    """A trainer with `settings`, with entries of `bits`, and with or without joints."""

    trainer: str
    bits: int
    settings: Settings = ()
    joints: bool = True

    @property
    def name(self) -> str:
        """The name in the table."""
        given = "".join(f", {name} {value}" for name, value in self.settings if name in ("max_bins", "sparsity"))
        alone = "" if self.joints else ", switches only"
        return f"thenar, {self.trainer}{given}, {self.bits} bit{alone}"

    def integers(self, fold: Fold) -> IntegerTables:
        """Return the integer tables of a fold."""
        samples = fold.samples(joints=self.joints)
        tables = collapse(_trained(self.trainer, self.settings, fold, self.joints), SWITCHES)
        return in_bytes(quantise(tables, samples.switches, samples.codes, 16, self.bits))

    def predictor(self, fold: Fold) -> Predictor:
        """Return the predictor of rows that matches the firmware of a fold."""
        tables = self.integers(fold)
        return lambda rows: tables.scores(*split(rows, joints=self.joints)).argmax(axis=1)


BINS = ("max_bins", 8)
# The pull of a line is that of scikit-learn's logistic regression with C = 1, which the peers take.
FEW, LINE = (("max_bins", 4),), (("penalty", 0.5),)
OURS = (
    Ours("logitboost", 16, (("rounds", 100), BINS)),
    Ours("logit", 16, (BINS,)),
    Ours("logit", 16, FEW),
    Ours("linear", 8, LINE),
    *(Ours("linear", 8, (*LINE, ("sparsity", sparsity))) for sparsity in (0.5, 0.6)),
    Ours("logit", 16, (BINS,), joints=False),
)


@cache
def _trained(trainer: str, settings: Settings, fold: Fold, joints: bool) -> Model:
    member = TRAINERS.named(trainer)
    return member.train(fold.samples(joints=joints), member.candidates(dict(settings))[0] | dict(settings))


@dataclass(frozen=True, slots=True)
class Cost:
    """The cost of a classifier: cycles per frame, median and maximum; bytes of flash, RAM and stack.

    differing  how many of `rows` predictions differ from those in Python
    """

    cycles: int
    most: int
    flash: int
    ram: int
    stack: int
    differing: int
    rows: int

    @property
    def cells(self) -> tuple[str, ...]:
        """The columns of the table that every classifier has."""
        return (
            f"{self.cycles:,} ({self.most:,})",
            f"{self.flash:,}",
            f"{self.ram} + {self.stack}",
            f"{self.differing} of {self.rows}",
        )


def _linked(folder: Path, sources: Mapping[str, str], part: str) -> tuple[int, int]:
    """Link `program.elf` from the sources in the folder; return bytes of flash and RAM. Ignores warnings of peers."""
    code = sorted(path for path in sources if path.endswith((".c", ".S")))
    call([find(AVR_COMPILER), f"-mmcu={part}", *_HOW, *code, "-lm", "-o", "program.elf"], folder)
    text, data, bss = call(["avr-size", "program.elf"], folder).decode().splitlines()[1].split()[:3]
    return int(text) + int(data), int(data) + int(bss)


def of_ours(layout: Layout, frames: Frames, expected: NDArray[np.integer]) -> Cost:
    """Return the cost of thenar's classifier for frames with known scores (n, K).

    The bytes of a frame are written directly into its inputs: nothing has to be copied.
    """
    files = Library("glove", numbered(layout.tables), layout).files
    body = "thenar_init(&hand, &thenar_glove_model, memory); for (;;) thenar_classify(&hand);"
    state = "uint16_t memory[THENAR_GLOVE_MEMORY];\nthenar hand;\n"
    program = {**files, "main.c": f'#include "thenar_glove.h"\n{state}int main(void) {{ {body} }}\n'}
    with workshop(program) as folder:
        flash, ram = _linked(folder, program, AVR.part)
    results = AVR.run(files, "glove", layout, frames)
    assert results.cost is not None
    assert results.stack is not None
    wrong = (results.scores != expected).any(axis=1) | (results.classes != expected.argmax(axis=1))
    middle, most, differing = int(np.median(results.cost)), results.most, int(np.count_nonzero(wrong))
    return Cost(middle, most, flash, ram, results.stack, differing, len(frames))


def of_peer(name: str, files: Mapping[str, str], frames: Frames, expected: NDArray[np.intp]) -> Cost:
    """Return the cost of a peer's classifier for raw frames, including feature extraction.

    `expected` are its predictions in Python. Raises FirmwareError if it does not fit.
    """
    program = {**files, "main.c": "int predict(void);\nint main(void) { for (;;) predict(); }\n"}
    with workshop(program) as folder:
        flash, ram = _linked(folder, program, AVR.part)
        if flash > AVR.flash or ram > AVR.ram:
            raise FirmwareError(f"{name} takes {flash} bytes of flash and {ram} of RAM: not on an {AVR.part}")
        found = on_avr(folder, frames)
    differing = int(np.count_nonzero(found["returned"] != expected))
    middle, most, stack = int(np.median(found["cycles"])), int(found["cycles"].max()), int(found["stack"].max())
    return Cost(middle, most, flash, ram, stack, differing, len(found))


def whole_pass(tables: IntegerTables, bits: NDArray[np.bool_], *, core: bool) -> Cost:
    """Return the cost of random readings with switches (n, s), with the core alone or with straight-line code."""
    degrees = tuple(Calibration(n, f"j{n}", "deg", 1, 0.0, 255, 254.0) for n in range(JOINTS))
    names, layout = structs.replace(numbered(tables), joints=degrees), fit_for(AVR, tables).layout
    every = [replace(sensor, readings=(150 + 8 * n, 700)) for n, sensor in enumerate(sensors_of(names).every)]
    files = Library("glove", names, layout, glove=Sensors(tuple(every), (), ())).whole | {"pass.c": PASS}
    if core:
        files["thenar_glove.c"] = files["thenar_glove.c"].replace("#ifdef __AVR__", "#if 0")
    readings = np.random.default_rng(1).integers(0, 1024, (len(bits), JOINTS))
    lines = [CodeLine(*zip(sensor.readings or (), sensor.codes, strict=True)) for sensor in every]
    codes = [[line.code(reading) for line, reading in zip(lines, row, strict=True)] for row in readings.tolist()]
    switches = layout.frame_bytes(bits, np.zeros((len(bits), 0), np.uint16))
    frames = np.hstack([readings.astype("<i2").view(np.uint8), switches])
    return of_peer("a whole pass", files, frames, tables.scores(bits, np.array(codes, np.uint16)).argmax(axis=1))


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the table; `cores`: the most instructions on cores of 32 bits."""

    name: str
    rates: tuple[float, ...]
    cost: Cost
    cores: str = ""


def on_cores(files: Mapping[str, str], frames: Frames, expected: NDArray[np.integer]) -> str:
    """Return the most instructions of `predict` over `input` on emulated cores of 32 bits."""
    most = []
    for name in ARM:
        predictions, instructions = on_core(CORES[name], files, frames)
        assert (predictions == expected).all()
        most.append(int(instructions.max()))
    return " / ".join(f"{each:,}" for each in most)


def ours_on_cores(layout: Layout, frames: Frames) -> str:
    """Return the most instructions of thenar's classifier on emulated cores of 32 bits."""
    files = Library("glove", numbered(layout.tables), layout).files
    return " / ".join(f"{CORES[name].run(files, 'glove', layout, frames).most:,}" for name in ARM)


def ours(cuts: Mapping[str, list[Fold]], what: Ours) -> Row:
    """Return the line of a trainer, on the first fold."""
    fold = cuts[CUTS[0]][0]
    tables, frames = what.integers(fold), split(fold.asked, joints=what.joints)
    layout = fit_for(AVR, tables).layout
    sent = layout.frame_bytes(*frames)
    cost = of_ours(layout, sent, tables.scores(*frames))
    return Row(what.name, rates(cuts, what.predictor), cost, ours_on_cores(layout, sent))


def theirs(cuts: Mapping[str, list[Fold]]) -> Iterator[Row]:
    """Yield the installed peers that fit the part."""
    fold = cuts[CUTS[0]][0]
    for peer in track([peer for peer in peers() if peer.available], "peers", console=CONSOLE):
        found = rates(cuts, peer.answers_of)
        model = peer.train(fold)
        expected, files = peer.predictor(model)(fold.asked), peer.files(model)
        rows = raw(fold.asked)
        cores = "" if peer.in_c is None else on_cores(peer.in_c(model), rows, expected)
        try:
            yield Row(peer.name, found, of_peer(peer.name, files, rows, expected), cores)
        except FirmwareError as lack:
            CONSOLE.print(f"{lack}"[:200], markup=False)


def main() -> None:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    try:
        cuts = folds(CONSOLE)
        lines = [ours(cuts, what) for what in track(OURS, "thenar", console=CONSOLE)]
        fold = cuts[CUTS[0]][0]
        sparse, bits = Ours("linear", 8, (*LINE, ("sparsity", 0.5))).integers(fold), split(fold.asked)[0]
        passes = [whole_pass(sparse, bits, core=core).cells for core in (False, True)]
        lines += theirs(cuts)
    except FirmwareError as lack:
        sys.exit(f"benchmarks/firmware.py: {lack}")
    title = f"{SWITCHES} switches in {PORTS} bytes + {JOINTS} joints, 14 grasp types, {AVR.part}, -Os, filling included"
    table = Table(title=title, title_justify="left")
    for column in COLUMNS:
        table.add_column(column, justify="right" if column else "left")
    for line in sorted(lines, key=lambda line: line.cost.most):
        table.add_row(line.name, *(f"{rate:.2f}" for rate in line.rates), *line.cost.cells, line.cores)
    CONSOLE.print(table)
    for what, cells in zip(("straight-line code", "the core"), passes, strict=True):
        CONSOLE.print(f"A whole pass of linear, sparsity 0.5, with {what}: cycles {cells[0]}, differing {cells[-1]}")


if __name__ == "__main__":
    main()

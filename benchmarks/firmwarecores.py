"""The cost of recognising a frame on 32-bit cores, in instructions: thenar's layouts and peers, from the raw bytes.

    python benchmarks/firmwarecores.py

33 switches and 16 joints (a byte each) of the simulated scene kamakura, 14 grasp types: the first of the four folds of
benchmarks/firmware.py. Every classifier is compiled by gcc with -O2 and run in qemu, which counts every instruction:
median and maximum over 300 test rows. Peers are emlearn's forests, and handwritten logistic regression with int8
weights: 13 sums, to which each joint adds a product and each group of switches a row. Lines "switches only" are of
builds without joints. Layouts are on the Pareto front of time and size in the cost model of a Cortex-M4. emlearn is
left out if it is not installed.
"""

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from firmware import BINS, LINE, Ours
from firmwaredata import Fold, folds, raw, split
from firmwarelogit import Groups, integer_logit
from firmwarepeers import SHARES, by_hand, peers
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from rich.table import Table

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.choose import choose, features, flash_shares
from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.targets.bare import Bare
from thenar.compiler.firmware.words import numbered
from thenar.firmware_templates.rendering import render

CORES = tuple(target for target in TARGETS.values() if isinstance(target, Bare))
M4, RISCV = "cortex-m4", "rv32imac"
OURS = (
    Ours("logitboost", 16, (("rounds", 100), BINS)),
    Ours("logitboost", 8, (("rounds", 100), BINS)),
    Ours("logit", 16, (BINS,)),
    Ours("logit", 8, LINE),
    Ours("logitboost", 8, (("rounds", 100), BINS), joints=False),
    Ours("logit", 8, (BINS,), joints=False),
    Ours("logit", 8, (BINS,), joints=False, width=8),
)
ROWS = 300
GROUPS = (Groups(1, 3), Groups(4, 4), Groups(8, 3))
MAIN = """
#include <stdbool.h>
#include "semihosting.h"
#include "ticks.h"

extern uint8_t input[{size}];
int predict(void);
static int grasp;

__attribute__((naked)) static int nothing(void)
{{
#ifdef __riscv
    __asm volatile("ret");
#else
    __asm volatile("bx lr");
#endif
}}

__attribute__((noinline, noclone)) static uint32_t ticks_of(int (*function)(void))
{{
    const uint32_t before = ticks_left();

    grasp = function();
    return (before - ticks_left()) & TICKS_MOST;
}}

int main(void)
{{
    const uint32_t frames = semihosting_open("frames", 6, SEMIHOSTING_RB);
    const uint32_t results = semihosting_open("predictions", 11, SEMIHOSTING_WB);
    uint32_t result[2] = {{0, 0}};

    start_ticking();
    result[1] = ticks_of(nothing);
    (void)semihosting_write(results, result, sizeof result);
    while (semihosting_read(frames, input, sizeof input)) {{
        result[1] = ticks_of(predict);
        result[0] = (uint32_t)grasp;
        (void)semihosting_write(results, result, sizeof result);
    }}
    semihosting_exit(false);
    return 0;
}}
"""


@dataclass(frozen=True, slots=True)
class Line:
    """A classifier: its accuracy on the test rows in percent, and the median and maximum cost on each core."""

    name: str
    accuracy: float
    counts: Mapping[str, tuple[int, int]]

    @property
    def ratio(self) -> float:
        """The ratio of RISC-V to Cortex-M4, at most."""
        return self.counts[RISCV][1] / self.counts[M4][1]


def of_peer(text: str, rows: NDArray[np.uint8], core: Bare) -> tuple[NDArray[np.uint32], tuple[int, int]]:
    """Return a peer's predictions for raw rows, with median and maximum cost."""
    main = MAIN.format(size=rows.shape[1])
    given: dict[str, str | bytes] = {"peer.c": text, "main.c": main, "ticks.h": render("checking/ticks.h.j2")}
    given["frames"] = rows.tobytes()
    found = np.frombuffer(core.emulate(given, flags=("-w",)), "<u4").reshape(-1, 2)
    counted = core.machine.instructions(found[1:, 1], int(found[0, 1]))
    return found[1:, 0], (int(np.median(counted)), int(counted.max()))


def of_ours(layout: Layout, rows: NDArray[np.uint8], core: Bare, *, joints: bool) -> tuple[int, int]:
    """Return the costs of a layout, after comparing all scores."""
    frames, library = split(rows, joints=joints), Library("glove", numbered(layout.tables), layout, avr=False)
    results = core.run(library.files, "glove", layout, layout.frame_bytes(*frames))
    if results.cost is None or (results.scores != layout.scores(*frames)).any():
        raise FirmwareError(f"{core.part} gives different scores from Python")
    return int(np.median(results.cost)), results.most


def ours(fold: Fold) -> Iterator[Line]:
    """Yield every layout on the front that fits a Cortex-M4."""
    target = TARGETS[M4]
    for what in track(OURS, "thenar"):
        for layout, cost in choose(what.integers(fold), target, entry_bits=what.bits).frontier:
            if cost.flash <= flash_shares(target)[1]:
                right = np.mean(layout.scores(*split(fold.asked, joints=what.joints)).argmax(axis=1) == fold.truth)
                counts = {core.part: of_ours(layout, fold.asked[:ROWS], core, joints=what.joints) for core in CORES}
                yield Line(f"{what.name}: {features(layout, target)}", 100 * float(right), counts)


def theirs(fold: Fold) -> Iterator[Line]:
    """Yield the peers."""
    made = [
        (by_hand(groups, share), integer_logit(fold, groups, share).c_source)
        for groups, share in product(GROUPS, SHARES)
    ]
    forests = (peer for peer in peers() if peer.name.startswith("emlearn, forest") and peer.name.endswith("int16"))
    made += [(peer.name, peer.files(peer.train(fold))["peer.c"]) for peer in forests if peer.available]
    for name, text in track(made, "peers"):
        found = {core.part: of_peer(text, raw(fold.asked[:ROWS]), core)[1] for core in CORES}
        predicted, _ = of_peer(text, raw(fold.asked), CORES[-1])
        yield Line(name, 100 * float(np.mean(predicted == fold.truth)), found)


def main() -> None:
    """Print the table."""
    console = Console(width=170)
    try:
        fold = folds(console)["four-fold"][0]
        lines = [*ours(fold), *theirs(fold)]
    except FirmwareError as lack:
        sys.exit(f"benchmarks/firmwarecores.py: {lack}")
    table = Table(title="Instructions a frame, the middle (the most), filling included", title_justify="left")
    for column in ("", "accuracy, %", *(core.title for core in CORES), "RISC-V / M4"):
        table.add_column(column, justify="right" if column else "left")
    for line in lines:
        counts = (f"{middle:,} ({most:,})" for middle, most in line.counts.values())
        table.add_row(line.name, f"{line.accuracy:.1f}", *counts, f"{line.ratio:.3f}")
    console.print(table)


if __name__ == "__main__":
    main()

"""What recognising costs a microcontroller: cycles, flash and RAM of thenar's firmware beside those of its peers.

    python benchmarks/firmware.py

One run, one set of rows, the same folds: 33 switches and 16 joints (a byte each) of the simulated scene kamakura, 14
grasp types, 100 rounds. Cycles are counted by libsimavr over the test rows of the first fold and, of thenar, its worst
frame; instructions of a Cortex-M by qemu. Flash and RAM are the whole program's.
Peers that are not installed (`make bench` installs them: emlearn, m2cgen, xgboost) are left out.
"""

import argparse
import sys
from collections.abc import Iterator
from itertools import chain

import numpy as np
from firmwarecosts import Cost, Limits, instructions, of_ours, of_peer
from firmwaredata import (
    JOINTS,
    ROUNDS,
    SWITCHES,
    Fold,
    boosted,
    folds,
    material,
    rates,
    scores,
    split,
    tables,
    two_changed,
)
from firmwarepeers import Peer, available, emlearn_forest, forest, m2cgen_stumps, plain_table, scaled
from rich.console import Console
from rich.progress import track
from rich.table import Table

from thenar.compiler.firmware import FirmwareError
from thenar.compiler.firmware.avr_costs import worst_frame
from thenar.compiler.firmware.choose import choose
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.targets import TARGETS
from thenar.runtime.tables import IntegerTables

# Trees and leaves of the forests tried: the one that recognises best among those that fit the part is the peer.
FORESTS = ((10, 40), (10, 80), (15, 60), (20, 30), (20, 40), (20, 60), (30, 30), (30, 40), (40, 20), (60, 14))
AVR, LARGER = TARGETS["avr328p"], TARGETS["avr2560"]
CORES = (TARGETS["cortex-m0plus"], TARGETS["cortex-m4"])
# Rows in which two switches change; rows that the slowest peer answers.
CHANGES, PEER_ROWS = 500, 20
CONSOLE = Console(width=160)
COLUMNS = (
    "",
    "recognition, %",
    "cycles (most)",
    "flash",
    "RAM + stack",
    "answers differ",
    "part",
    "asked: cycles, flash, RAM",
)

Line = tuple[str, ...]


def forests(cut: list[Fold]) -> Iterator[tuple[float, Peer, Cost]]:
    """Yield, of emlearn's forests that fit the ATmega328P, recognition rate, C of the first fold, and cost."""
    for trees, leaves in track(FORESTS, "forests", console=CONSOLE):
        made = [forest(fold.X, fold.y, trees, leaves) for fold in cut]
        peer = emlearn_forest(made[0], cut[0].asked, f"emlearn, forest of {trees}, at most {leaves} leaves")
        try:
            cost = of_peer(peer, AVR)
        except FirmwareError:
            continue
        answers = (model.predict(scaled(fold.asked)) == fold.truth for model, fold in zip(made, cut, strict=True))
        right = sum(map(np.count_nonzero, answers))
        yield 100 * right / sum(len(fold.truth) for fold in cut), peer, cost


def peers(cut: list[Fold], found: dict[str, float]) -> Iterator[Line]:
    """Yield the lines of the peers that are installed."""
    fold = cut[0]
    if available("m2cgen", "xgboost"):
        peer = m2cgen_stumps(fold.X, fold.y, fold.asked[:PEER_ROWS], ROUNDS)
        yield peer.name, "", *of_peer(peer, LARGER).cells, ""
    wide = tables(boosted(fold), fold, 16)
    plain = plain_table(wide, fold.asked, scores(wide, fold.asked).argmax(axis=1))
    yield plain.name, f"{found['16']:.2f}", *of_peer(plain, AVR).cells, ""
    if available("emlearn"):
        rate, peer, cost = max(forests(cut), key=lambda forest: forest[0])
        yield peer.name, f"{rate:.2f}", *cost.cells, ""


def fastest(integers: IntegerTables, fold: Fold, limits: Limits, entry_bits: int) -> tuple[Layout, Cost]:
    """Return the fastest layout that keeps within flash and RAM when it is linked, and what it costs, its worst frame
    included. Raises FirmwareError if none does.
    """
    for layout, _ in choose(integers, AVR, entry_bits=entry_bits).frontier:
        bits, codes = split(fold.asked, joints=integers.n_joints > 0)
        worst = worst_frame(layout)
        bits, codes = np.vstack([bits, worst[0]]), np.vstack([codes, worst[1]])
        cost = of_ours(layout, AVR, layout.frame_bytes(bits, codes), layout.scores(bits, codes))
        if cost.flash <= limits.flash and cost.ram + cost.stack <= limits.ram:
            return layout, cost
    raise FirmwareError(
        f"no layout of {entry_bits} bits keeps within {limits.flash} bytes of flash and {limits.ram} of RAM"
    )


def ours(cut: list[Fold], found: dict[str, float]) -> Iterator[Line]:
    """Yield the lines of thenar's classifiers of the first fold."""
    fold = cut[0]
    both, alone = boosted(fold), boosted(fold, joints=False)
    for name, key, stumps, entry_bits, joints, limits in (
        ("switches + joints, 16 bit", "16", both, 16, True, Limits(4500, 16_000, 100)),
        ("switches + joints, 8 bit", "8", both, 8, True, Limits(2500, 9_000, 100)),
        ("switches only, 16 bit", "switches", alone, 16, False, Limits(1700, 5_000, 80)),
    ):
        integers = tables(stumps, fold, entry_bits, joints=joints)
        layout, cost = fastest(integers, fold, limits, entry_bits)
        yield f"thenar, {name}", f"{found[key]:.2f}", *cost.cells, limits.verdict(cost)
        changed = split(two_changed(fold, CHANGES, joints=joints), joints=joints)
        cost = of_ours(layout, AVR, layout.frame_bytes(*changed), layout.scores(*changed), changes=True)
        yield "  two switches changed", "", *cost.cells, Limits(900).verdict(cost)
        for core in CORES if joints else ():
            chosen = choose(integers, core).layout
            bits, codes = split(fold.asked)
            most = instructions(chosen, core, chosen.frame_bytes(bits, codes), chosen.scores(bits, codes))
            asked = f"1,000: {'kept' if most <= 1000 else 'NOT KEPT'}"
            name = f"  the same tables, {chosen.entry_bits}-bit entries"
            yield name, "", f"{most:,} instructions", "", "", f"0 of {len(bits)}", core.part, asked


def main() -> None:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    title = f"{SWITCHES} switches + {JOINTS} joints, 14 grasp types, {ROUNDS} rounds"
    table = Table(title=title, title_justify="left")
    for column in COLUMNS:
        table.add_column(column, justify="right" if column else "left")
    try:
        cut = folds(*material())
        found = rates(cut, CONSOLE)
        for line in chain(peers(cut, found), ours(cut, found)):
            table.add_row(*line)
    except FirmwareError as lack:
        sys.exit(f"benchmarks/firmware.py: {lack}")
    CONSOLE.print(table)
    CONSOLE.print(f"recognition of the same stumps in floating point: {found['float']:.2f} %")


if __name__ == "__main__":
    main()

"""Initial contact: recognition against the force on the pad that is pressed hardest, in newtons since contact.

    thenar simulate initial-contact -o initial-contact.grasps
    python benchmarks/initialcontact.py initial-contact.grasps [-o initial-contact.svg]

Pads as levels, and as the switches that they would be (closed above 1 N), as many of each, chosen and trained on other
subjects' frames of all forces; every subject is left out in turn. No joint is read.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from contacts import table
from numpy.typing import NDArray

from thenar.compiler import GraspSet
from thenar.compiler.evaluation.folds import leave_groups_out
from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.pictures import on_paper, painting, rendered
from thenar.compiler.placement.elements import Element, Elements, bits_of, elements_of
from thenar.compiler.placement.methods.base import METHODS
from thenar.compiler.samples import Samples
from thenar.compiler.tables.collapse import model_scores
from thenar.compiler.trainers.base import Training
from thenar.runtime.manifest import Options

# As the scene has them: at contact, ten frames up to 1 N, one at full grip.
FORCES_N = tuple(step / 10 for step in range(11))
CLOSES_N = 1.0
METHOD, TRAINER = "forest", "logit"


def switches_of(grasp_set: GraspSet) -> Elements:
    """Return one level a pad, at the force at which a switch in its place would close."""
    first = len(grasp_set.switch_names)
    return tuple(Element(first + n, int(pad.code(CLOSES_N))) for n, pad in enumerate(grasp_set.taxel_columns))


def right(grasp_set: GraspSet, kept: int, *, levels: bool) -> NDArray[np.bool_]:
    """Return which rows (n,) are recognised with so many elements, when their subject is new."""
    samples, found = Samples.of(grasp_set, "switches"), np.zeros(len(grasp_set), np.bool_)
    (training, *_) = Training.candidates(Options(trainer=TRAINER))
    for fold in leave_groups_out(samples.subjects, "subject"):
        train = samples.rows(fold.train)
        elements = elements_of(train, 3) if levels else switches_of(grasp_set)
        bits = bits_of(samples, elements)
        columns = METHODS[METHOD].chooser(bits.rows(fold.train), None)(float(kept))
        read = bits.keeping(columns)
        model, test = training.train(read.rows(fold.train)), read.rows(fold.test)
        found[fold.test] = model_scores(model, test.switches, test.codes).argmax(axis=1) == test.labels
    return found


def rates(grasp_set: GraspSet, recognised: NDArray[np.bool_]) -> list[Rate]:
    """Return the rate at each force, and at full grip; a trial's rows are its frames, in order."""
    trials = grasp_set.trial_ids
    starts = np.flatnonzero(np.append(True, trials[1:] != trials[:-1]))
    frame = np.arange(len(trials)) - np.repeat(starts, np.diff(np.append(starts, len(trials))))
    people = np.unique(grasp_set.subjects, return_inverse=True)[1]
    found = []
    for step in range(len(FORCES_N) + 1):
        rows = np.flatnonzero(frame == step)
        ones, hits = np.arange(len(rows)), recognised[rows].astype(np.intp)
        groups = people[rows]
        found.append(Rate.predicted(hits[None], np.ones_like(ones), ones, of="new subject", groups=groups))
    return found


def draw(curves: Sequence[tuple[str, str, list[Rate]]]) -> bytes:
    """Return the picture: a curve a kind of element, its 95 % intervals behind it."""
    from matplotlib.figure import Figure

    with painting(9.0):
        figure = Figure(figsize=(6.0, 3.8), dpi=144)
        axes = figure.add_subplot()
        for name, colour, found in curves:
            there = found[: len(FORCES_N)]
            axes.plot(FORCES_N, [rate.mean for rate in there], color=on_paper(colour), lw=2, label=name)
            lows, highs = [rate.low for rate in there], [rate.high for rate in there]
            axes.fill_between(FORCES_N, lows, highs, color=on_paper(colour), alpha=0.12, lw=0)
        axes.set_xlabel("force on the pad that is pressed hardest, N")
        axes.set_ylabel("accuracy: frames, new subject")
        axes.set_ylim(0, 1)
        axes.grid(color=on_paper("line"), lw=0.6)
        axes.legend(frameon=False, loc="upper left")
        figure.tight_layout()
        return rendered(figure, "svg")


def main() -> None:
    """Print the table, and write the picture where one is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", type=Path)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--keep", type=int, default=33)
    asked = parser.parse_args()
    grasp_set = GraspSet.load(asked.set)
    named = ((f"{asked.keep} levels", "both", True), (f"{asked.keep} switches of {CLOSES_N:g} N", "switches", False))
    curves = [
        (name, colour, rates(grasp_set, right(grasp_set, asked.keep, levels=levels))) for name, colour, levels in named
    ]
    steps = [*(f"{force:g} N" for force in FORCES_N), "full grip"]
    cells = [[f"{100 * found[n].mean:.1f}" for _, _, found in curves] for n in range(len(steps))]
    lines = [f"| {' | '.join((step, *row))} |" for step, row in zip(steps, cells, strict=True)]
    print(table(("frames at", *(f"{name}, %" for name, _, _ in curves)), lines))
    if asked.output is not None:
        asked.output.write_bytes(draw(curves))


if __name__ == "__main__":
    main()

"""The gain of pads with levels over switches: the scenes `kamakura-analog` and `initial-contact`, simulated.

    python benchmarks/analog.py [-o FIGURE.svg]

Prints what docs/project/results.md reports: accuracy with the 33 pads that ID3 chooses inside each fold as switches,
read as switches that close at 1 N (the paper's), as three levels each, and as codes; and the accuracy by the force on
the hardest pressed pad, which it draws. Folds of trials, additive logit.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from onset import READINGS, Reading, draw, onset

from thenar.compiler.evaluation.folds import trial_folds
from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.placement.elements import Element, bits_of, elements_of
from thenar.compiler.placement.placement import choose
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.compiler.trainers.base import Training
from thenar.runtime.model.tables import winners
from thenar.runtime.recipe import Recipe
from thenar.simulator import load_scene, simulate

KEPT, FOLDS, CLOSES_N, LEVELS = 33, 4, 1.0, 3
LOGIT = Recipe(trainer="logit")


def read(learning: Samples, test: Samples, pads: GraspSet, reading: Reading) -> tuple[Samples, Samples]:
    """Return both with the pads that ID3 chooses on the first as switches, with one kind of reading."""
    closed = tuple(Element(pad, int(column.code(CLOSES_N))) for pad, column in enumerate(pads.taxel_columns))
    kept = choose(bits_of(learning, closed))[0][:KEPT]
    if reading == "switches":
        elements = tuple(closed[pad] for pad in kept)
    elif reading == "levels":
        elements = tuple(element for element in elements_of(learning, LEVELS) if element.column in kept)
    else:
        return coded(learning, kept), coded(test, kept)
    return bits_of(learning, elements), bits_of(test, elements)


def coded(samples: Samples, pads: tuple[int, ...]) -> Samples:
    """Return samples with the codes of these pads before those of the joints."""
    codes = np.hstack([samples.taxels[:, list(pads)], samples.codes])
    return replace(samples, codes=codes, taxels=samples.taxels[:, :0])


def rates(pads: GraspSet) -> Iterator[tuple[Reading, Rate, Rate]]:
    """Yield a reading, and the rates without and with joints."""
    samples, training = Samples.of(pads), Training.of(LOGIT)
    folds = trial_folds(samples.labels, samples.trials, FOLDS, 1)
    for reading in READINGS:
        found = np.empty((2, len(samples.labels)), np.intp)
        for fold in folds:
            learning, test = read(samples.rows(fold.train), samples.rows(fold.test), pads, reading)
            for row, joints in enumerate((False, True)):
                first = 0 if joints else learning.codes.shape[1] - len(pads.joints)
                columns = tuple(range(learning.codes.shape[1])) if joints else tuple(range(first))
                model = training.train(learning.with_joints(columns))
                found[row, fold.test] = winners(model.scores(test.switches, test.with_joints(columns).codes))
        alone, both = (Rate.predicted(one, samples.labels, samples.trials, of="pooled") for one in found)
        yield reading, alone, both


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("-o", "--output", type=Path, help="the .svg to write")
    asked = parser.parse_args()
    analog, contact = (load_scene(name) for name in ("kamakura-analog", "initial-contact"))
    print(f"| {KEPT} pads, read as | alone, % | with the joints, % |\n|---|---|---|")
    for reading, alone, both in rates(simulate(analog).grasp_set):
        cells = (f"{100 * rate.mean:.1f} [{100 * rate.low:.1f}, {100 * rate.high:.1f}]" for rate in (alone, both))
        print(f"| {reading} | {' | '.join(cells)} |", flush=True)
    found = onset(simulate(contact).grasp_set, closes_n=CLOSES_N, options=LOGIT, levels=LEVELS)
    forces = " | ".join(f"{force:g}" for force in found.newtons)
    print(f"\n| N on the hardest pressed pad | {forces} |\n|---|{'---|' * len(found.newtons)}")
    trials = (str(rate.total if rate else 0) for rate in found.curves[0].rates)
    print(f"| trials | {' | '.join(trials)} |")
    for curve in found.curves:
        cells = ("" if rate is None else f"{100 * rate.mean:.1f}" for rate in curve.rates)
        print(f"| {curve.title} | {' | '.join(cells)} |", flush=True)
    if asked.output:
        draw(found, asked.output)


if __name__ == "__main__":
    main()

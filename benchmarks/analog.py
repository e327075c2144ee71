"""The gain of pads with levels over switches: the scenes `kamakura-analog` and `initial-contact`, simulated.

    python benchmarks/analog.py [-o FIGURE.svg]

Prints what docs/project/results.md reports: accuracy with the 33 pads that ID3 chooses inside each fold as switches,
read as switches that close at 1 N (the paper's), as three levels each, and as codes; and the accuracy at initial
contact, by the force on the hardest pressed pad, which it draws. There, from each trial and for each force, the row is
taken whose hardest pressed pad reads closest to that force, if any is within half a step. One model learns from the
rows of all forces, since a glove does not know how far a grasp has progressed. Folds of trials, additive logit.
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from thenar.compiler.evaluation.folds import trial_folds
from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.pictures import on_paper, painting, rendered
from thenar.compiler.placement.elements import Element, Elements, bits_of, elements_of
from thenar.compiler.placement.placement import choose
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.compiler.trainers.base import Training
from thenar.compiler.workers import in_workers
from thenar.runtime.files import write_atomically
from thenar.runtime.model.tables import winners
from thenar.runtime.recipe import Recipe
from thenar.simulator import load_scene, simulate

KEPT, FOLDS, CLOSES_N, LEVELS = 33, 4, 1.0, 3
NEWTONS = tuple(step / 10 for step in range(1, 11))
TRAINING = Training.of(Recipe(trainer="logit"))
# How pads are read; "nothing": the joints alone.
READINGS = ("switches", "levels", "codes")
COLOURS = {"switches": "ink", "levels": "switches", "codes": "baseline-2", "nothing": "joints"}

Labels = NDArray[np.intp]


def read(samples: Samples, learning: Samples, closed: Elements, kept: Sequence[int], reading: str) -> Samples:
    """Return samples with one reading of the pads `kept`: `closed` as switches, or levels found on `learning`."""
    if reading in ("codes", "nothing"):
        pads = samples.taxels[:, list(kept) if reading == "codes" else []]
        return replace(samples, codes=np.hstack([pads, samples.codes]), taxels=pads[:, :0])
    every = closed if reading == "switches" else elements_of(learning, LEVELS)
    return bits_of(samples, tuple(element for element in every if element.column in kept))


def predicted(task: tuple[Samples, Elements, int | None, str, bool]) -> tuple[tuple[str, bool], Labels]:
    """Return reading and joints, and the types of all rows by models of the other folds, in which ID3 chooses pads."""
    samples, closed, most, reading, joints = task
    found = np.empty(len(samples.labels), np.intp)
    for fold in trial_folds(samples.labels, samples.trials, FOLDS, 1):
        learning, test = samples.rows(fold.train), samples.rows(fold.test)
        kept = range(len(closed)) if most is None else choose(bits_of(learning, closed))[0][:most]
        if not joints:
            learning, test = learning.with_joints(()), test.with_joints(())
        test = read(test, learning, closed, kept, reading)
        found[fold.test] = winners(
            TRAINING.train(read(learning, learning, closed, kept, reading)).scores(test.switches, test.codes)
        )
    return (reading, joints), found


def predictions(
    pads: GraspSet, rows: Labels, most: int | None, kinds: Sequence[tuple[str, bool]]
) -> Mapping[tuple[str, bool], Labels]:
    """Return the predictions for rows of a set by each reading, without or with the joints."""
    closed = tuple(Element(pad, int(column.code(CLOSES_N))) for pad, column in enumerate(pads.taxel_columns))
    samples = Samples.of(pads).rows(rows)
    found = dict(in_workers(predicted, ((samples, closed, most, *kind) for kind in kinds), -1))
    return {kind: found[kind] for kind in kinds}


def at_forces(pads: GraspSet) -> list[Labels]:
    """Return for each of NEWTONS the rows, at most one per trial: the nearest, ties to the first."""
    columns = [column.value(pads.taxels[:, place]) for place, column in enumerate(pads.taxel_columns)]
    hardest, trials, found = np.max(columns, axis=0), pads.trial_ids, []
    for force in NEWTONS:
        off = np.abs(hardest - force)
        order = np.lexsort((np.arange(len(off)), off, trials))
        nearest = order[np.unique(trials[order], return_index=True)[1]]
        found.append(np.sort(nearest[off[nearest] <= (NEWTONS[1] - NEWTONS[0]) / 2]))
    return found


def draw(curves: Mapping[tuple[str, bool], Sequence[Rate]], path: Path) -> None:
    """Write the curves as an .svg: accuracy over the force, 95 % intervals as bands; with the joints dashed."""
    with painting(font_size=10):
        figure = Figure(figsize=(8.0, 4.8), layout="constrained")
        axes = figure.subplots()
        for (reading, joints), rates in curves.items():
            low, mean, high = ([100 * getattr(rate, name) for rate in rates] for name in ("low", "mean", "high"))
            colour, style = on_paper(COLOURS[reading]), "--" if joints and reading != "nothing" else "-"
            axes.fill_between(NEWTONS, low, high, color=colour, alpha=0.15, lw=0)
            axes.plot(NEWTONS, mean, style, color=colour, marker="o", ms=3, label=title(reading, joints))
        axes.set_xlabel("force on the taxel pressed hardest, N")
        axes.set_ylabel("accuracy of single frames, %; bands: 95 %")
        axes.set_xticks(NEWTONS)
        axes.set_ylim(0, 100)
        axes.grid(color=on_paper("line"), lw=0.6)
        figure.legend(loc="outside right center", frameon=False)
        write_atomically(path, rendered(figure, "svg"))


def title(reading: str, joints: bool) -> str:
    """Return the inputs: "levels and joints"."""
    return " and ".join([reading] * (reading != "nothing") + ["joints"] * joints)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("-o", "--output", type=Path, help="the .svg to write")
    asked = parser.parse_args()
    analog, contact = (simulate(load_scene(name)).grasp_set for name in ("kamakura-analog", "initial-contact"))
    print(f"| {KEPT} pads, read as | % |\n|---|---|")
    alone, joined = ([(reading, joints) for reading in READINGS] for joints in (False, True))
    every = Samples.of(analog)
    for kind, found in predictions(analog, np.arange(len(analog)), KEPT, [*alone, *joined]).items():
        rate = Rate.predicted(found, every.labels, every.trials, of="pooled")
        print(f"| {title(*kind)} | {100 * rate.mean:.1f} [{100 * rate.low:.1f}, {100 * rate.high:.1f}] |", flush=True)

    at, kinds = at_forces(contact), [*alone, ("nothing", True), *joined]
    rows = np.unique(np.concatenate(at))
    every, places = Samples.of(contact).rows(rows), [np.searchsorted(rows, each) for each in at]
    print(f"\n| N on the hardest pressed pad | {' | '.join(f'{force:g}' for force in NEWTONS)} |")
    print(f"|---|{'---|' * len(NEWTONS)}\n| trials | {' | '.join(str(len(each)) for each in at)} |")
    curves = {}
    for kind, found in predictions(contact, rows, None, kinds).items():
        curves[kind] = [
            Rate.predicted(found[each], every.labels[each], every.trials[each], of="within subject") for each in places
        ]
        print(f"| {title(*kind)} | {' | '.join(f'{100 * rate.mean:.1f}' for rate in curves[kind])} |", flush=True)
    if asked.output:
        draw(curves, asked.output)


if __name__ == "__main__":
    main()

"""Initial contact: the accuracy at the moment when the hardest pressed taxel reads a given force.

From each trial and for each force, the row is taken whose hardest pressed taxel reads closest to that force, if any is
close enough. One model learns from the rows of all forces, since a glove does not know how far a grasp has progressed,
and is tested force by force on unseen trials. Taxels are read as switches that close at one force, as levels, and as
codes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.evaluation.folds import EvaluationError, Fold, trial_folds
from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.pictures import on_paper, painting, rendered
from thenar.compiler.placement.elements import Element, Elements, bits_of, elements_of
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples
from thenar.compiler.trainers.base import Training
from thenar.compiler.workers import in_workers
from thenar.runtime.files import write_atomically
from thenar.runtime.model.tables import winners
from thenar.runtime.recipe import Recipe

if TYPE_CHECKING:
    from thenar.runtime.manifest import Of

Reading = Literal["switches", "levels", "codes", "nothing"]
READINGS: tuple[Reading, ...] = ("switches", "levels", "codes")
COLOURS = {"switches": "ink", "levels": "switches", "codes": "baseline-2", "nothing": "joints"}
NEWTONS = tuple(step / 10 for step in range(1, 11))


@dataclass(frozen=True, slots=True)
class OnsetCurve:
    """The rates at each force, None where no trial has a row, for one reading of the taxels, with or without the
    joints.

    With the reading "nothing", only the joints are read.
    """

    reading: Reading
    joints: bool
    rates: tuple[Rate | None, ...]

    @property
    def title(self) -> str:
        """The inputs: "levels and joints"."""
        return " and ".join([self.reading] * (self.reading != "nothing") + ["joints"] * self.joints)


@dataclass(frozen=True, slots=True)
class Onset:
    """Curves of the same trials over `newtons`; switches close at `closes_n`."""

    newtons: tuple[float, ...]
    closes_n: float
    curves: tuple[OnsetCurve, ...]


def onset(
    grasp_set: GraspSet,
    newtons: Sequence[float] = NEWTONS,
    closes_n: float = 1.0,
    n_folds: int = 4,
    jobs: int = -1,
    options: Recipe | None = None,
    levels: int | None = None,
) -> Onset:
    """Return the curves of initial contact of a set with a row per frame, such as the scene `initial-contact` makes.

    Parameters
    ----------
    grasp_set : GraspSet
        With taxels in newtons, and frames of the beginning of each trial.
    newtons : sequence of float
        The forces, ascending. A row counts for a force within half the smallest step between them.
    closes_n : float
        The force that closes a switch: 1 N is the paper's.
    n_folds : int
        Folds of trials.
    jobs : int
        Worker processes; the result does not depend on their number.
    options : Recipe, optional
        The trainer and its settings; the additive logit by default.
    levels : int, optional
        The most levels of a taxel, found in each fold's training rows; the default is that of placements.

    Raises
    ------
    EvaluationError
        If no taxel is in newtons, or no row is of any of the forces.
    """
    in_newtons = [place for place, taxel in enumerate(grasp_set.taxel_columns) if taxel.unit == "N"]
    if not in_newtons:
        raise EvaluationError("initial contact needs taxels in newtons, and the set has none: calibrate them to N")
    at = _rows(grasp_set, in_newtons, np.array(newtons, dtype=np.float64))
    everything = np.unique(np.concatenate([rows for rows in at if rows.size] or [np.empty(0, np.intp)]))
    if not everything.size:
        raise EvaluationError(f"no trial has a frame whose hardest pressed taxel reads {newtons[0]} to {newtons[-1]} N")
    samples = Samples.of(grasp_set).rows(everything)
    closed = tuple(
        Element(len(grasp_set.switch_names) + place, int(np.clip(taxel.code(closes_n), 0, 65535)))
        for place, taxel in enumerate(grasp_set.taxel_columns)
    )
    kinds: list[tuple[Reading, bool]] = [(reading, False) for reading in READINGS]
    if grasp_set.joints:
        kinds += [("nothing", True), *((reading, True) for reading in READINGS)]
    folds = trial_folds(samples.labels, samples.trials, n_folds, seed=1)
    training = Training.of(options or Recipe(trainer="logit"))
    tasks = ((samples, closed, levels, kind, fold, training) for kind in kinds for fold in folds)
    predicted = {kind: np.empty(len(samples.labels), np.intp) for kind in kinds}
    for kind, fold, labels in in_workers(_predicted, tasks, jobs):
        predicted[kind][fold.test] = labels
    of: Of = "pooled" if np.ptp(samples.subjects) else "within subject"
    places = [np.searchsorted(everything, rows) for rows in at]

    def rate(labels: NDArray[np.intp], rows: NDArray[np.intp]) -> Rate | None:
        if not rows.size:
            return None
        return Rate.predicted(labels[rows], samples.labels[rows], samples.trials[rows], of=of)

    curves = tuple(OnsetCurve(*kind, tuple(rate(predicted[kind], rows) for rows in places)) for kind in kinds)
    return Onset(tuple(newtons), closes_n, curves)


def _rows(grasp_set: GraspSet, taxels: list[int], newtons: NDArray[np.float64]) -> list[NDArray[np.intp]]:
    """Return for each force the row indices, at most one per trial: the nearest, ties to the first."""
    columns = [grasp_set.taxel_columns[place].value(grasp_set.taxels[:, place]) for place in taxels]
    hardest, trials = np.max(columns, axis=0), grasp_set.trial_ids
    reach = float(np.diff(newtons).min()) / 2 if len(newtons) > 1 else float(newtons[0]) / 2
    found = []
    for force in newtons:
        off = np.abs(hardest - force)
        order = np.lexsort((np.arange(len(off)), off, trials))
        nearest = order[np.unique(trials[order], return_index=True)[1]]
        found.append(np.sort(nearest[off[nearest] <= reach]))
    return found


_Task = tuple[Samples, Elements, int | None, tuple[Reading, bool], Fold, Training]


def _predicted(task: _Task) -> tuple[tuple[Reading, bool], Fold, NDArray[np.intp]]:
    samples, closed, levels, kind, fold, training = task
    reading, joints = kind
    n_switches, learning = samples.n_switches, samples.rows(fold.train)
    if not joints:
        samples, learning = samples.with_joints(()), learning.with_joints(())
    if reading in ("levels", "switches"):
        elements = elements_of(learning, levels) if reading == "levels" else (*map(Element, range(n_switches)), *closed)
        learning, test = bits_of(learning, elements), bits_of(samples.rows(fold.test), elements)
    else:
        learning, test = _coded(learning, reading), _coded(samples.rows(fold.test), reading)
    return kind, fold, winners(training.train(learning).scores(test.switches, test.codes))


def _coded(samples: Samples, reading: Reading) -> Samples:
    """Return samples whose taxels are read like joints, or without taxels and switches."""
    empty = samples.taxels[:, :0]
    if reading == "nothing":
        return replace(samples, switches=samples.switches[:, :0], taxels=empty)
    return replace(samples, codes=np.hstack([samples.codes, samples.taxels]), taxels=empty)


def draw(found: Onset, path: Path) -> None:
    """Write the curves as an .svg: accuracy over the force, 95 % intervals as bands; with the joints dashed."""
    from matplotlib.figure import Figure

    with painting(font_size=10):
        figure = Figure(figsize=(8.0, 4.8), layout="constrained")
        axes = figure.subplots()
        for curve in found.curves:
            points = [(n, rate) for n, rate in zip(found.newtons, curve.rates, strict=True) if rate is not None]
            forces, colour = [force for force, _ in points], on_paper(COLOURS[curve.reading])
            low, mean, high = ([100 * getattr(rate, n) for _, rate in points] for n in ("low", "mean", "high"))
            axes.fill_between(forces, low, high, color=colour, alpha=0.15, lw=0)
            style = "--" if curve.joints and curve.reading != "nothing" else "-"
            axes.plot(forces, mean, style, color=colour, marker="o", ms=3, label=curve.title)
        axes.set_xlabel("force on the taxel pressed hardest, N")
        axes.set_ylabel("accuracy of single frames, %; bands: 95 %")
        axes.set_xticks(found.newtons)
        axes.set_ylim(0, 100)
        axes.grid(color=on_paper("line"), lw=0.6)
        figure.legend(loc="outside right center", frameon=False)
        write_atomically(path, rendered(figure, "svg"))

"""What accuracy costs in time, for simulation: a scene with each of its effects removed in turn."""

from collections.abc import Callable
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.compiler.evaluation.compositions import COMPOSITIONS, inputs
from thenar.compiler.evaluation.fits import Fit, Training, run_fits
from thenar.compiler.evaluation.populations import populations
from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.recordings.graspset import GraspSet
from thenar.simulator.running.pipeline import DEFAULT_CONTACT
from thenar.simulator.running.sampling import best_us
from thenar.simulator.running.simulation import Simulated, simulate
from thenar.simulator.scenes.scene import Scene

Progress = Callable[[int, int], None]
Bits = NDArray[np.bool_]

FOLDS, ROUNDS, SEED = 4, 100, 1

# All switches, all joints, and both: no placement has a say in what an effect does.
_KINDS = {"switches": COMPOSITIONS[4], "joints": COMPOSITIONS[3], "both": COMPOSITIONS[0]}
_Z = 1.959963984540054  # of the normal distribution, for 95 %


class Change(msgspec.Struct, frozen=True):
    """A difference of two recognition rates of the same grasps, and its 95 % interval."""

    mean: float
    low: float
    high: float


class Recognised(msgspec.Struct, frozen=True):
    """The recognition rate from some inputs, and what removing the effect changed; None for the whole scene."""

    inputs: str
    rate: Rate
    change: Change | None


class Variant(msgspec.Struct, frozen=True):
    """The scene without an effect, or the whole scene (`without` is None); us_a_grasp of processor time."""

    without: str | None
    rows: int
    unsettled: int
    us_a_grasp: float
    rates: tuple[Recognised, ...]


class Ablation(msgspec.Struct, frozen=True):
    """The whole scene, and then the scene without each of its effects."""

    simulated: bool
    scene: str
    seed: int
    folds: int
    rounds: int
    variants: tuple[Variant, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Outcome:
    """A variant's simulation, and which of its rows (n,) were recognised from each kind of inputs."""

    simulated: Simulated
    correct: dict[str, Bits]


def ablate(scene: Scene, jobs: int = -1, progress: Progress | None = None) -> Ablation:
    """Return what each effect of a scene does to the recognition rate of each subject's own grasps, and to the time.

    LogitBoost, cross-validated within each subject; a grasp is one row, that of its read-out. No scene can do without a
    contact model: contact.quasistatic is never removed, and takes the place of another. `progress` counts fits.
    Raises SceneError if the scene cannot be simulated, EvaluationError if it has too few repetitions to cross-validate.
    """
    scene = msgspec.structs.replace(scene, recording=msgspec.structs.replace(scene.recording, rows="last"))
    listed = [each.name for each in scene.effects]
    variants = [None, *(name for name in listed if name != DEFAULT_CONTACT)]
    count = len(_KINDS) * FOLDS * len(scene.subjects)
    outcomes: list[_Outcome] = []
    times = best_us(scene, variants)
    for number, without in enumerate(variants):
        simulated = simulate(scene, jobs, without=without)
        report = None if progress is None else _further(progress, number * count, len(variants) * count)
        outcomes.append(_Outcome(simulated, _correct(simulated.grasp_set, jobs, report)))
    return Ablation(
        simulated=True,
        scene=scene.name,
        seed=scene.seed,
        folds=FOLDS,
        rounds=ROUNDS,
        variants=tuple(_variant(*each, outcomes[0]) for each in zip(variants, times, outcomes, strict=True)),
    )


def _further(progress: Progress, before: int, total: int) -> Progress:
    return lambda done, _: progress(before + done, total)


def _correct(grasp_set: GraspSet, jobs: int, progress: Progress | None) -> dict[str, Bits]:
    """Return for each kind of inputs which rows (n,) were recognised when they were left out of training."""
    parts = populations(grasp_set, "stratified", FOLDS, repeats=1, seed=SEED)
    sizes = (len(grasp_set.switch_names), len(grasp_set.joints))
    fits = {
        name: [Fit(fold, kind.columns((), *sizes), part.grasps) for part in parts for fold in part.folds]
        for name, kind in _KINDS.items()
    }
    everything = [fit for some in fits.values() for fit in some]
    found = run_fits(inputs(grasp_set), grasp_set.labels, everything, Training(ROUNDS), jobs, progress)
    correct = {name: np.zeros(len(grasp_set), dtype=np.bool_) for name in fits}
    for name, some in fits.items():
        for fit in some:
            correct[name][fit.fold.test] = found[fit] == grasp_set.labels[fit.fold.test]
    return correct


def _variant(without: str | None, us_a_grasp: float, one: _Outcome, whole: _Outcome) -> Variant:
    report = one.simulated.report
    rates = (_recognised(name, one, whole) for name in one.correct)
    return Variant(
        without=without,
        rows=report.rows,
        unsettled=len(report.unsettled),
        us_a_grasp=us_a_grasp,
        rates=tuple(rates),
    )


def _recognised(name: str, one: _Outcome, whole: _Outcome) -> Recognised:
    correct = one.correct[name]
    rate = Rate.of((int(np.count_nonzero(correct)),), len(correct))
    if one is whole:
        return Recognised(name, rate, None)
    rows, whole_rows = _common(one.simulated.grasp_set, whole.simulated.grasp_set)
    return Recognised(name, rate, change_of(correct[rows], whole.correct[name][whole_rows]))


def _common(one: GraspSet, other: GraspSet) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows (m,) of each set that are of the same repetitions: one has what did not settle in the other."""
    keys = [{key: row for row, key in enumerate(zip(each.subjects, each.trials, strict=True))} for each in (one, other)]
    same = [key for key in keys[0] if key in keys[1]]
    first, second = (np.array([rows[key] for key in same], dtype=np.intp) for rows in keys)
    return first, second


def change_of(now: Bits, before: Bits) -> Change:
    """Return the change of the rate of the same m > 0 grasps, recognised `now` and `before`, with its 95 % interval.

    A difference of paired proportions with half a grasp added to each cell of the 2 x 2 table (Agresti and Min 2005,
    Statistics in Medicine 24:729-740). It says how much the choice of grasps matters, not the cut into folds.
    """
    gained = float(np.count_nonzero(now & ~before))
    lost = float(np.count_nonzero(before & ~now))
    m = len(now) + 2.0
    middle = (gained - lost) / m
    reach = _Z * ((gained + lost + 1.0) / m - middle * middle) ** 0.5 / m**0.5
    mean = (gained - lost) / len(now)
    return Change(mean, max(-1.0, min(mean, middle - reach)), min(1.0, max(mean, middle + reach)))

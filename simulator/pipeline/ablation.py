"""Ablation of a simulation: a scene with each of its effects removed in turn, its accuracy and its time."""

from collections.abc import Callable

import msgspec

from thenar.compiler.evaluation.ablation import FOLDS, ROUNDS, Ablation, Made, ablated

from ..scenes.scene import Scene
from .explain import best_us
from .simulation import simulate
from .steps import DEFAULT_CONTACT


def ablate(scene: Scene, jobs: int = -1, progress: Callable[[int, int], None] | None = None) -> Ablation:
    """Return the influence of each effect of a scene on accuracy and time; a grasp is one row, its read-out.

    Every scene needs a contact model: contact.quasistatic is never removed, and replaces another.
    Raises SceneError if the scene cannot be simulated, EvaluationError if it has too few repetitions to cross-validate.
    """
    recording = msgspec.structs.replace(scene.recording, rows="last", rest=False)
    scene = msgspec.structs.replace(scene, recording=recording)
    variants = [None, *(effect.name for effect in scene.effects if effect.name != DEFAULT_CONTACT)]
    times = best_us(scene, variants)
    simulated = (
        (without, us, simulate(scene, jobs, without=without)) for without, us in zip(variants, times, strict=True)
    )
    made = (Made(without, one.grasp_set, len(one.report.unsettled), us) for without, us, one in simulated)
    results = ablated(made, len(variants), len(scene.subjects), jobs, progress)
    return Ablation(simulated=True, scene=scene.name, seed=scene.seed, folds=FOLDS, rounds=ROUNDS, variants=results)

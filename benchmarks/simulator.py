"""The contact models compared on every grasp of a scene; and the memory of a simulation.

    python benchmarks/simulator.py [SCENE] [--repetitions N] [--no-memory]

All models get the same hands: the scene's effects vary posture, object and grip. A grasp's ON set are the switches that
bear more than the scene's threshold. Prints the tables of docs/explanation/simulator.md.
"""

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
from collections.abc import Iterator
from typing import NamedTuple

import msgspec
import numpy as np
from contacts import jaccard, of_settled, on_sets, poses, row, solved, table, together

from thenar.simulator.contact.model import Contact, ContactModel
from thenar.simulator.effects import contact_mujoco, contact_quasistatic
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.running.pipeline import compile_pipeline
from thenar.simulator.running.simulation import simulate
from thenar.simulator.scenes.decode import load_scene
from thenar.simulator.scenes.scene import Scene

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
# The models, and the most milliseconds that a grasp may take in each.
MODELS = {"quasistatic": "0.5", "mujoco": "3", "mujoco, object held softly": ""}
# The object on the spring of quasistatic, with a longer time, since it takes longer to settle on so soft a spring.
HELD_SOFTLY = contact_mujoco.Parameters(weld_n_per_m=50.0, weld_nm_per_rad=0.1, steps=200)
DIGITS = ("thumb", "index", "middle", "ring", "little", "palm")
# Time settings, compared with the same for five times as long.
SETTINGS = ((2.0, 100), (5.0, 30), (5.0, 60), (5.0, 100), (10.0, 30), (20.0, 30), (50.0, 30))
REFERENCE = (5.0, 300)
TRIED = 8
MEMORY_REPETITIONS = (25, 100, 400)


class Compared(NamedTuple):
    """The same batch under all models of MODELS, in that order."""

    grasp: str
    found: tuple[Contact, ...]


def models(scene: Scene) -> list[ContactModel]:
    setting = compile_pipeline(scene).setting
    return [
        contact_quasistatic.model(contact_quasistatic.Parameters(), setting),
        contact_mujoco.model(contact_mujoco.Parameters(), setting),
        contact_mujoco.model(HELD_SOFTLY, setting),
    ]


def compare(made: list[ContactModel], batches: list[Batch]) -> list[Compared]:
    """Return every batch under every model."""
    found = [solved(model, batches)[0] for model in made]
    grasps = [batch.condition.grasp for batch in batches]
    return [Compared(grasp, each) for grasp, each in zip(grasps, zip(*found, strict=True), strict=True)]


def by_type(compared: list[Compared]) -> Iterator[tuple[str, list[list[Contact]]]]:
    """Yield each grasp type and `all`, with the contacts of every model."""
    for grasp in [*dict.fromkeys(batch.grasp for batch in compared), "all"]:
        own = [batch.found for batch in compared if grasp in (batch.grasp, "all")]
        yield grasp, [list(found) for found in zip(*own, strict=True)]


def agreement(compared: list[Compared], threshold_n: float) -> str:
    """Return a line per grasp type: ON sets, and how many grasps did not settle or balance."""
    lines = []
    for grasp, found in by_type(compared):
        quasistatic, *others = on = [on_sets(each, threshold_n) for each in found]
        lines.append(
            row(
                grasp,
                " / ".join(f"{jaccard(zip(quasistatic, other, strict=True)):.2f}" for other in others),
                " / ".join(f"{jaccard((bits[:-1], bits[1:]) for bits in each):.2f}" for each in on),
                " / ".join(f"{np.concatenate(each).sum(axis=1).mean():.1f}" for each in on),
                " / ".join(f"{100 * (~np.concatenate(each).any(axis=1)).mean():.0f} %" for each in on),
                " / ".join(f"{100 * (~together(each, 'settled')).mean():.1f} %" for each in found),
                " / ".join(f"{np.median(of_settled(each, 'residual_n')):.2f}" for each in found),
                " / ".join(f"{np.median(of_settled(each, 'residual_nmm')):.2f}" for each in found),
            )
        )
    head = ("grasp type", "agreement with quasistatic", "of two repetitions", "switches ON", "none ON", "not settled")
    return table((*head, "residual, N", "residual, N mm"), lines)


def forces(compared: list[Compared]) -> str:
    """Return a line per grasp type: the mean force on every digit, for settled grasps only."""
    lines = []
    for grasp, found in by_type(compared):
        capsules_n = np.array([of_settled(each, "capsules_n").mean(axis=0) for each in found])
        digits = np.column_stack([capsules_n[:, :15].reshape(-1, 5, 3).sum(axis=2), capsules_n[:, 15:].sum(axis=1)])
        means = np.column_stack([digits, digits.sum(axis=1)]).T
        lines.append(row(grasp, *(" / ".join(f"{newtons:.1f}" for newtons in models) for models in means)))
    return table(("grasp type", *DIGITS, "all"), lines)


def cost(made: list[ContactModel], batches: list[Batch]) -> str:
    """Return a line per model: milliseconds per grasp, all solved together, and those of the slowest type."""
    lines = []
    for model, (name, bound) in zip(made, MODELS.items(), strict=True):
        solved(model, batches[:1])
        times = {grasp: _milliseconds(model, own) for grasp, own in _by_grasp(batches).items()}
        slowest = max(times, key=lambda grasp: times[grasp])
        lines.append(row(name, f"{_milliseconds(model, batches):.2f}", bound, f"{slowest}: {times[slowest]:.2f}"))
    return table(("contact model", "ms a grasp", "at most", "slowest grasp type, alone"), lines)


def _milliseconds(model: ContactModel, batches: list[Batch]) -> float:
    return 1e3 * solved(model, batches)[1] / sum(map(len, batches))


def _by_grasp(batches: list[Batch]) -> dict[str, list[Batch]]:
    grasps = dict.fromkeys(batch.condition.grasp for batch in batches)
    return {grasp: [batch for batch in batches if batch.condition.grasp == grasp] for grasp in grasps}


def settings(scene: Scene) -> str:
    """Return a line per time setting of MuJoCo: its cost, and its agreement with the reference, for one subject."""
    first = msgspec.structs.replace(scene, subjects=scene.subjects[:1])
    batches, setting = list(poses(first, TRIED)), compile_pipeline(scene).setting

    def run(dt_ms: float, steps: int) -> tuple[list[Contact], float]:
        return solved(contact_mujoco.model(contact_mujoco.Parameters(dt_ms=dt_ms, steps=steps), setting), batches)

    reference = on_sets(run(*REFERENCE)[0], scene.glove.threshold_n)
    lines = []
    for dt_ms, steps in SETTINGS:
        found, seconds = run(dt_ms, steps)
        settled = together(found, "settled")
        milliseconds = 1e3 * seconds / len(settled)
        agrees = jaccard(zip(on_sets(found, scene.glove.threshold_n), reference, strict=True))
        lines.append(
            row(f"{dt_ms:g} x {steps}", f"{milliseconds:.2f}", f"{100 * settled.mean():.1f} %", f"{agrees:.2f}")
        )
    return table(("ms x steps", "ms a grasp", "settled", "agreement with {:g} x {}".format(*REFERENCE)), lines)


def memory(name: str) -> str:
    """Return a line per number of repetitions: the peak memory of a process that simulates the scene."""
    lines = []
    for repetitions in MEMORY_REPETITIONS:
        command = [sys.executable, __file__, name, "--one", str(repetitions)]
        result = subprocess.run(command, env=os.environ | ONE_THREAD, check=True, capture_output=True).stdout
        rows, peak_mib, set_mib = json.loads(result)
        lines.append(row(repetitions, rows, f"{peak_mib:.0f} MiB", f"{set_mib:.1f} MiB"))
    return table(("repetitions a grasp type", "rows", "peak", "of it the set itself"), lines)


def one(scene: Scene, repetitions: int) -> tuple[int, float, float]:
    """Return rows, peak and size of the set in MiB, of a simulation of the first subject on one core."""
    smaller = msgspec.structs.replace(scene, subjects=scene.subjects[:1], repetitions=repetitions)
    made = simulate(smaller, jobs=1).grasp_set
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    arrays = (made.switches, made.codes, made.grasps, made.subjects, made.objects, made.trials)
    return len(made), peak, sum(array.nbytes for array in arrays) / 2**20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", default="kamakura")
    parser.add_argument("--repetitions", type=int, default=50, help="of every condition (default 50)")
    parser.add_argument("--no-memory", action="store_true", help="leave the memory out")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    scene = load_scene(options.scene)
    if options.one:
        print(json.dumps(one(scene, options.one)))
        return
    made, batches = models(scene), list(poses(scene, options.repetitions))
    compared = compare(made, batches)
    print(f"{platform.machine()}, one thread; scene {options.scene}, {options.repetitions} repetitions a condition")
    print(f"Several numbers are for: {' / '.join(MODELS)}.\n")
    threshold_n = scene.glove.threshold_n
    for lines in (cost(made, batches), agreement(compared, threshold_n), forces(compared), settings(scene)):
        print(lines, end="\n\n", flush=True)
    if not options.no_memory:
        print(memory(options.scene))


if __name__ == "__main__":
    main()

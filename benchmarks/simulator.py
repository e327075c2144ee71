"""The cost of the contact model on every grasp of a scene, what it finds, and the memory of a simulation.

    python benchmarks/simulator.py [SCENE]

The scene's effects vary posture, object and grip. A grasp's ON set are the switches that bear more than the scene's
threshold. Prints what docs/explanation/simulator.md reports.
"""

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence

import msgspec
import numpy as np

from thenar.simulator.contact.model import Contact
from thenar.simulator.effects.contact_quasistatic import Quasistatic
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import sessions, simulate
from thenar.simulator.pipeline.steps import Ledger, Pipeline, compile_pipeline
from thenar.simulator.planning.postures import Postures
from thenar.simulator.scenes.scene import Scene

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
CONTACT = 200  # the order of the contact model
MOST_MS = 0.5  # that a grasp may take
REPETITIONS = 50  # of every condition
MEMORY_REPETITIONS = (25, 100, 400)


def poses(scene: Scene, repetitions: int) -> Iterator[Batch]:
    """Yield every condition's first repetitions, in the form that the contact model takes."""
    pipeline = compile_pipeline(scene)
    before = tuple(stop for stop in pipeline.steps if stop.effect.order < CONTACT)
    for session in sessions(scene, Postures.shipped(scene.taxonomy)):
        for place, trials in enumerate(session.trials):
            batch = session.batch(place, np.arange(min(repetitions, len(trials))))
            Pipeline(pipeline.setting, before).run([batch], Ledger())
            yield batch


def solved(batches: Sequence[Batch]) -> tuple[list[Contact], float]:
    """Return the contacts of batches, solved together, and the processor time of a grasp in milliseconds."""
    start = time.process_time()
    contacts = Quasistatic().solve([batch.load() for batch in batches])
    return contacts, 1e3 * (time.process_time() - start) / sum(map(len, batches))


def jaccard(pairs: Iterable[tuple[np.ndarray, np.ndarray]]) -> float:
    """Return the switches ON in both divided by those ON in either, over all grasps."""
    both, either = np.sum([[(a & b).sum(), (a | b).sum()] for a, b in pairs], axis=0)
    return float(both / either) if either else 1.0


def row(*cells: object) -> str:
    return f"| {' | '.join(map(str, cells))} |"


def table(head: Iterable[str], lines: Iterable[str]) -> str:
    names = list(head)
    return "\n".join([row(*names), f"|{'---|' * len(names)}", *lines])


def by_type(batches: Sequence[Batch], found: Sequence[Contact]) -> Iterator[tuple[str, list[Batch], list[Contact]]]:
    """Yield each grasp type and `all`, with its batches and contacts."""
    grasps = [batch.condition.grasp for batch in batches]
    for grasp in [*dict.fromkeys(grasps), "all"]:
        own = [place for place, other in enumerate(grasps) if grasp in (other, "all")]
        yield grasp, [batches[place] for place in own], [found[place] for place in own]


def outcome(batches: Sequence[Batch], contacts: Sequence[Contact], threshold_n: float) -> str:
    """Return a line per grasp type: the cost, ON sets, and how many grasps did not settle or balance."""
    lines = []
    for grasp, own, found in by_type(batches, contacts):
        on = [each.forces_n > threshold_n for each in found]
        settled = np.concatenate([each.settled for each in found])
        lines.append(
            row(
                grasp,
                f"{solved(own)[1]:.2f}",
                f"{jaccard((bits[:-1], bits[1:]) for bits in on):.2f}",
                f"{np.concatenate(on).sum(axis=1).mean():.1f}",
                f"{100 * (~np.concatenate(on).any(axis=1)).mean():.0f} %",
                f"{100 * (~settled).mean():.1f} %",
            )
        )
    head = ("grasp type", "ms a grasp", "agreement of two repetitions", "switches ON", "none ON", "not settled")
    return table(head, lines)


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
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    scene = load_scene(options.scene)
    if options.one:
        print(json.dumps(one(scene, options.one)))
        return
    batches = list(poses(scene, REPETITIONS))
    solved(batches[:1])
    contacts, milliseconds = solved(batches)
    print(f"{platform.machine()}, one thread; scene {options.scene}, {REPETITIONS} repetitions a condition")
    print(f"All together: {milliseconds:.2f} ms a grasp (at most {MOST_MS}).\n")
    print(outcome(batches, contacts, scene.glove.threshold_n), end="\n\n", flush=True)
    print(memory(options.scene))


if __name__ == "__main__":
    main()

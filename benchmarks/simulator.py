"""The cost of the contact model on every grasp of a scene, and what it finds.

    python benchmarks/simulator.py [SCENE]

The scene's effects vary posture, object and grip. A grasp's ON set are the switches that bear more than the scene's
threshold. Prints what docs/explanation/simulator.md reports.
"""

import argparse
import platform
import time
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from thenar.simulator.contact.model import Contact
from thenar.simulator.effects.contact_quasistatic import Quasistatic
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import sessions
from thenar.simulator.pipeline.steps import Ledger, Pipeline, compile_pipeline
from thenar.simulator.planning.postures import Postures
from thenar.simulator.scenes.scene import Scene

CONTACT = 200  # the order of the contact model
MOST_MS = 0.5  # that a grasp may take
REPETITIONS = 50  # of every condition


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


def by_type(batches: Sequence[Batch], found: Sequence[Contact]) -> Iterator[tuple[str, list[Batch], list[Contact]]]:
    """Yield each grasp type and `all`, with its batches and contacts."""
    grasps = [batch.condition.grasp for batch in batches]
    for grasp in [*dict.fromkeys(grasps), "all"]:
        own = [place for place, other in enumerate(grasps) if grasp in (other, "all")]
        yield grasp, [batches[place] for place in own], [found[place] for place in own]


def rows(batches: Sequence[Batch], contacts: Sequence[Contact], threshold_n: float) -> Iterator[tuple[str, ...]]:
    """Yield the row of each grasp type: the cost, ON sets, and how many grasps did not settle or balance."""
    for grasp, own, found in by_type(batches, contacts):
        on = [each.forces_n > threshold_n for each in found]
        settled = np.concatenate([each.settled for each in found])
        yield (
            grasp,
            f"{solved(own)[1]:.2f}",
            f"{jaccard((bits[:-1], bits[1:]) for bits in on):.2f}",
            f"{np.concatenate(on).sum(axis=1).mean():.1f}",
            f"{100 * (~np.concatenate(on).any(axis=1)).mean():.0f} %",
            f"{100 * (~settled).mean():.1f} %",
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", default="kamakura")
    options = parser.parse_args()
    scene = load_scene(options.scene)
    batches = list(poses(scene, REPETITIONS))
    solved(batches[:1])
    contacts, milliseconds = solved(batches)
    print(f"{platform.machine()}, one thread; scene {options.scene}, {REPETITIONS} repetitions a condition")
    print(f"All together: {milliseconds:.2f} ms a grasp (at most {MOST_MS}).\n")
    print("| grasp type | ms a grasp | agreement of two repetitions | switches ON | none ON | not settled |")
    print("|---|---|---|---|---|---|")
    for row in rows(batches, contacts, scene.glove.threshold_n):
        print(f"| {' | '.join(row)} |")


if __name__ == "__main__":
    main()

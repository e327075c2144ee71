"""Solve grasps with several contact models, and format the tables."""

import time
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from thenar.simulator.contact.model import Contact, ContactModel
from thenar.simulator.pipeline.batch import Batch
from thenar.simulator.planning.postures import Postures
from thenar.simulator.running.pipeline import Ledger, Pipeline, compile_pipeline
from thenar.simulator.running.simulation import sessions
from thenar.simulator.scenes.scene import Scene


def solved(model: ContactModel, batches: Sequence[Batch]) -> tuple[list[Contact], float]:
    """Return a model's contacts for batches, solved together, and its processor time in seconds."""
    start = time.process_time()
    contacts = model.solve([batch.load() for batch in batches])
    seconds = time.process_time() - start
    return contacts, seconds


def poses(scene: Scene, repetitions: int) -> Iterator[Batch]:
    """Yield every condition's first repetitions, in the form that the contact model takes."""
    pipeline = compile_pipeline(scene)
    before = tuple(stop for stop in pipeline.stops if stop.effect.stage == "posture")
    for session in sessions(scene, Postures.shipped(scene.taxonomy)):
        for place, trials in enumerate(session.trials):
            batch = session.batch(place, np.arange(min(repetitions, len(trials))))
            Pipeline(pipeline.setting, before).run([batch], Ledger())
            yield batch


def jaccard(pairs: Iterable[tuple[np.ndarray, np.ndarray]]) -> float:
    """Return the switches ON in both divided by those ON in either, over all grasps."""
    both, either = np.sum([[(a & b).sum(), (a | b).sum()] for a, b in pairs], axis=0)
    return float(both / either) if either else 1.0


def together(found: Iterable[Contact], field: str) -> np.ndarray:
    return np.concatenate([getattr(each, field) for each in found])


def on_sets(found: Iterable[Contact], threshold_n: float) -> list[np.ndarray]:
    return [each.forces_n > threshold_n for each in found]


def of_settled(found: list[Contact], field: str) -> np.ndarray:
    kept: np.ndarray = together(found, field)[together(found, "settled")]
    return kept


def row(*cells: object) -> str:
    return f"| {' | '.join(map(str, cells))} |"


def table(head: Iterable[str], lines: Iterable[str]) -> str:
    names = list(head)
    return "\n".join([row(*names), f"|{'---|' * len(names)}", *lines])

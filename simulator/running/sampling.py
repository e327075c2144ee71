"""A few grasps of one subject, the middle one, to measure what a scene costs."""

from collections.abc import Sequence
from time import process_time

import numpy as np

from ..pipeline.batch import Batch
from ..pipeline.frames import at_a_time
from ..pipeline.ledger import Ledger
from ..planning.postures import Postures
from ..scenes.scene import Scene
from .pipeline import Pipeline, compile_pipeline
from .session import Session, conditions_of, session_of

_ROUNDS = 3


def middle_session(scene: Scene) -> Session:
    """Return the session of the middle subject; of all subjects, an order alone can take minutes.

    Raises SceneError where any subject's hand has no planned posture of an object.
    """
    postures = Postures.of(scene)
    conditions = [conditions_of(scene, subject, postures) for subject in scene.subjects]
    return session_of(scene, conditions[len(conditions) // 2])


def sample(session: Session, most: int) -> list[Batch]:
    """Return batches of all conditions of a session, at most about `most` repetitions in all."""
    share = max(most // len(session.trials), 1)
    return [session.batch(place, np.arange(min(share, len(trials)))) for place, trials in enumerate(session.trials)]


def best_us(scene: Scene, variants: Sequence[str | None], most: int = 128) -> list[float]:
    """Return the microseconds of processor time a grasp of the scene without each of `variants` (None: all of it).

    The same few grasps for each, in turn, several times over; the shortest time counts: what else the machine does only
    adds to it.
    """
    session = middle_session(scene)
    pipelines = [compile_pipeline(scene, without) for without in variants]
    most = min(at_a_time(pipeline.setting, most) for pipeline in pipelines)
    times = [[_seconds(pipeline, session, most) for pipeline in pipelines] for _ in range(_ROUNDS)]
    grasps = sum(map(len, sample(session, most)))
    return [min(own) * 1e6 / grasps for own in zip(*times, strict=True)]


def _seconds(pipeline: Pipeline, session: Session, most: int) -> float:
    batches = sample(session, most)
    start = process_time()
    pipeline.run(batches, Ledger())
    return process_time() - start

"""The steps and the estimated cost of a simulation, from the time of each step on a few grasps."""

import msgspec
import numpy as np

from thenar.compiler.workers import workers_of

from ..planning.plan import postures_of
from ..scenes.scene import Scene
from .batch import Batch
from .effect import at_a_time
from .simulation import SubjectSession, conditions_of, session_of
from .steps import Ledger, PipelineStep, StepCost, compile_pipeline


def middle_session(scene: Scene) -> SubjectSession:
    """Return the session of the middle subject; the order of trials of all subjects alone can take minutes.

    Raises SceneError if any subject's hand cannot hold an object.
    """
    postures = postures_of(scene)
    conditions = [conditions_of(scene, subject, postures) for subject in scene.subjects]
    return session_of(scene, conditions[len(conditions) // 2])


def sample(session: SubjectSession, most: int) -> list[Batch]:
    """Return batches of all conditions of a session, at most about `most` repetitions in all."""
    share = max(most // len(session.trials), 1)
    return [session.batch(place, np.arange(min(share, len(trials)))) for place, trials in enumerate(session.trials)]


# Number of measured grasps, fewer if each has many frames.
_MEASURED = 256


class StepPlan(msgspec.Struct, frozen=True):
    """A step, and its draws and time on the measured grasps.

    own      True for a step that every scene has      reads, writes  fields of a batch
    timed    whether it depends on time, so that whole streams of frames are simulated
    on_wire  whether it acts on bytes, so that frames are sent and received
    share    of the time of all steps
    """

    name: str
    summary: str
    own: bool
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    timed: bool
    on_wire: bool
    draws_a_grasp: float
    us_a_grasp: float
    share: float


class Explanation(msgspec.Struct, frozen=True):
    """The steps of a scene in order, and their estimated time.

    timed, on_wire  whether frames are simulated one by one, and sent as bytes
    measured        number of measured grasps, of `conditions` conditions
    us_a_grasp      of one process        expected_s  for all repetitions on `workers` processes
    """

    scene: str
    repetitions: int
    timed: bool
    on_wire: bool
    steps: tuple[StepPlan, ...]
    measured: int
    conditions: int
    us_a_grasp: float
    workers: int
    expected_s: float


def explain(scene: Scene, jobs: int = -1) -> Explanation:
    """Return the steps of `simulate` for a scene, measured on a few grasps.

    Raises SceneError if the scene cannot be simulated.
    """
    pipeline = compile_pipeline(scene)
    session = middle_session(scene)
    pipeline.run(sample(session, 1)[:1], Ledger())  # one-time work, such as imports
    ledger = Ledger()
    pipeline.run(sample(session, at_a_time(pipeline.setting, _MEASURED)), ledger)
    first = ledger.entries[pipeline.steps[0].effect.name]
    steps = tuple(_plan(step, ledger.entries[step.effect.name], ledger.nanoseconds) for step in pipeline.steps)
    repetitions, workers = len(session.before) * len(scene.subjects), workers_of(jobs)
    us_a_grasp = sum(step.us_a_grasp for step in steps)
    return Explanation(
        scene=scene.name,
        repetitions=repetitions,
        timed=pipeline.setting.timed,
        on_wire=pipeline.setting.on_wire,
        steps=steps,
        measured=first.grasps,
        conditions=first.calls,
        us_a_grasp=us_a_grasp,
        workers=workers,
        expected_s=us_a_grasp * repetitions / workers / 1e6,
    )


def _plan(step: PipelineStep, entry: StepCost, all_ns: int) -> StepPlan:
    effect = step.effect
    return StepPlan(
        name=effect.name,
        summary=effect.summary,
        own=step.own,
        reads=effect.reads,
        writes=effect.writes,
        timed=effect.timed,
        on_wire=effect.on_wire,
        draws_a_grasp=entry.draws / entry.grasps,
        us_a_grasp=entry.nanoseconds / 1e3 / entry.grasps,
        share=entry.nanoseconds / all_ns,
    )

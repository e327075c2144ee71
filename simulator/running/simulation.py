"""`simulate`: a scene in, a set of grasps and a report out."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from time import perf_counter

import numpy as np

from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.taxonomy import published
from thenar.compiler.workers import in_workers

from ..body.cyberglove import USED, Calibration, common_joints, raw_joints
from ..body.layout import murakami160
from ..errors import SceneError
from ..pipeline.batch import Batch
from ..pipeline.frames import at_a_time, hold_frame
from ..pipeline.ledger import Ledger
from ..planning.postures import Postures
from ..scenes.scene import Scene
from .notes import Notes, Unsettled, notes_of
from .pipeline import Pipeline, compile_pipeline
from .report import Report, grasp_reports, step_reports
from .rows import Codes, Rows, grasp_set, joined, rows_of
from .session import Session, sessions

Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class Simulated:
    """What came of a scene."""

    grasp_set: GraspSet
    report: Report


@dataclass(frozen=True, slots=True, eq=False)
class _Work:
    """Batches for one worker, each with the number of its condition."""

    scene: Scene
    without: str | None
    keep_unsettled: bool
    batches: tuple[tuple[int, Batch], ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Done:
    """What came of them."""

    rows: list[Rows]
    notes: list[Notes]
    ledger: Ledger


def simulate(
    scene: Scene,
    jobs: int = -1,
    progress: Progress | None = None,
    block: int = 512,
    *,
    keep_unsettled: bool = False,
    without: str | None = None,
) -> Simulated:
    """Return the set of grasps of `scene`, and the report. The set is the same for any `jobs` and `block`.

    jobs      worker processes, as joblib counts them: -1 for all cores, 1 for none beside this one
    progress  called with repetitions (done, all)
    block     about so many repetitions are simulated at a time, fewer where each has many frames
    keep_unsettled  keep repetitions that did not settle; the report names them either way
    without   a listed effect that is left out

    Raises SceneError if the scene cannot be simulated, or if nothing of it settles.
    """
    start = perf_counter()
    # What is wrong with the scene shows here and not in a worker.
    setting = compile_pipeline(scene, without).setting
    plan = sessions(scene, Postures.of(scene))
    works = (_Work(scene, without, keep_unsettled, group) for group in _groups(plan, at_a_time(setting, block)))
    total = sum(len(session.before) for session in plan)
    made = _gathered(in_workers(_run, works, jobs), total, progress)
    rows = _in_order(plan, made.rows)
    if not len(rows):
        why = _unsettled(scene, made)[0].why
        raise SceneError(f"scene {scene.name}: none of its {total} repetitions can be trusted; of the first, {why}")
    found = _set_of(scene, plan, rows)
    return Simulated(found, _report(scene, rows, found, made, perf_counter() - start, keep_unsettled=keep_unsettled))


def _groups(plan: Sequence[Session], block: int) -> Iterator[tuple[tuple[int, Batch], ...]]:
    """Yield groups of about `block` repetitions of one subject: batches with the numbers of their conditions."""
    first = 0
    for session in plan:
        group: list[tuple[int, Batch]] = []
        for place, trials in enumerate(session.trials):
            for start in range(0, len(trials), block):
                group.append((first + place, session.batch(place, np.arange(start, min(start + block, len(trials))))))
                if sum(len(batch) for _, batch in group) >= block:
                    yield tuple(group)
                    group = []
        if group:
            yield tuple(group)
        first += len(session.conditions)


@lru_cache(maxsize=1)
def _pipeline(scene: Scene, without: str | None) -> Pipeline:
    return compile_pipeline(scene, without)


def _run(work: _Work) -> _Done:
    pipeline, scene, done = _pipeline(work.scene, work.without), work.scene, _Done([], [], Ledger())
    every_frame, held = scene.recording.rows == "all", hold_frame(pipeline.setting)
    pipeline.run([batch for _, batch in work.batches], done.ledger)
    for number, batch in work.batches:
        kept = np.flatnonzero(batch.settled | work.keep_unsettled)
        done.rows.append(rows_of(batch, kept, number, _codes(scene, batch), held, every_frame=every_frame))
        done.notes.append(notes_of(batch))
    return done


def _codes(scene: Scene, batch: Batch) -> Codes:
    if scene.glove.codes == "raw":
        return batch.raw[..., :USED].astype(np.uint16)
    return Calibration.of_subject(scene.seed, batch.condition.subject).common_codes(batch.raw)


def _gathered(answers: Iterator[_Done], total: int, progress: Progress | None) -> _Done:
    everything, repetitions = _Done([], [], Ledger()), 0
    for done in answers:
        everything.rows.extend(done.rows)
        everything.notes.extend(done.notes)
        everything.ledger.merge(done.ledger)
        repetitions += sum(note.repetitions for note in done.notes)
        if progress is not None:
            progress(repetitions, total)
    return everything


def _in_order(plan: Sequence[Session], blocks: list[Rows]) -> Rows:
    subjects = np.repeat(np.arange(len(plan)), [len(session.conditions) for session in plan])
    return joined(blocks, subjects)


def _set_of(scene: Scene, plan: Sequence[Session], rows: Rows) -> GraspSet:
    conditions = [condition for session in plan for condition in session.conditions]
    switches = tuple(patch.name for patch in murakami160())
    joints = raw_joints() if scene.glove.codes == "raw" else common_joints()
    simulated = f"scene {scene.name}, seed {scene.seed}"
    return grasp_set(rows, conditions, switches, joints, published(scene.taxonomy), simulated)


def _report(scene: Scene, rows: Rows, found: GraspSet, made: _Done, seconds: float, *, keep_unsettled: bool) -> Report:
    return Report(
        simulated=True,
        scene=scene.name,
        seed=scene.seed,
        subjects=tuple(subject.name for subject in scene.subjects),
        repetitions=sum(note.repetitions for note in made.notes),
        rows=len(rows),
        seconds=seconds,
        lost_frames=sum(note.lost_frames for note in made.notes),
        kept_unsettled=keep_unsettled,
        unsettled=_unsettled(scene, made),
        grasps=grasp_reports(rows, found.labels, found.taxonomy.types, made.notes),
        steps=tuple(step_reports(made.ledger)),
    )


def _unsettled(scene: Scene, made: _Done) -> tuple[Unsettled, ...]:
    """Return the repetitions that did not settle, in the order of the sessions."""
    place = {subject.name: number for number, subject in enumerate(scene.subjects)}
    unsettled = (one for note in made.notes for one in note.unsettled)
    return tuple(sorted(unsettled, key=lambda one: (place[one.subject], one.trial)))

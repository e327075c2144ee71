"""`simulate`: a scene in, a set of grasps and a report out."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from time import perf_counter

import numpy as np

from thenar.compiler.elementary import Floats
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.taxonomy import published
from thenar.compiler.workers import in_workers

from ..body.condition import Condition
from ..body.cyberglove import USED, SubjectCalibration, common_joints, raw_joints
from ..body.layout import murakami160, taxel_places
from ..errors import SceneError
from ..planning.plan import Progress, postures_of
from ..planning.postures import Postures
from ..scenes.scene import Scene, Subject
from ..streams import Draw
from .batch import Batch, Integers
from .effect import at_a_time
from .glove import TAXEL_ADC, TaxelConverter
from .report import (
    Codes,
    Notes,
    Rows,
    SimulationReport,
    UnsettledGrasp,
    grasp_reports,
    grasp_set,
    joined,
    notes_of,
    rows_of,
    step_reports,
)
from .steps import Ledger, compile_pipeline

ORDER = "session.order"  # the draw site of the order of trials


@dataclass(frozen=True, slots=True, eq=False)
class SubjectSession:
    """The trials of one subject: p conditions in the order of the scene's objects, t trials.

    first       (p,)     the number of each condition's first repetition
    done        number of earlier trials
    trials      one array per condition: the trial of each of its repetitions, counted from these
    planned_deg (p, 20)  the conditions' planned postures
    before      (t,)     the condition of the previous trial; for the first, its own
    """

    conditions: tuple[Condition, ...]
    first: tuple[int, ...]
    done: int
    trials: tuple[Integers, ...]
    planned_deg: Floats
    before: Integers

    def batch(self, place: int, repetitions: Integers) -> Batch:
        """Return some repetitions (n,) of a condition of the session, counted from 0, ready for the pipeline."""
        trials = self.trials[place][repetitions]
        numbers = self.first[place] + repetitions
        return Batch(self.conditions[place], numbers, self.done + trials, self.planned_deg[self.before[trials]])


def sessions(scene: Scene, postures: Postures) -> tuple[SubjectSession, ...]:
    """Return every subject's session. Raises SceneError if an object has no planned posture."""
    return tuple(session_of(scene, conditions_of(scene, subject, postures)) for subject in scene.subjects)


def conditions_of(scene: Scene, subject: Subject, postures: Postures) -> tuple[Condition, ...]:
    """Return a subject's conditions, one per object. Raises SceneError if one has no planned posture."""
    hand = subject.hand()
    things = [(item.grasp, item.thing()) for item, repetitions in scene.shares() if repetitions]
    return tuple(
        Condition(subject.name, hand, grasp, thing, postures.held(hand, grasp, thing)) for grasp, thing in things
    )


def session_of(scene: Scene, conditions: tuple[Condition, ...]) -> SubjectSession:
    """Return the session of the subject with these conditions."""
    numbers = [share for _, share in scene.shares() if share]
    sites = [condition.site(np.array(share)) for condition, share in zip(conditions, numbers, strict=True)]
    # Repetitions are sorted by one random word each, which does not depend on other repetitions, types or objects.
    words = [Draw(scene.seed, ORDER, site, Counter()).per_repetition().words for site in sites]
    counts = list(map(len, words))
    owner = np.repeat(np.arange(len(conditions)), counts)
    order = np.argsort(np.concatenate(words), kind="stable")
    trials = np.empty(len(order), dtype=np.int64)
    trials[order] = np.arange(len(order))
    return SubjectSession(
        conditions=conditions,
        first=tuple(share.start for share in numbers),
        done=scene.done * scene.types,
        trials=tuple(np.split(trials, np.cumsum(counts)[:-1])),
        planned_deg=np.stack([condition.held.posture_deg for condition in conditions]),
        before=owner[np.concatenate([order[:1], order[:-1]])],
    )


@dataclass(frozen=True, slots=True)
class Simulation:
    """The results of a scene."""

    grasp_set: GraspSet
    report: SimulationReport


# For one worker: batches, each with the number of its condition.
_Batches = tuple[tuple[int, Batch], ...]


# The results of groups of batches.
_Done = tuple[list[Rows], list[Notes], Ledger]


def simulate(
    scene: Scene,
    jobs: int = -1,
    progress: Progress | None = None,
    block: int = 512,
    *,
    keep_unsettled: bool = False,
) -> Simulation:
    """Return the set of grasps of `scene`, and the report. The set is the same for any `jobs` and `block`.

    jobs      worker processes, as in joblib: -1 for all cores, 1 for none in addition to this one
    progress  called with repetitions (done, all); before, with the objects whose postures are planned
    block     approximate number of repetitions simulated at a time, fewer if each has many frames
    keep_unsettled  keep repetitions that did not settle; the report names them in any case

    Raises SceneError if the scene cannot be simulated, if none of it settles, or if a hand cannot hold an object.
    """
    start = perf_counter()
    # Errors of the scene are raised here and not in a worker.
    setting = compile_pipeline(scene).setting
    plan = sessions(scene, postures_of(scene, jobs, progress))
    run = partial(_run, scene, keep_unsettled)
    total = sum(len(session.before) for session in plan)
    done = in_workers(run, _groups(plan, at_a_time(setting, block)), jobs)
    blocks, notes, ledger = _gathered(done, total, progress)
    rows = joined(blocks, np.repeat(np.arange(len(plan)), [len(session.conditions) for session in plan]))
    if not len(rows):
        why = _unsettled(scene, notes)[0].why
        raise SceneError(f"scene {scene.name}: none of its {total} repetitions can be trusted; of the first, {why}")
    found = _set_of(scene, plan, rows, _taxels(scene))
    reported = _report(scene, rows, found, notes, ledger, perf_counter() - start, keep_unsettled=keep_unsettled)
    return Simulation(found, reported)


def _groups(plan: Sequence[SubjectSession], block: int) -> Iterator[_Batches]:
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


_pipeline = lru_cache(maxsize=1)(compile_pipeline)


def _run(scene: Scene, keep_unsettled: bool, batches: _Batches) -> _Done:
    pipeline, ledger = _pipeline(scene), Ledger()
    pipeline.run([batch for _, batch in batches], ledger)
    rows, notes = [], []
    for number, batch in batches:
        kept = np.flatnonzero(batch.settled | keep_unsettled)
        rows.append(rows_of(batch, kept, number, _codes(scene, batch), pipeline.setting))
        notes.append(notes_of(batch))
    return rows, notes, ledger


def _codes(scene: Scene, batch: Batch) -> Codes:
    if scene.glove.codes == "raw":
        return batch.raw[..., :USED].astype(np.uint16)
    return SubjectCalibration.of_subject(scene.seed, batch.condition.subject).common_codes(batch.raw)


def _gathered(results: Iterator[_Done], total: int, progress: Progress | None) -> _Done:
    all_rows, all_notes, ledger, repetitions = list[Rows](), list[Notes](), Ledger(), 0
    for rows, notes, costs in results:
        all_rows.extend(rows)
        all_notes.extend(notes)
        ledger.merge(costs)
        repetitions += sum(note.repetitions for note in notes)
        if progress is not None:
            progress(repetitions, total)
    return all_rows, all_notes, ledger


def _taxels(scene: Scene) -> tuple[Joint, ...]:
    """Return the joints of the scene's taxels: the meaning of counts by the effect that converts them."""
    listed = dict(scene.effects)
    converter = TaxelConverter(**dict(listed.get(TAXEL_ADC, ())))
    return tuple(converter.column(murakami160()[place].name) for place in taxel_places(scene.glove.taxels))


def _set_of(scene: Scene, plan: Sequence[SubjectSession], rows: Rows, taxels: tuple[Joint, ...]) -> GraspSet:
    conditions = [condition for session in plan for condition in session.conditions]
    places = tuple(patch.name for patch in murakami160())
    joints = raw_joints() if scene.glove.codes == "raw" else common_joints()
    timed = scene.recording.rows == "all"
    return grasp_set(rows, conditions, places, taxels, joints, published(scene.taxonomy), scene.origin, timed=timed)


def _report(
    scene: Scene,
    rows: Rows,
    found: GraspSet,
    notes: Sequence[Notes],
    ledger: Ledger,
    seconds: float,
    *,
    keep_unsettled: bool,
) -> SimulationReport:
    return SimulationReport(
        simulated=True,
        scene=scene.name,
        seed=scene.seed,
        done=scene.done,
        subjects=tuple(subject.name for subject in scene.subjects),
        repetitions=sum(note.repetitions for note in notes),
        rows=len(rows),
        seconds=seconds,
        lost_frames=sum(note.lost_frames for note in notes),
        kept_unsettled=keep_unsettled,
        unsettled=_unsettled(scene, notes),
        grasps=grasp_reports(rows, found.labels, found.taxonomy.types, notes),
        steps=tuple(step_reports(ledger)),
    )


def _unsettled(scene: Scene, notes: Sequence[Notes]) -> tuple[UnsettledGrasp, ...]:
    """Return the repetitions that did not settle, in the order of the sessions."""
    place = {subject.name: number for number, subject in enumerate(scene.subjects)}
    unsettled = (one for note in notes for one in note.unsettled)
    return tuple(sorted(unsettled, key=lambda one: (place[one.subject], one.trial)))

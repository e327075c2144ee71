"""The page *Record*: guided collections into the project, begun, continued, led, and imported when they end.

It also leads those that are begun on the page *Wearer*, to which a build is then adapted. Their topics are
"collecting", the state of the guide, and "trials", what was accepted so far.
"""

import json
import secrets
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from threading import Event, Lock

import numpy as np
from msgspec.structs import replace

from thenar.compiler.recordings import check_names
from thenar.compiler.recordings.edits import TrialId
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.mcap_recording import import_recordings
from thenar.compiler.recordings.taxonomy import ANY, Taxonomy, collected, tasks_of
from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.calibration import RAW
from thenar.runtime.files import write_atomically
from thenar.runtime.frames import now_us
from thenar.runtime.glove import Glove
from thenar.runtime.published import NONE, DeviceHealth
from thenar.runtime.recording.guide import KEYS, CollectionGuide, Journal, Key, Trial, planned, read_journal
from thenar.runtime.recording.session import Collection
from thenar.runtime.web.server import message

from .collecting import collect, standing, task
from .edits import change, load_edits, restore
from .quick import QuickAccuracy
from .sensors import GloveSensors
from .studio import Asked, Handler, Report, Studio, glove_shown
from .wearer import WearerPage

_MOST_REPETITIONS = 1000
# Trials of each type that adapt a build; of each, if there is a new one.
_OFTEN, _TAUGHT = 2, 3
_SHOW_US = 100_000
# From this number of trials of every type on there is an accuracy.
_LEAST = 2


class RecordPage:
    """The page *Record* of a studio; `wearer` adapts the build to what was recorded for it."""

    def __init__(self, studio: Studio, wearer: WearerPage) -> None:
        self._studio, self._project, self._wearer = studio, studio.project, wearer
        self._sitting: Sitting | None = None
        requests: dict[str, Handler] = {
            "record": self._begin,
            "continue": self._continue,
            "wear": self._wear,
            "recorded": lambda asked: self._last.seen(asked.trial),
            "relabel": lambda asked: self._last.relabel(asked.trial, asked.name),
        }
        studio.add(requests, self.read)
        studio.publish("collecting", stage="over")

    def read(self, report: Report) -> None:
        """Show which recordings can be continued, and what can be recorded."""
        found = [
            {"id": id_, "name": path.name, "subject": collection.subject, "done": done, "total": total}
            for id_, path, collection, done, total in self._unfinished()
        ]
        if self._sitting is not None:
            self._sitting.tell()
        self._studio.publish(
            "recordings",
            unfinished=found,
            objects=self._objects is not None,
            glove=self._project.harness.exists(),
        )

    @property
    def _last(self) -> "Sitting":
        """The collection that runs, or was the last. Raises SettingError before the first."""
        if self._sitting is None:
            raise SettingError("nothing was recorded here yet: record, or use the page Errors")
        return self._sitting

    def _unfinished(self) -> list[tuple[str, Path, Collection, int, int]]:
        """Return the collections that can be continued: id, path, collection, and trials done, of how many."""
        found = []
        for member, path in self._project.members("recording").items():
            state = path.stat()
            about = _begun(path, state.st_size, state.st_mtime_ns)
            if about is not None and about[1] < about[2]:
                found.append((member, path, *about))
        return found

    @property
    def _objects(self) -> Path | None:
        path = self._project.folder / "objects.toml"
        return path if path.exists() else None

    # Beginnings.

    def _begin(self, asked: Asked) -> None:
        """Begin a collection: `name` is the subject, `id` the taxonomy, `value` the repetitions, `names`
        own types that no objects.toml lists yet; trial: with none; `ids`: types, if only those are recorded.
        """
        repetitions = asked.value or 0
        if not (1 <= repetitions <= _MOST_REPETITIONS and repetitions == int(repetitions)):
            raise SettingError(
                f"{repetitions:g} trials of each type: type a whole number from 1 to {_MOST_REPETITIONS}"
            )
        check_names("subject", [asked.name])
        self._project.wiring()
        if asked.id == "own" and self._objects is None:
            self._write_types(asked.names)
        types, tasks = collected(asked.id, self._objects, bool(asked.trial))
        if unknown := [name for name in asked.ids if name not in types.types]:
            raise SettingError(types.unknown(unknown[0]))
        tasks = tuple(task for task in tasks if not asked.ids or task.grasp in (*asked.ids, NONE))
        collection = Collection(asked.name, types.name, types.types, tasks, int(repetitions), secrets.randbits(32))
        recording = self._project.new_path(asked.name, ".mcap", ".grasps")
        words: list[object] = ["record", "--glove", self._project.harness, "--subject", asked.name]
        words += ["--taxonomy", asked.id, *([] if self._objects is None else ["--objects", self._objects])]
        words += ["--repetitions", int(repetitions), "--none" if asked.trial else "--no-none"]
        words += ["-o", recording.with_suffix(".grasps")]
        # A command records all types.
        self._start(recording, collection, command="" if asked.ids else self._project.command(words))
        if asked.name != self._project.state.wearer:
            self._project.remember(wearer=asked.name)
            self._studio.changed()

    def _write_types(self, names: Sequence[str]) -> None:
        """Write the wearer's own types to objects.toml, each with any object."""
        check_names("grasp type", names)
        if len(names) < 2:
            raise SettingError("name two grasp types at least, with commas between them: fist, pinch, point")
        lines = "".join(f"{json.dumps(name, ensure_ascii=False)} = [{json.dumps(ANY)}]\n" for name in names)
        write_atomically(self._project.folder / "objects.toml", lines.encode())

    def _continue(self, asked: Asked) -> None:
        journal = read_journal(self._project.path("recording", asked.id))
        self._start(journal.path, _collection(journal), journal)

    def _wear(self, asked: Asked) -> None:
        """Begin to record two trials of each type of the build, or three if `name` is a type to add; or go on."""
        harness, (_, build) = self._project.wiring(), self._wearer.base()
        if lacking := Glove(build, harness).system.unread:
            raise SettingError(lacking)
        added = [asked.name] if asked.name else []
        wearer, (types, tasks) = self._project.state.wearer, tasks_of(build.manifest, added)
        often = _TAUGHT if added else _OFTEN
        drawn, checksum = secrets.randbits(32), build.manifest.checksum
        wanted = Collection(wearer, types.name, types.types, tasks, often, drawn, checksum)
        for _, path, begun, _, _ in self._unfinished():
            if replace(begun, seed=drawn) == wanted:
                self._start(path, begun, read_journal(path))
                return
        self._start(self._project.new_path(wearer, ".mcap", ".grasps"), wanted)

    # A collection, on the thread of the station.

    def _start(
        self, recording: Path, collection: Collection, journal: Journal | None = None, *, command: str = ""
    ) -> None:
        sitting = Sitting(self._studio, recording, collection, journal, command)
        self._studio.station.start("recording", partial(self._lead, sitting), KEYS)

    def _lead(self, sitting: "Sitting", stop: Event) -> None:
        """Lead a collection, and write the set of all its accepted trials when it ends."""
        self._sitting, written = sitting, dict[str, object]()
        try:
            if done := sitting.lead(stop):
                written = self._write(sitting, done)
                self._adapt(sitting.collection, done == len(sitting.trials))
        finally:
            self._studio.publish("collecting", written, stage="over")
            self._studio.changed()

    def _write(self, sitting: "Sitting", done: int) -> dict[str, object]:
        """Write the set of the accepted trials, and return its size and warnings for pages.

        What was recorded for a build has its codes, on whichever page it was continued.
        """
        build = self._project.build_of(sitting.collection.build)
        codings = None if build is None else build[1].manifest.codings
        grasp_set, report = import_recordings([sitting.recording], codings=codings)
        grasp_set.save(sitting.output)
        warnings = [finding.message for finding in report.warnings]
        about = {"set": sitting.output.name, "size": str(grasp_set.size), "warnings": warnings}
        return about | {"done": done, "total": len(sitting.trials)}

    def _adapt(self, collection: Collection, complete: bool) -> None:
        """Adapt the build of everybody to what was recorded for it, once that is complete. Raises ThenarError."""
        if complete and collection.build and collection.build == self._wearer.base()[1].manifest.checksum:
            self._studio.queue("adapt", partial(self._wearer.adapt, collection.subject))


class Sitting:
    """A collection that is led, and its accepted trials, which can be looked at and edited meanwhile and afterwards.

    The log of edits names a trial as the set does that is written at the end, so an edit waits for that. What became of
    a trial that is undone is taken back.

    Parameters
    ----------
    studio : Studio
        The studio that leads it.
    recording : Path
        Its file.
    collection, journal
        As for `collect`.
    command : str
        What does the same in a terminal; "" if no command does.

    Attributes
    ----------
    output : Path
        The set that is written at the end.
    trials : dict of int to Trial
        All trials by their numbers.

    Raises
    ------
    ThenarError, OSError
        If there are too many trials, or the glove's files cannot be read.
    """

    def __init__(
        self, studio: Studio, recording: Path, collection: Collection, journal: Journal | None, command: str
    ) -> None:
        self._studio, self._project = studio, studio.project
        self.recording, self.collection, self._journal, self._command = recording, collection, journal, command
        self.output, self._adapts = recording.with_suffix(".grasps"), bool(collection.build)
        self.trials = {trial.number: trial for trial in planned(collection)}
        self._taxonomy = Taxonomy(collection.taxonomy, collection.types)
        self._sensors = GloveSensors(self._project)
        # The frames of captured trials; the accepted trials, after the first view; and of the last view the guide's
        # step and the time.
        self._captured = {} if journal is None else dict(journal.captured)
        self._accepted: Sequence[int] | None = None
        self._shown, self._telling = (-1, 0), Lock()

    def lead(self, stop: Event) -> int:
        """Lead through the trials, and return how many are accepted now. Raises as `collect` does."""
        self._studio.publish("collecting", stage="waiting", adapts=self._adapts)
        # Those of the collection before are no longer shown.
        self._studio.publish("trials", set="", trials=(), types=(), accuracy=None, command=self._command)
        done = collect(self._project.harness, self.collection, self.recording, self._journal, self._view, stop)
        self._studio.publish("collecting", stage="writing", adapts=self._adapts)
        return done

    def _view(self, guide: CollectionGuide, devices: Sequence[DeviceHealth]) -> list[Key]:
        """Show the guide's state ten times a second and at every change; return the keys pressed."""
        now, (step, shown_us) = now_us(), self._shown
        if step != guide.step:
            if guide.stage == "review" and guide.trial is not None:
                self._captured[guide.trial.number] = guide.captured
            if guide.accepted != self._accepted:
                self._accepted = guide.accepted
                # Edits of trials that were undone are taken back.
                self._studio.show_edits()
                self.tell()
        if step != guide.step or now >= shown_us + _SHOW_US:
            self._shown = guide.step, now
            prompt, thing = task(guide, self._taxonomy)
            content = {
                "adapts": self._adapts,
                "stage": guide.stage,
                "number": guide.done + guide.skipped + 1,
                "grasp": "" if guide.trial is None else guide.trial.grasp,
                "prompt": prompt,
                "thing": thing,
                "standing": standing(guide),
                "waits": guide.waits,
                "keys": guide.offered(),
                "done": guide.done,
                "total": guide.total,
                "skipped": guide.skipped,
            }
            self._studio.publish("collecting", content)
            self._studio.publish("glove", glove_shown(devices))
        return self._studio.station.pressed()

    def tell(self) -> None:
        """Show the accepted trials, and the accuracy in them, as they were edited; before the first view, nothing."""
        with self._telling:
            if self._accepted is None:
                return
            trials, made = [self.trials[number] for number in self._accepted], dict[int, str]()
            with suppress(ThenarError, OSError):
                edits = load_edits(self._project.edits)[0]
                made = {edit.trial: edit.new for edit in edits if edit.set == self.output.name}
            shown = [(trial.number, trial.grasp, trial.object) for trial in trials]
            types = list(dict.fromkeys(trial.grasp for trial in self.trials.values()))
            edited = [(trial, made.get(trial.number, trial.grasp)) for trial in trials]
            accuracy = self._accuracy([one for one in edited if one[1] not in ("", NONE)])
            about = {"set": self.output.name, "trials": shown, "types": types, "accuracy": accuracy}
            self._studio.publish("trials", about, command=self._command)

    def _id(self, trial: Trial) -> TrialId:
        """Return the name of a trial in the log: that in its set, which `import_recordings` makes as one session."""
        return self.output.name, self.collection.subject, "1", trial.grasp, trial.object, trial.number

    def _accuracy(self, edited: Sequence[tuple[Trial, str]]) -> dict[str, object] | None:
        """Return the quick accuracy of all sensors in trials of these types, if there are enough."""
        counts = Counter(grasp for _, grasp in edited)
        types = {*counts, *(trial.grasp for trial in self.trials.values())} - {NONE}
        if len(types) < 2 or any(counts[grasp] < _LEAST for grasp in types):
            return None
        rows = [self._sensors.read(*self._captured[trial.number]) for trial, _ in edited]
        shown, names = np.array([[value or 0 for value in row] for row in rows]), self._sensors.names
        switches = self._sensors.kinds.count("switch")
        try:
            grasp_set = GraspSet(
                switches=shown[:, :switches] == 1,
                switch_names=names[:switches],
                codes=shown[:, switches:].astype(np.uint16),
                joints=tuple(Joint(name, RAW, 0, 0.0, 1, 1.0) for name in names[switches:]),
                grasps=np.array([grasp for _, grasp in edited]),
                taxonomy=self._taxonomy,
                subjects=np.array(["me"] * len(edited)),
                objects=np.array([trial.object for trial, _ in edited]),
                trials=np.array([trial.number for trial, _ in edited]),
            )
            quick = QuickAccuracy(grasp_set)
            found = quick.of(range(len(quick.names)))
        except ThenarError as reason:
            return {"why": str(reason)}
        return {"of": found.of, "mean": found.mean, "low": found.low, "high": found.high}

    def seen(self, number: int) -> bytes:
        """Return the captured frames of a trial, as the hand shows them. Raises SettingError if there are none."""
        if number not in self._captured:
            raise SettingError(f"trial {number} was not recorded")
        trial, shown = self.trials[number], self._sensors.read(*self._captured[number])
        return message("recorded", self._sensors.drawn(shown), trial=number, grasp=trial.grasp, thing=trial.object)

    def relabel(self, number: int, new: str) -> None:
        """Make an accepted trial another type; an empty one leaves it out.

        Raises SettingError for another trial or type, and as `change` does.
        """
        if self._accepted is None or number not in self._accepted:
            raise SettingError(f"trial {number} is not among those that were accepted")
        for grasp in filter(None, (self.trials[number].grasp, new)):
            if grasp not in self._taxonomy.types:
                raise SettingError(self._taxonomy.unknown(grasp))
        change(self._project.edits, [self._id(self.trials[number])], new)
        # It may have been undone meanwhile.
        restore(self._project.edits, self.output.name, {*self._accepted})
        self._studio.changed()


@lru_cache(maxsize=1024)
def _begun(path: Path, _size: int, _changed_ns: int) -> tuple[Collection, int, int] | None:
    """Return the collection in a recording, and how many of how many trials are done; None if it is none.

    One that is known by its size and time of change is not read again: a long one takes a second.
    """
    try:
        journal = read_journal(path)
        return _collection(journal), len(journal.accepted), len(planned(_collection(journal)))
    except (ThenarError, OSError):
        return None


def _collection(journal: Journal) -> Collection:
    assert journal.session.collection is not None
    return journal.session.collection

"""The page *Record*: guided collections into the project, begun, continued, led, and imported when they end.

It also leads those that are begun on the page *Wearer*, to which a build is then adapted. While one runs, its topics
are "collecting", the state of the guide, and "trials", what was accepted so far.
"""

import json
import secrets
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache, partial
from pathlib import Path
from queue import SimpleQueue
from threading import Event

import numpy as np
from msgspec.structs import replace

from thenar.compiler.recordings import check_names
from thenar.compiler.recordings.edits import trials_of
from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.mcap_recording import import_recordings
from thenar.compiler.recordings.taxonomy import ANY, Taxonomy, collected, tasks_of
from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.calibration import RAW
from thenar.runtime.files import write_atomically
from thenar.runtime.frames import GloveFrame, SwitchFrame, now_us
from thenar.runtime.glove import Glove
from thenar.runtime.names import shortened
from thenar.runtime.published import NONE, DeviceHealth
from thenar.runtime.recording.guide import KEYS, CollectionGuide, Journal, Key, Trial, planned, read_journal
from thenar.runtime.recording.layout import switch_matrix
from thenar.runtime.recording.reader import Reader
from thenar.runtime.recording.session import Collection, Label
from thenar.runtime.web.server import message

from .collecting import collect, standing, task
from .edits import change, load_edits
from .quick import QuickAccuracy
from .sensors import GloveSensors
from .studio import Asked, Handler, Report, Studio, glove_message
from .wearer import WearerPage

_MOST_REPETITIONS = 1000
# Trials of each type that adapt a build; of each, if there is a new one.
_OFTEN, _TAUGHT = 2, 3
_SHOW_US = 100_000
# From this number of trials of every type on there is an accuracy.
_LEAST = 2
Frames = tuple[SwitchFrame | None, GloveFrame | None]


class RecordPage:
    """The page *Record* of a studio; `wearer` adapts the build to what was recorded for it."""

    def __init__(self, studio: Studio, wearer: WearerPage) -> None:
        self._studio, self._project, self._wearer = studio, studio.project, wearer
        # Of the collection that runs, or was the last: the keys that wait, the frames of its captured trials, what was
        # shown last (the guide's step and its time, and the accepted trials), its trials, and the set that it became.
        self._keys: SimpleQueue[Key] | None = None
        self._captured = dict[int, Frames]()
        self._shown = -1, 0
        self._accepted: Sequence[int] | None = None
        self._trials = dict[int, Trial]()
        self._recorded: Path | None = None
        requests: dict[str, Handler] = {
            "record": self._begin,
            "continue": self._continue,
            "wear": self._wear,
            "key": self._press,
            "recorded": self._trial,
            "relabel": self._relabel,
        }
        studio.add(requests, self.read)
        studio.publish("collecting", message("collecting", stage="over"))

    def read(self, report: Report) -> None:
        """Show which recordings can be continued, and what can be recorded."""
        found = [
            {"id": id_, "name": path.name, "subject": collection.subject, "done": done, "total": total}
            for id_, path, collection, done, total in self._unfinished()
        ]
        name = "" if self._recorded is None else self._recorded.name
        latest = {edit.of: edit.new for edit in load_edits(self._project.edits)[0] if edit.of[0] == name}
        edits = {trial[5]: new for trial, new in latest.items() if new != trial[3]}
        self._studio.publish("relabelled", message("relabelled", set=name, trials=edits))
        self._studio.publish(
            "recordings",
            message(
                "recordings",
                unfinished=found,
                taxonomies=["kamakura14", "cutkosky16", "feix33", "own"],
                objects=self._objects is not None,
                glove=self._project.harness.exists(),
            ),
        )

    def _unfinished(self) -> list[tuple[str, Path, Collection, int, int]]:
        """Return the collections that can be continued: id, path, collection, and trials done, of how many."""
        found = []
        for member in self._project.members("recording"):
            path = self._project.folder / member.name
            state = path.stat()
            about = _begun(path, state.st_size, state.st_mtime_ns)
            if about is not None and about[1] < about[2]:
                found.append((member.id, path, *about))
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
        self._start("recording", self._project.new_path(asked.name, ".mcap", ".grasps"), collection)
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
        self._start("recording", journal.path, _collection(journal), journal)

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
                self._start("wearer", path, begun, read_journal(path))
                return
        self._start("wearer", self._project.new_path(wearer, ".mcap", ".grasps"), wanted)

    # A collection, on the thread of the station.

    def _start(self, doing: str, recording: Path, collection: Collection, journal: Journal | None = None) -> None:
        planned(collection)
        self._studio.station.start(doing, partial(self._lead, doing, recording, collection, journal))

    def _lead(self, doing: str, recording: Path, collection: Collection, journal: Journal | None, stop: Event) -> None:
        """Lead a collection, and write the set of all its accepted trials when it ends."""
        self._keys = keys = SimpleQueue[Key]()
        self._shown, self._accepted, self._recorded = (-1, 0), None, None
        self._captured = {} if journal is None else _captured(recording)
        self._trials = {trial.number: trial for trial in planned(collection)}
        self._studio.publish("finished", message("finished", set=""))
        self._studio.publish("collecting", message("collecting", stage="waiting", doing=doing))
        view = partial(self._view, doing, keys, Taxonomy(collection.taxonomy, collection.types))
        try:
            try:
                done = collect(self._project.harness, collection, recording, journal, view, stop)
            finally:
                self._keys = None
                self._studio.publish("collecting", message("collecting", stage="over"))
            if done:
                self._write(doing, recording, collection, done)
        finally:
            self._studio.changed()

    def _write(self, doing: str, recording: Path, collection: Collection, done: int) -> None:
        """Write the set of the accepted trials.

        What was recorded for a build has its codes, on whichever page it was continued. Once it is complete, it adapts
        the build, if it is the wearer's.
        """
        build = self._project.build_of(collection.build)
        codings = None if build is None else build[1].manifest.codings
        grasp_set, report = import_recordings([recording], codings=codings)
        output, total = recording.with_suffix(".grasps"), len(self._trials)
        grasp_set.save(output)
        if doing == "recording":
            self._recorded = output
            warnings = [finding.message for finding in report.warnings]
            about = {"set": output.name, "size": str(grasp_set.size), "warnings": warnings}
            self._studio.publish("finished", message("finished", about, done=done, total=total))
        if build is not None and done == total and collection.subject == self._project.state.wearer:
            self._studio.queue("adapt", partial(self._wearer.adapt, [output]))

    def _view(
        self,
        doing: str,
        keys: SimpleQueue[Key],
        taxonomy: Taxonomy,
        guide: CollectionGuide,
        devices: Sequence[DeviceHealth],
    ) -> list[Key]:
        """Show the guide's state ten times a second and at every change; return the keys pressed."""
        now, (step, shown_us) = now_us(), self._shown
        if step != guide.step:
            if guide.stage == "review" and guide.trial is not None:
                self._captured[guide.trial.number] = guide.captured
            if guide.accepted != self._accepted:
                self._accepted = guide.accepted
                trials = [self._trials[number] for number in guide.accepted]
                shown = [(trial.number, trial.grasp, trial.object) for trial in trials]
                types = list(dict.fromkeys(trial.grasp for trial in self._trials.values()))
                accuracy = self._accuracy(guide, taxonomy)
                self._studio.publish("trials", message("trials", trials=shown, types=types, accuracy=accuracy))
        if step != guide.step or now >= shown_us + _SHOW_US:
            self._shown = guide.step, now
            prompt, thing = task(guide, taxonomy)
            content = {
                "doing": doing,
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
            self._studio.publish("collecting", message("collecting", content))
            self._studio.publish("glove", glove_message(devices))
        return [keys.get() for _ in range(keys.qsize())]

    def _accuracy(self, guide: CollectionGuide, taxonomy: Taxonomy) -> dict[str, object] | None:
        """Return the quick accuracy of all sensors in the accepted trials, if there are enough."""
        session = guide.session
        trials = [self._trials[number] for number in guide.accepted if self._trials[number].grasp != NONE]
        counts = Counter(trial.grasp for trial in trials)
        types = {trial.grasp for trial in self._trials.values()} - {NONE}
        if len(types) < 2 or any(counts[grasp] < _LEAST for grasp in types):
            return None
        frames = [self._captured[trial.number] for trial in trials]
        codes = [() if glove is None else tuple(glove.sensors) for _, glove in frames]
        taxels = [[] if switches is None else [code or 0 for code in switches.taxels or ()] for switches, _ in frames]
        closed = [0 if switches is None else switches.closed for switches, _ in frames]
        try:
            grasp_set = GraspSet(
                switches=switch_matrix(closed, len(session.switches)),
                switch_names=session.switches,
                codes=np.array(codes, np.uint16).reshape(len(trials), len(session.sensors)),
                joints=tuple(Joint(name, RAW, 1, 1.0, 255, 255.0) for name in session.sensors),
                grasps=np.array([trial.grasp for trial in trials]),
                taxonomy=taxonomy,
                subjects=np.array(["me"] * len(trials)),
                objects=np.array([trial.object for trial in trials]),
                trials=np.array([trial.number for trial in trials]),
                taxels=np.array(taxels, np.uint16).reshape(len(trials), len(session.taxels)),
                taxel_columns=tuple(Joint(name, "counts", 0, 0.0, 1, 1.0) for name in session.taxels),
            )
            quick = QuickAccuracy(grasp_set)
            found = quick.of(range(len(quick.names)))
        except ThenarError as reason:
            return {"why": str(reason)}
        return {"of": found.of, "mean": found.mean, "low": found.low, "high": found.high}

    # What is asked of a collection.

    def _press(self, asked: Asked) -> None:
        if asked.name not in KEYS:
            raise ThenarError(f"there is no key {shortened(repr(asked.name))}")
        if self._keys is None:
            raise ThenarError("nothing is recorded now")
        self._keys.put(asked.name)

    def _trial(self, asked: Asked) -> bytes:
        """Return the captured frames of a trial, as the hand shows it."""
        if asked.trial not in self._captured:
            raise ThenarError(f"trial {asked.trial} was not recorded")
        sensors = GloveSensors(self._project.wiring(), self._project.hand())
        trial, shown = self._trials[asked.trial], sensors.read(*self._captured[asked.trial])
        return message("recorded", sensors.drawn(shown), trial=trial.number, grasp=trial.grasp, thing=trial.object)

    def _relabel(self, asked: Asked) -> None:
        """Make a trial of the set that was just recorded another type; an empty name leaves it out."""
        if self._recorded is None:
            raise SettingError("nothing was recorded here yet: end the recording first, or use the page Errors")
        grasp_set = GraspSet.load(self._recorded)
        trials = {trial[5]: trial for trial in trials_of(self._recorded.name, grasp_set)}
        if asked.trial not in trials:
            raise SettingError(f"trial {asked.trial} is not in {self._recorded.name}")
        if asked.name not in ("", *grasp_set.taxonomy.types):
            raise SettingError(grasp_set.taxonomy.unknown(asked.name))
        change(self._project.edits, [trials[asked.trial]], asked.name)
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


def _captured(recording: Path) -> dict[int, Frames]:
    """Return the frames that were captured in each trial of a recording, the last time."""
    switches: SwitchFrame | None = None
    glove: GloveFrame | None = None
    found = dict[int, Frames]()
    for entry in Reader(recording):
        if isinstance(entry, SwitchFrame):
            switches = entry
        elif isinstance(entry, GloveFrame):
            glove = entry
        elif isinstance(entry, Label) and entry.event == "captured":
            found[entry.trial] = switches, glove
    return found


def _collection(journal: Journal) -> Collection:
    assert journal.session.collection is not None
    return journal.session.collection

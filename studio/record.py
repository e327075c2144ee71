"""The page *Record*: guided collections into the project, begun, continued, and imported when they end."""

import json
import secrets
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from thenar.compiler.recordings import check_names
from thenar.compiler.recordings.edits import trials_of
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.mcap_recording import import_recordings
from thenar.compiler.recordings.taxonomy import ANY, collected
from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.files import write_atomically
from thenar.runtime.published import NONE
from thenar.runtime.recording.guide import Journal, planned, read_journal
from thenar.runtime.recording.session import Collection
from thenar.runtime.web.server import message

from .collector import Collector
from .edits import change, load_edits
from .studio import Asked, Report, Studio

_MOST_REPETITIONS = 1000


class RecordPage:
    """The page *Record* of a studio; the `collector` leads what is recorded."""

    def __init__(self, studio: Studio, collector: Collector) -> None:
        self._studio, self._project, self._collector = studio, studio.project, collector
        # What is known of a recording, by its path, size and time of change: reading a long one takes a second.
        self._known = dict[tuple[Path, int, int], tuple[str, int, int] | None]()
        self._recorded: Path | None = None
        requests = {"record": self._begin, "continue": self._continue, "relabel": self._relabel}
        studio.add("record.html", "Record", requests | collector.requests, self.read)

    def read(self, report: Report) -> None:
        """Show which recordings can be continued, and what can be recorded."""
        found = []
        for member in self._project.members("recording"):
            about = self._about(self._project.folder / member.name)
            if about is not None and about[1] < about[2]:
                found.append(
                    {"id": member.id, "name": member.name, "subject": about[0], "done": about[1], "total": about[2]}
                )
        objects, name = self._objects, "" if self._recorded is None else self._recorded.name
        latest = {edit.of: edit.new for edit in load_edits(self._project.edits)[0] if edit.of[0] == name}
        edits = {trial[5]: new for trial, new in latest.items() if new != trial[3]}
        self._studio.publish("relabelled", message("relabelled", set=name, trials=edits))
        self._studio.publish(
            "recordings",
            message(
                "recordings",
                unfinished=found,
                taxonomies=["kamakura14", "cutkosky16", "feix33", "own"],
                objects=objects is not None,
                glove=self._project.harness.exists(),
            ),
        )

    @property
    def _objects(self) -> Path | None:
        path = self._project.folder / "objects.toml"
        return path if path.exists() else None

    def _about(self, path: Path) -> tuple[str, int, int] | None:
        """Return the subject of a recording, and how many of how many trials are done; None if it is no collection."""
        state = path.stat()
        key = path, state.st_size, state.st_mtime_ns
        if key not in self._known:
            try:
                journal = read_journal(path)
                collection = _collection(journal)
                self._known[key] = collection.subject, len(journal.accepted), len(planned(collection))
            except (ThenarError, OSError):
                self._known[key] = None
        return self._known[key]

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
        self._check_glove()
        if asked.id == "own" and self._objects is None:
            self._write_types(asked.names)
        types, tasks = collected(asked.id, self._objects, bool(asked.trial))
        if unknown := [name for name in asked.ids if name not in types.types]:
            raise SettingError(types.unknown(unknown[0]))
        tasks = tuple(task for task in tasks if not asked.ids or task.grasp in (*asked.ids, NONE))
        collection = Collection(asked.name, types.name, types.types, tasks, int(repetitions), secrets.randbits(32))
        planned(collection)
        recording = self._project.new_path(asked.name, ".mcap", ".grasps")
        if asked.name != self._project.state.wearer:
            self._project.remember(wearer=asked.name)
            self._studio.changed()
        self._start(recording, collection, None)

    def _write_types(self, names: Sequence[str]) -> None:
        """Write the wearer's own types to objects.toml, each with any object."""
        check_names("grasp type", names)
        if len(names) < 2:
            raise SettingError("name two grasp types at least, with commas between them: fist, pinch, point")
        lines = "".join(f"{json.dumps(name, ensure_ascii=False)} = [{json.dumps(ANY)}]\n" for name in names)
        write_atomically(self._project.folder / "objects.toml", lines.encode())

    def _continue(self, asked: Asked) -> None:
        path = self._project.path("recording", asked.id)
        self._check_glove()
        journal = read_journal(path)
        self._start(path, _collection(journal), journal)

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

    def _check_glove(self) -> None:
        if not self._project.harness.exists():
            raise SettingError("the project has no glove.toml: connect a glove on the page Glove first")
        self._project.wiring()

    def _start(self, recording: Path, collection: Collection, journal: Journal | None) -> None:
        self._recorded = None
        self._studio.publish("finished", message("finished", set=""))
        write = partial(self._write, recording, len(planned(collection)))
        self._collector.start("recording", collection, recording, journal, write)

    def _write(self, recording: Path, total: int, done: int) -> None:
        """Write the set of all accepted trials, and show the warnings of its import."""
        if done:
            output = recording.with_suffix(".grasps")
            grasp_set, report = import_recordings([recording])
            grasp_set.save(output)
            self._recorded = output
            warnings = [finding.message for finding in report.warnings]
            about = {
                "set": output.name,
                "size": str(grasp_set.size),
                "warnings": warnings,
                "done": done,
                "total": total,
            }
            self._studio.publish("finished", message("finished", about))
        self._studio.changed()


def _collection(journal: Journal) -> Collection:
    assert journal.session.collection is not None
    return journal.session.collection

"""The page *Wearer*: a few trials of a person change the build in use to suit that person, and this can be undone."""

import secrets
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from shlex import join, quote

import numpy as np

from thenar.compiler.artifact.adapting import AdaptedBuild, adapt
from thenar.compiler.artifact.training import trained_on
from thenar.compiler.evaluation.rates import Rate, interval
from thenar.compiler.recordings import check_names
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.mcap_recording import import_recordings
from thenar.compiler.recordings.taxonomy import tasks_of
from thenar.compiler.samples import select_inputs
from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.build import Build, load_manifest
from thenar.runtime.glove import Glove
from thenar.runtime.names import list_names
from thenar.runtime.published import NONE
from thenar.runtime.recording.guide import Journal, planned, read_journal
from thenar.runtime.recording.session import Collection
from thenar.runtime.web.server import message

from .collector import Collector
from .studio import Asked, Handler, Report, Studio

# Trials of each type; of each, if there is a new one.
_OFTEN, _TAUGHT = 2, 3


class WearerPage:
    """The page *Wearer* of a studio; the `collector` leads what is recorded."""

    def __init__(self, studio: Studio, collector: Collector) -> None:
        self._studio, self._project, self._collector = studio, studio.project, collector
        requests: dict[str, Handler] = {
            "wearer": self._name,
            "wear": self._record,
            "chosen": self._chosen,
            "adapt": self._later,
            "unwear": self._undo,
        }
        studio.add("wearer.html", "Wearer", requests, self.read)

    def read(self, report: Report) -> None:
        """Show the build of everybody, and which sets hold trials of the wearer for it."""
        state = self._project.state
        about: dict[str, object] = {"wearer": state.wearer}
        try:
            base, build = self._base()
        except ThenarError as reason:
            self._studio.publish("wearing", message("wearing", about, why=str(reason), sets=()))
            return
        members = self._project.members("set")
        sets = []
        for number, member in enumerate(members):
            report(number, len(members))
            grasp_set = GraspSet.load(self._project.folder / member.name)
            if self._fits(grasp_set, build):
                sets.append({"id": member.id, "name": member.name, "size": str(grasp_set.size)})
        types = [grasp for grasp in build.grasps if grasp != NONE]
        record = ["thenar", "record", "--glove", str(self._project.harness), "--for", str(base)]
        record += ["--subject", state.wearer, "-o", str(self._project.new_path(state.wearer, ".grasps", ".mcap"))]
        about |= {"base": base.name, "types": types, "sets": sets, "glove": self._project.harness.exists()}
        about |= {"build": state.build, "undo": self._former, "record": join(record)}
        self._studio.publish("wearing", message("wearing", about, why=""))

    def _base(self) -> tuple[Path, Build]:
        """Return the build of everybody: the one in use, or that which was adapted to become it. Raises ThenarError."""
        found = self._project.build()
        if found is None:
            raise SettingError("the project has no build in use: train one on the page Choose")
        path, build = found
        if build.manifest.adapted is None:
            return path, build
        for member in self._project.members("build"):
            place = self._project.folder / member.name
            if load_manifest(place).checksum == build.manifest.adapted.build:
                return place, Build.load(place)
        raise SettingError(f"{path.name} was adapted, and the project no longer has the build that it was made of")

    @property
    def _former(self) -> str:
        """The name of the build that was in use before it was adapted; "" if that is gone, or none was adapted."""
        state, found = self._project.state, self._project.build()
        there = {member.name for member in self._project.members("build")}
        adapted = found is not None and found[1].manifest.adapted is not None
        return state.former if adapted and state.former in there else ""

    def _fits(self, grasp_set: GraspSet, build: Build) -> bool:
        """Return whether all trials of a set are the wearer's, and it has the build's inputs."""
        if not np.all(grasp_set.subjects == self._project.state.wearer):
            return False
        try:
            select_inputs(grasp_set, build.manifest)
        except ThenarError:
            return False
        return True

    def _name(self, asked: Asked) -> None:
        check_names("subject", [asked.name])
        self._project.new_path(asked.name)
        self._project.remember(wearer=asked.name)
        self._studio.changed()

    # Trials.

    def _record(self, asked: Asked) -> None:
        """Begin to record two trials of each type of the build, or three if `name` is a type to add; or go on."""
        if not self._project.harness.exists():
            raise SettingError("the project has no glove.toml: connect a glove on the page Glove first")
        wearer, (_, build) = self._project.state.wearer, self._base()
        if lacking := Glove(build, self._project.wiring()).system.unread:
            raise SettingError(lacking)
        types, tasks = tasks_of(build.manifest, [asked.name] if asked.name else [])
        often = _TAUGHT if asked.name else _OFTEN
        collection = Collection(wearer, types.name, types.types, tasks, often, secrets.randbits(32))
        recording, journal = self._project.new_path(wearer, ".mcap", ".grasps"), None
        for member in self._project.members("recording"):
            begun = _journal(self._project.folder / member.name)
            if begun is not None and begun.session.collection is not None:
                other = begun.session.collection
                same = (other.subject, other.tasks, other.repetitions) == (wearer, tasks, often)
                if same and len(begun.accepted) < len(planned(other)):
                    recording, journal, collection = begun.path, begun, other
        write = partial(self._write, recording, build, len(planned(collection)))
        self._collector.start("wearer", collection, recording, journal, write)

    def _write(self, recording: Path, build: Build, total: int, done: int) -> None:
        """Write the set of the accepted trials, and adapt to it once they are complete."""
        if done:
            grasp_set, _ = import_recordings([recording], codings=build.manifest.codings)
            output = recording.with_suffix(".grasps")
            grasp_set.save(output)
            if done == total:
                self._studio.queue("adapt", partial(self._adapt, [output]))
        self._studio.changed()

    def _sets(self, asked: Asked) -> list[Path]:
        if not asked.ids:
            raise SettingError("choose recordings of the wearer, or record some")
        return [self._project.path("set", member) for member in asked.ids]

    def _trials(self, paths: Sequence[Path], build: Build) -> tuple[GraspSet, list[str]]:
        """Return the trials in sets, and their types that the build does not know. Raises SettingError unless they are
        the wearer's.
        """
        for path in paths:
            if not self._fits(GraspSet.load(path), build):
                raise SettingError(f"{path.name} is no recording of {self._project.state.wearer} for this build")
        whole = self._project.recordings(paths)[0]
        return whole, sorted({*whole.grasps.tolist()} - {*build.grasps, NONE})

    def _chosen(self, asked: Asked) -> bytes:
        """Return the numbers of trials in chosen sets, by type, and the command that adapts to them."""
        paths, (base, build) = self._sets(asked), self._base()
        trials, added = self._trials(paths, build)
        counts = Counter(trials.grasps[np.unique(trials.trial_ids, return_index=True)[1]].tolist())
        known = int(np.count_nonzero(trained_on(build.manifest, trials)))
        notes = [f"new types are added: {list_names(added)}"] if added else []
        notes += [f"{known} of these trials are of the build's training: before is too good"] if known else []
        first, recordings = self._project.joined(paths)
        more = "".join(f" --add-type {quote(name)}" for name in added)
        output = quote(str(self._project.new_path(self._project.state.wearer)))
        command = f"{first}thenar adapt {quote(str(base))} {recordings}{more} -o {output}"
        return message("chosen", ids=asked.ids, counts=counts, notes=notes, command=command)

    # The build.

    def _later(self, asked: Asked) -> None:
        paths = self._sets(asked)
        self._base()
        self._studio.queue("adapt", partial(self._adapt, paths))

    def _adapt(self, paths: Sequence[Path], _: Report) -> None:
        """Adapt the build of everybody to trials, put the result into use, and tell all pages what it is worth."""
        base, build = self._base()
        trials, added = self._trials(paths, build)
        output = self._project.new_path(self._project.state.wearer)
        made = adapt(base, trials, output=output, add_type=added)
        self._project.remember(build=output.name, former=self._project.state.build)
        self._studio.publish("adapted", message("adapted", _result(made)))
        self._studio.changed()

    def _undo(self, asked: Asked) -> None:
        if not self._former:
            raise SettingError("there is nothing to undo: the build in use was not adapted here")
        self._project.remember(build=self._former, former="")
        self._studio.changed()


def _result(made: AdaptedBuild) -> dict[str, object]:
    """Return how many of the trials are recognised before and after, by type from the worst on."""
    total = made.manifest.rates[0].total
    rates = [Rate.counted((right,), total, of="within subject") for right in (made.before, made.after)]
    types = zip(made.manifest.grasps, made.by_type, strict=True)
    tried = [(name, *counts) for name, counts in types if counts[0]]
    return {
        "folder": made.folder.name,
        "total": total,
        "before": f"{made.before} of {total}: {interval(rates[0])} %",
        "after": f"{made.after} of {total}: {interval(rates[1])} %",
        "types": sorted(tried, key=lambda one: one[3] / one[1]),
        "warnings": made.warnings,
    }


def _journal(path: Path) -> Journal | None:
    try:
        return read_journal(path)
    except (ThenarError, OSError):
        return None

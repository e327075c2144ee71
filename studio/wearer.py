"""The page *Wearer*: a few trials of a person change the build in use to suit that person, and this can be undone.

They are recorded on the page *Record*.
"""

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np

from thenar.compiler.artifact.adapting import AdaptedBuild, adapt
from thenar.compiler.artifact.training import trained_on
from thenar.compiler.evaluation.rates import Rate, interval
from thenar.compiler.recordings import check_names
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import select_inputs
from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.build import Build
from thenar.runtime.names import list_names
from thenar.runtime.published import NONE

from .studio import Asked, Handler, Report, Studio


class WearerPage:
    """The page *Wearer* of a studio."""

    def __init__(self, studio: Studio) -> None:
        self._studio, self._project = studio, studio.project
        requests: dict[str, Handler] = {
            "wearer": self._name,
            "adapt": lambda _: partial(self.adapt, self._project.state.wearer),
        }
        studio.add(requests, self.read)

    def read(self, report: Report) -> None:
        """Show the build of everybody, and the trials of the wearer for it."""
        state, about = self._project.state, dict[str, object]()
        wearer = state.wearer
        try:
            base, build = self.base()
        except ThenarError as reason:
            self._studio.publish("wearing", wearer=wearer, why=str(reason), sets=())
            return
        sets = self._sets(wearer, build, report)
        if sets:
            # A damaged log of edits hinders neither recording nor undo.
            try:
                about |= self._trials_shown([*sets], base, build)
            except ThenarError as reason:
                about["notes"] = [str(reason)]
        types = [grasp for grasp in build.grasps if grasp != NONE]
        record = ["record", "--glove", self._project.harness, "--for", base, "--subject", wearer]
        record += ["-o", self._project.new_path(wearer, ".grasps", ".mcap")]
        shown = [f"{path.name}: {size}" for path, size in sets.items()]
        ids = {path.name: member for member, path in self._project.members("build").items()}
        about |= {"base": base.name, "types": types, "sets": shown, "glove": self._project.harness.exists()}
        about |= {"id": ids.get(base.name, ""), "build": state.build, "record": self._project.command(record)}
        self._studio.publish("wearing", about, wearer=wearer, why="")

    def base(self) -> tuple[Path, Build]:
        """Return the build of everybody: the one in use, or that which was adapted to become it. Raises ThenarError."""
        path, build = self._project.build()
        if build.manifest.adapted is None:
            return path, build
        base = self._project.build_of(build.manifest.adapted.build)
        if base is None:
            raise SettingError(f"{path.name} was adapted, and the project no longer has the build that it was made of")
        return base

    def _sets(self, wearer: str, build: Build, report: Report) -> dict[Path, str]:
        """Return the sets of which all trials are a wearer's, and which have the build's inputs; and their sizes."""
        sets, members = dict[Path, str](), self._project.members("set")
        for number, path in enumerate(members.values()):
            report(number, len(members))
            with suppress(ThenarError, OSError):
                grasp_set = GraspSet.load(path)
                select_inputs(grasp_set, build.manifest)
                if np.all(grasp_set.subjects == wearer):
                    sets[path] = str(grasp_set.size)
        return sets

    def _name(self, asked: Asked) -> None:
        check_names("subject", [asked.name])
        self._project.new_path(asked.name)
        self._project.remember(wearer=asked.name)
        self._studio.changed()

    def _trials_shown(self, paths: Sequence[Path], base: Path, build: Build) -> dict[str, object]:
        """Return the numbers of the trials in sets, by type, what is not used, and the command that adapts to them."""
        trials, rows, notes = self._project.recordings(paths)
        added, used = _added(trials, build), {trial[0] for trial in rows}
        sets = [path for path in paths if path.name in used]
        counts = Counter(trials.grasps[np.unique(trials.trial_ids, return_index=True)[1]].tolist())
        known = int(np.count_nonzero(trained_on(build.manifest, trials)))
        notes += [f"new types are added: {list_names(added)}"] if added else []
        notes += [f"{known} of these trials are of the build's training: before is too good"] if known else []
        more = [word for name in added for word in ("--add-type", name)]
        more += ["-o", str(self._project.new_path(self._project.state.wearer))]
        return {"counts": counts, "notes": notes, "adapt": self._project.command(["adapt", base], sets, more)}

    # The build.

    def adapt(self, wearer: str, report: Report) -> dict[str, object]:
        """Adapt the build of everybody to a wearer's trials, put the result into use, and return its accuracy."""
        base, build = self.base()
        if wearer != (now := self._project.state.wearer):
            raise SettingError(f"the wearer is now {now}, so the build was not adapted to {wearer}")
        # Reading says nothing of how long the adaptation takes.
        paths = [*self._sets(wearer, build, lambda *_: report(0, 1))]
        if not paths:
            raise SettingError(f"no set holds only trials of {wearer}: record some")
        trials, output = self._project.recordings(paths)[0], self._project.new_path(wearer)
        made = adapt(base, trials, output=output, add_type=_added(trials, build))
        self._project.remember(build=output.name)
        self._studio.changed()
        return _result(made)


def _added(trials: GraspSet, build: Build) -> list[str]:
    """Return the types of trials that a build does not know."""
    return sorted({*trials.grasps.tolist()} - {*build.grasps, NONE})


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

"""The page *Errors*: which trials are misread, by chosen sensors or by a build, and edits of trials.

A page names trials by their numbers; an edit also says which numbering they are of, so that none is for another trial.
"""

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.artifact.training import trained_on
from thenar.compiler.evaluation.rates import Rate
from thenar.compiler.recogniser import predicted_classes
from thenar.compiler.samples import decided, select_inputs
from thenar.drivers.errors import ThenarError
from thenar.runtime.build import Build
from thenar.runtime.model.terms.bit import Bit
from thenar.runtime.names import shortened
from thenar.runtime.web.server import message

from .choose import ChoosePage
from .edits import change, undo
from .quick import Quick, QuickAccuracy, strongest
from .sensors import sensors_read
from .studio import Asked, Handler, Report, Studio

# The most trials that a page is sent at a time.
_MOST_SHOWN = 48


class BuildReading:
    """How a build recognises the trials of recordings.

    Parameters
    ----------
    name : str
        The name of its folder.
    build : Build
        The build.
    quick : QuickAccuracy
        The recordings.

    Attributes
    ----------
    types : list of str
        The types of the recordings, and then those that only the build has.
    found : Quick
        The accuracy, and the number in `types` of what each trial is recognised as.
    sensors : tuple of int
        The numbers of the sensors that the build reads.

    Raises
    ------
    CompileError
        If the recordings lack inputs of the build.
    """

    def __init__(self, name: str, build: Build, quick: QuickAccuracy) -> None:
        self._build, self._quick = build, quick
        self._bits, self._codes = select_inputs(quick.held, build.manifest)
        self.types = list(dict.fromkeys((*quick.grasps, *build.classes)))
        numbers = np.array([self.types.index(one) for one in build.classes])
        rows = predicted_classes(build.tables, build.manifest.rejection, self._bits, self._codes)
        read = decided(numbers[rows][np.newaxis], quick.trial)[0]
        people = np.unique(quick.held.subjects, return_inverse=True)[1]
        rate = Rate.predicted(numbers[rows], quick.truth[quick.trial], quick.trial, of="pooled", groups=people)
        known = int(np.count_nonzero(trained_on(build.manifest, quick.held)))
        of = f"{known} of these {len(quick.truth)} trials trained it" if known else "none of these trials trained it"
        self.sensors = tuple(sorted(quick.names.index(name) for name in sensors_read(build.manifest)))
        self._usual = dict[int, NDArray[np.float64]]()
        self.found = Quick(f"build {name}; {of}", rate.mean, rate.low, rate.high, tuple(read.tolist()))

    def decisive(self, trial: int) -> list[int]:
        """Return the sensors that decided for the wrong type of a misread trial, the strongest first; at most 3.

        Their terms add more to the recognised type than to the true one, compared with other trials of the true type.
        """
        truth, read, known = int(self._quick.truth[trial]), self.found.read[trial], self._build.grasps
        # A refused frame has no type, and a build may not know a type.
        if truth == read or not {self.types[truth], self.types[read]} <= {*known}:
            return []
        if truth not in self._usual:
            self._usual[truth] = self._sums(np.flatnonzero(self._quick.truth[self._quick.trial] == truth))
        places = [known.index(self.types[one]) for one in (read, truth)]
        more = self._sums(self._quick.rows_of(trial)) - self._usual[truth]
        return strongest(more[:, places[0]] - more[:, places[1]])

    def _sums(self, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return how much each sensor adds to each type (d, K) on average of these rows."""
        tables, manifest = self._build.tables, self._build.manifest
        sums = np.zeros((len(self._quick.names), tables.n_classes))
        switches, joints = [one.source for one in manifest.switches], [joint.name for joint in manifest.joints]
        for term in tables.terms:
            names = switches if isinstance(term, Bit) else joints
            values = tables.values(term, self._bits[rows], self._codes[rows])
            for number in term.inputs:
                sums[self._quick.names.index(names[number])] += term.of(*values).mean(axis=0) / len(term.inputs)
        return sums


class ErrorsPage:
    """The page *Errors* of a studio, which shows what `choose` has read."""

    def __init__(self, studio: Studio, choose: ChoosePage) -> None:
        self._studio, self._project, self._choose = studio, studio.project, choose
        # By the builds' ids and the numbering of the recordings.
        self._readings = dict[tuple[str, str], BuildReading]()
        requests: dict[str, Handler] = {"errors": self._errors, "trials": self._trials}
        studio.add(requests | dict.fromkeys(("edit", "undo"), self._edit), self.read)

    def read(self, report: Report) -> None:
        """Forget the earlier readings of builds, and read the build in use, so that no page waits for it."""
        self._readings = {}
        for member, path in self._project.members("build").items():
            if path.name == self._project.state.build:
                with suppress(ThenarError, OSError):
                    self._reading(member)

    def _errors(self, asked: Asked) -> bytes:
        """Return as which type the sensors, or the build with an id, recognise every trial."""
        now, quick = self._choose.recordings, self._choose.recordings.quick
        if asked.id:
            reading = self._reading(asked.id)
            found, types, sensors = reading.found, reading.types, reading.sensors
        else:
            found, types, sensors = quick.of(asked.sensors), [*quick.grasps], asked.sensors
        return message(
            "errors",
            found,
            types=types,
            truth=quick.truth.tolist(),
            places=quick.places(sensors).tolist(),
            sensors=sensors,
            numbering=now.numbering,
            asked=(asked.id, asked.sensors),
        )

    def _trials(self, asked: Asked) -> bytes:
        """Return the values of sensors in trials, and which decided where one was misread."""
        quick, shown = self._choose.recordings.quick, list[dict[str, object]]()
        for trial in asked.trials[:_MOST_SHOWN]:
            decisive = self._reading(asked.id).decisive(trial) if asked.id else quick.decisive(trial, asked.sensors)
            shown.append({"trial": trial, "shown": quick.seen(trial).tolist(), "decisive": decisive})
        return message("trials", trials=shown, asked=asked.trials)

    def _reading(self, build: str) -> BuildReading:
        """Return how a build recognises the recordings. Raises ThenarError if there is no such build, or it cannot."""
        now, readings, path = self._choose.recordings, self._readings, self._project.path("build", build)
        key = build, now.numbering
        if key not in readings:
            readings[key] = BuildReading(path.name, Build.load(path), now.quick)
        return readings[key]

    def _edit(self, asked: Asked) -> None:
        """Make trials another type, leave them out if it is empty, or take the last action back; then read again.

        Raises ThenarError for a numbering of earlier recordings, and for another trial or type.
        """
        log = self._project.edits
        if asked.do == "undo":
            undo(log)
        else:
            now = self._choose.recordings
            if asked.id != now.numbering:
                raise ThenarError("the recordings have changed: look at these trials again")
            if not all(0 <= trial < len(now.trials) for trial in asked.trials):
                raise ThenarError(f"there are {len(now.trials)} trials, numbered from 0")
            if asked.name not in ("", *now.quick.held.taxonomy.types):
                raise ThenarError(f"{shortened(repr(asked.name))} is not a grasp type of these recordings")
            change(log, [now.trials[trial] for trial in asked.trials], asked.name)
        self._studio.changed()

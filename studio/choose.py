"""The page *Choose*: click sensors on and off, and see what they recognise.

Every browser has its own choice, so a page sends it whole and gets its own reply. A measurement with
nested folds and the curve of what sensors are worth take longer. They are queued, and sent to all pages.
"""

import hashlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import msgspec
import numpy as np

from thenar.compiler.artifact.compile import compile_build
from thenar.compiler.artifact.documents import Documents
from thenar.compiler.artifact.sensor_study import study_sensors
from thenar.compiler.glove.prices import Part
from thenar.compiler.hand import HandShape, moved_by
from thenar.compiler.placement.constraints import Limits
from thenar.compiler.recordings.edits import TrialId
from thenar.compiler.recordings.graspset import GraspSet
from thenar.drivers.errors import ThenarError
from thenar.runtime.hand import DrawnJoint, DrawnSwitch, HandDrawing
from thenar.runtime.recipe import Recipe
from thenar.runtime.web.server import message

from .quick import Quick, QuickAccuracy
from .sensors import placed, scan_time_us
from .studio import Asked, Handler, Job, Report, Studio

_BUILD = "build"


@dataclass(frozen=True, slots=True, eq=False)
class Recordings:
    """The sets in use as one, and what follows from them. It is replaced as a whole: no request sees a part of it.

    quick      the accuracy of any sensors
    trials     the trials as they were recorded, by their numbers on pages
    numbering  what pages call this numbering
    hand       the glove laid flat, if it has the positions of the sensors
    parts      the part for each sensor, by its name; empty without a price list
    """

    grasp_set: GraspSet
    quick: QuickAccuracy
    trials: list[TrialId]
    numbering: str
    hand: HandShape | None
    parts: dict[str, Part]

    @property
    def files(self) -> list[str]:
        """The names of the sets."""
        return list(dict.fromkeys(file for file, *_ in self.trials))

    @property
    def prices(self) -> dict[str, float]:
        """The price of each sensor, by its name; empty without a price list."""
        return {name: part.price for name, part in self.parts.items()}

    def names(self, sensors: Sequence[int]) -> tuple[str, ...]:
        """Return the names of sensors, each once, in this order. Raises EvaluationError if there is no such number."""
        self.quick.check(sensors)
        return tuple(dict.fromkeys(self.quick.names[sensor] for sensor in sensors))


class ChoosePage:
    """The page *Choose* of a studio."""

    def __init__(self, studio: Studio) -> None:
        self._studio, self._project = studio, studio.project
        self._recordings: Recordings | None = None
        requests: dict[str, Handler] = {
            "choose": lambda asked: self._reply(asked.sensors),
            "use": self._use,
            **dict.fromkeys(("measure", "curve", "train"), self._job),
        }
        studio.add(requests, self.read)

    def read(self, report: Report) -> None:
        """Read the project's recordings, and show them; until then pages get those before."""
        try:
            grasp_set, rows, unused = self._project.recordings()
            hand = self._project.hand().fitted(grasp_set.element_names)
            parts = self._project.parts((*grasp_set.element_names, *grasp_set.joint_names))
            quick = QuickAccuracy(grasp_set)
        except ThenarError as reason:
            self._recordings = None
            self._studio.publish("set", why=str(reason), sensors=(), trials=(), name="")
            return
        of_rows = [trial for trial, none in zip(rows, grasp_set.is_none.tolist(), strict=True) if not none]
        ids = [of_rows[row] for row in np.unique(quick.trial, return_index=True)[1].tolist()]
        numbering = hashlib.sha256(msgspec.json.encode((ids, grasp_set.fingerprint()))).hexdigest()[:12]
        now = Recordings(grasp_set, quick, ids, numbering, hand, parts)
        self._recordings = now
        kinds = ["switch"] * len(grasp_set.switch_names) + ["pad"] * len(grasp_set.taxel_columns)
        kinds += ["joint"] * len(grasp_set.joints)
        about = {
            "why": "",
            "name": ", ".join(now.files),
            "unused": unused,
            "types": quick.held.taxonomy.types,
            "taxonomy": grasp_set.taxonomy.name,
            "hand": drawn(grasp_set, hand),
            "joints": _joints(quick.held),
            "trials": _names(ids),
            "typical": {kind: shares.tolist() for kind, shares in zip(quick.grasps, quick.typical, strict=True)},
            "numbering": numbering,
            "sensors": [
                {"name": name, "kind": kind, "price": now.prices.get(name)}
                for name, kind in zip(quick.names, kinds, strict=True)
            ],
        }
        self._studio.publish("set", about)

    @property
    def recordings(self) -> Recordings:
        """The recordings as they were last read. Raises ThenarError before that, and if they cannot be read."""
        if self._recordings is None:
            raise ThenarError("the recordings are not read yet")
        return self._recordings

    def _use(self, asked: Asked) -> None:
        """Use a set, or leave it aside. Raises SettingError if there is no such set."""
        name, aside = self._project.path("set", asked.id).name, {*self._project.state.aside}
        self._project.remember(aside=tuple(sorted(aside - {name} if asked.value else aside | {name})))
        self._studio.changed()

    def _job(self, asked: Asked) -> Job:
        if asked.do != "curve" and not asked.sensors:
            raise ThenarError("choose a sensor first: without any, nothing can be learnt")
        names = self.recordings.names(asked.sensors)
        return partial(self._measure, asked, names)

    def _reply(self, sensors: Sequence[int]) -> bytes:
        now = self.recordings
        names, found = now.names(sensors), now.quick.of(sensors)
        pads = [f"{name}>1" for name in now.grasp_set.taxel_names if name in names]  # read alike at any level
        return message(
            "quick",
            found,
            sensors=sensors,
            weakest=_weakest(now.quick, found),
            scan_us=scan_time_us([name for name in names if name in now.grasp_set.switch_names] + pads),
            price=sum(now.prices[name] for name in names) if now.parts else None,
            commands=self._commands(now.files, names),
        )

    def _commands(self, files: Sequence[str], names: Sequence[str]) -> dict[str, str]:
        """Return the commands that do what the buttons do, by their requests, from these sets."""
        command, sets = self._project.command, [self._project.folder / name for name in files]
        options = self._project.options()
        commands = {"curve": command(["place"], sets, options)}
        if names:
            these = [*options, "--sensors", len(names), "--have", ",".join(names)]
            output = ["-o", self._project.new_path(_BUILD), *these]
            commands |= {"measure": command(["place"], sets, these), "train": command(["compile"], sets, output)}
        return commands

    def _measure(self, asked: Asked, names: tuple[str, ...], report: Report) -> dict[str, object]:
        """Measure the curve, or the accuracy of chosen sensors, or train a build of these.

        Raises ThenarError if their numbers mean other sensors by now.
        """
        now = self.recordings
        if now.names(asked.sensors) != names:
            raise ThenarError("the recordings have other sensors now: choose again")
        recipe = Recipe() if asked.do == "curve" else Recipe(sensors=len(names), have=names)
        jobs = self._studio.jobs
        if asked.do == "train":
            output = self._project.new_path(_BUILD)
            documents = Documents(now.hand, parts=now.parts)
            built = compile_build(now.grasp_set, output, recipe, documents=documents, progress=report, jobs=jobs)
            content: dict[str, object] = {"folder": output.name, "facts": [str(fact) for fact in built.facts]}
            self._project.remember(build=output.name)
            self._studio.changed()
        else:
            limits = Limits.of(recipe, now.grasp_set, {}, prices=now.prices)
            study = study_sensors(now.grasp_set, recipe, limits=limits, jobs=jobs, report=report)
            content = {**msgspec.to_builtins(study), "recipe": str(study.recipe)}
        return content | {"sensors": asked.sensors, "numbering": now.numbering}


def _weakest(quick: QuickAccuracy, found: Quick) -> str:
    """Return the two types of which one is recognised as the other most often, in words."""
    pairs = Counter(pair for pair in zip(quick.truth.tolist(), found.read, strict=True) if pair[0] != pair[1])
    if not pairs:
        return "none"
    truth, read = worst = max(sorted(pairs), key=lambda pair: pairs[pair])
    total = np.count_nonzero(quick.truth == truth)
    return f"{quick.grasps[truth]} recognised as {quick.grasps[read]}: {pairs[worst]} of {total} trials"


def _joints(held: GraspSet) -> list[DrawnJoint]:
    """Return the joints as they are drawn, with their values at their least and their greatest code."""
    drawn_ones = []
    for number, joint in enumerate(held.joints):
        codes = held.codes[:, number]
        low, high = joint.value([codes.min(), codes.max()]).tolist()
        drawn_ones.append(DrawnJoint(joint.name, number, joint.unit, low, high, *moved_by(joint.name)))
    return drawn_ones


def _names(trials: Sequence[TrialId]) -> list[str]:
    """Return short names of trials: "trial 7 of Ana, cup", with the session if there are several."""
    several = len({session for _, _, session, _, _, _ in trials}) > 1
    return [
        f"trial {number} of {subject}, {thing}" + (f", session {session}" if several else "")
        for _, subject, session, _, thing, number in trials
    ]


def drawn(grasp_set: GraspSet, hand: HandShape | None) -> HandDrawing:
    """Return a drawing in which every switch and pad of a set is one to click on: its number is the sensor's."""
    places, fields = placed(grasp_set.element_names, hand)
    switches = tuple(DrawnSwitch(name, x, y, number) for number, (name, (x, y)) in enumerate(places.items()))
    return HandDrawing(**fields, switches=switches, taxels=(), joints=())

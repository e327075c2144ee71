"""`Collector`: collections that are led on a page.

The page shows the topics "collecting", the state of the guide, and "trials", what was accepted so far; it sends the
requests "key", and "recorded" to see a trial.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from threading import Event

import numpy as np

from thenar.compiler.recordings.graspset import GraspSet, Joint
from thenar.compiler.recordings.taxonomy import Taxonomy
from thenar.drivers.errors import ThenarError
from thenar.runtime.calibration import RAW
from thenar.runtime.frames import GloveFrame, SwitchFrame, now_us
from thenar.runtime.names import shortened
from thenar.runtime.published import NONE, DeviceHealth
from thenar.runtime.recording.guide import KEYS, CollectionGuide, Journal, Key, planned
from thenar.runtime.recording.reader import Reader
from thenar.runtime.recording.session import Collection, Label
from thenar.runtime.web.server import message

from .collecting import collect, standing, task
from .quick import QuickAccuracy
from .sensors import GloveSensors
from .studio import Asked, Handler, Studio, glove_message

_SHOW_US = 100_000
# From this number of trials of every type on there is an accuracy.
_LEAST = 2
Frames = tuple[SwitchFrame | None, GloveFrame | None]


class Collector:
    """Leads the collections of a studio, one at a time, on its `Station`.

    Parameters
    ----------
    studio : Studio
        The studio.

    Attributes
    ----------
    requests : dict
        What pages may ask for.
    """

    def __init__(self, studio: Studio) -> None:
        self._studio = studio
        self._keys: SimpleQueue[Key] | None = None
        self._captured = dict[int, Frames]()
        self._shown = -1, 0
        self._accepted: Sequence[int] | None = None
        self.requests: dict[str, Handler] = {"key": self._press, "recorded": self._recorded}
        self._ended()

    def start(
        self,
        doing: str,
        collection: Collection,
        recording: Path,
        journal: Journal | None,
        write: Callable[[int], None],
        countdown_s: float = 3.0,
    ) -> None:
        """Begin or continue a collection with the project's glove, as `collect` does; `doing` is what the bar says.

        However it ends, `write` is then called with the number of accepted trials, on the thread of the collection.
        """
        self._studio.station.start(
            doing, partial(self._lead, doing, collection, recording, journal, write, countdown_s)
        )

    def _lead(
        self,
        doing: str,
        collection: Collection,
        recording: Path,
        journal: Journal | None,
        write: Callable[[int], None],
        countdown_s: float,
        stop: Event,
    ) -> None:
        self._keys = keys = SimpleQueue[Key]()
        self._shown, self._accepted = (-1, 0), None
        self._captured = {} if journal is None else _captured(recording)
        self._by_number = {trial.number: trial for trial in planned(collection)}
        self._studio.publish("collecting", message("collecting", stage="waiting", doing=doing))
        view = partial(self._view, doing, keys, Taxonomy(collection.taxonomy, collection.types))
        try:
            done = collect(self._studio.project.harness, collection, recording, journal, view, stop, countdown_s)
        finally:
            self._ended()
        write(done)

    def _ended(self) -> None:
        self._keys = None
        self._studio.publish("collecting", message("collecting", stage="over"))

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
                self._studio.publish("trials", self._trials(guide))
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

    def _trials(self, guide: CollectionGuide) -> bytes:
        """Return the message on the accepted trials, with the accuracy of all sensors if there are enough."""
        trials = [self._by_number[number] for number in guide.accepted]
        return message(
            "trials",
            trials=[(trial.number, trial.grasp, trial.object) for trial in trials],
            types=list(dict.fromkeys(trial.grasp for trial in self._by_number.values())),
            accuracy=self._accuracy(guide),
        )

    def _accuracy(self, guide: CollectionGuide) -> dict[str, object] | None:
        session = guide.session
        collection = session.collection
        assert collection is not None
        trials = [self._by_number[number] for number in guide.accepted if self._by_number[number].grasp != NONE]
        counts = Counter(trial.grasp for trial in trials)
        types = {task.grasp for task in collection.tasks} - {NONE}
        if len(types) < 2 or any(counts[grasp] < _LEAST for grasp in types):
            return None
        frames = [self._captured[trial.number] for trial in trials]
        joints = tuple(Joint(name, RAW, 1, 1.0, 255, 255.0) for name in session.sensors)
        pads = tuple(Joint(name, "counts", 0, 0.0, 1, 1.0) for name in session.taxels)
        bits = [_bits(switches, len(session.switches)) for switches, _ in frames]
        codes = [[] if glove is None else list(glove.sensors) for _, glove in frames]
        taxels = [[] if switches is None else [code or 0 for code in switches.taxels or ()] for switches, _ in frames]
        try:
            grasp_set = GraspSet(
                switches=np.array(bits, bool).reshape(len(trials), len(session.switches)),
                switch_names=session.switches,
                codes=np.array(codes, np.uint16).reshape(len(trials), len(joints)),
                joints=joints,
                grasps=np.array([trial.grasp for trial in trials]),
                taxonomy=Taxonomy(collection.taxonomy, collection.types),
                subjects=np.array([collection.subject] * len(trials)),
                objects=np.array([trial.object for trial in trials]),
                trials=np.array([trial.number for trial in trials]),
                taxels=np.array(taxels, np.uint16).reshape(len(trials), len(pads)),
                taxel_columns=pads,
            )
            quick = QuickAccuracy(grasp_set)
            found = quick.of(range(len(quick.names)))
        except ThenarError as reason:
            return {"why": str(reason)}
        return {"of": found.of, "mean": found.mean, "low": found.low, "high": found.high}

    def _press(self, asked: Asked) -> None:
        if asked.name not in KEYS:
            raise ThenarError(f"there is no key {shortened(repr(asked.name))}")
        if self._keys is None:
            raise ThenarError("nothing is recorded now")
        self._keys.put(asked.name)

    def _recorded(self, asked: Asked) -> bytes:
        """Return the captured frames of a trial, as the hand shows them."""
        if asked.trial not in self._captured:
            raise ThenarError(f"trial {asked.trial} was not recorded")
        sensors = GloveSensors(self._studio.project.wiring(), self._studio.project.hand())
        trial, shown = self._by_number[asked.trial], sensors.read(*self._captured[asked.trial])
        return message("recorded", sensors.drawn(shown), trial=trial.number, grasp=trial.grasp, thing=trial.object)


def _bits(frame: SwitchFrame | None, count: int) -> list[bool]:
    return [frame is not None and bool(frame.closed >> bit & 1) for bit in range(count)]


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

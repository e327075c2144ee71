"""Guided collection: the next grasp, the display, the meaning of keys, and the time of capture.

It has no terminal, device or clock: frames, keys and the time come in, labels go to a Recorder.
"""

import random
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from thenar.drivers.errors import SettingError

from ..frames import OLD_US, GloveFrame, SwitchFrame
from ..names import list_names
from ..published import NONE
from .layout import Tail
from .reader import Reader
from .session import MOST_TRIALS, Collection, Event, Label, Session
from .writer import Recorder


@dataclass(frozen=True, slots=True)
class Trial:
    """One grasp to record: its number in the collection, from 1, its type and its object; for none, its movement."""

    number: int
    grasp: str
    object: str


# The newest frames of both kinds.
Frames = tuple[SwitchFrame | None, GloveFrame | None]


@dataclass(frozen=True, slots=True)
class Journal:
    """A collection that was begun: its first session, the accepted trials in the order of acceptance, the frames that
    were captured last in each trial, and the place to continue.
    """

    path: Path
    session: Session
    accepted: tuple[int, ...]
    captured: dict[int, Frames]
    tail: Tail


def planned(collection: Collection) -> tuple[Trial, ...]:
    """Return the trials of a collection: every task repeated, with its objects by turns, all in one random order.

    The paper collected in the same way: each type 100 times with two objects, in random order. Equal collections give
    equal plans. Raises SettingError if there are more than a million trials.
    """
    if len(collection.tasks) * collection.repetitions > MOST_TRIALS:
        raise SettingError(
            f"{len(collection.tasks)} grasp types of {collection.repetitions} repetitions each are more than "
            f"{MOST_TRIALS} trials: use fewer repetitions"
        )
    grasps = [
        (task.grasp, task.objects[repetition % len(task.objects)])
        for task in collection.tasks
        for repetition in range(collection.repetitions)
    ]
    # Of all its methods only random() is guaranteed to give the same numbers in every future Python.
    draw = random.Random(collection.seed).random
    ordered = sorted((draw(), place) for place in range(len(grasps)))
    return tuple(Trial(number, *grasps[place]) for number, (_, place) in enumerate(ordered, start=1))


def read_journal(path: Path) -> Journal:
    """Return the collection in a recording. Raises FormatError, SettingError if it has none, or OSError."""
    reader = Reader(path)
    first = reader.session
    if first.collection is None:
        raise SettingError(f"{path} is a recording without trials: name another output")
    accepted, captured = dict[int, None](), dict[int, Frames]()
    switches: SwitchFrame | None = None
    glove: GloveFrame | None = None
    for entry in reader:
        if isinstance(entry, SwitchFrame):
            switches = entry
        elif isinstance(entry, GloveFrame):
            glove = entry
        elif isinstance(entry, Label) and entry.event == "captured":
            captured[entry.trial] = switches, glove
        elif isinstance(entry, Label) and entry.event == "accepted":
            accepted[entry.trial] = None
        elif isinstance(entry, Label) and entry.event == "undone":
            accepted.pop(entry.trial, None)
    if reader.foreign or reader.altered:
        raise SettingError(
            f"{path} was changed by another program, or is damaged: import it, and collect the rest into another file"
        )
    return Journal(path, first, tuple(accepted), captured, reader.tail)


# A frame of this age was not read while the grasp was held.
FRESH_US = 200_000
# Time for which the empty hand moves in a trial of none.
MOVING_US = 2_000_000


# Before the first countdown, counting, while the empty hand moves, with a captured trial to judge, paused, with no
# trial left, or over.
Stage = Literal["ready", "countdown", "moving", "review", "paused", "done", "over"]
# Continue (and accept), repeat, undo the previous trial, skip this one, pause, leave.
Key = Literal["accept", "redo", "undo", "skip", "pause", "quit"]
KEYS: tuple[Key, ...] = get_args(Key)

_UNDER_WAY: dict[Key, str] = {"pause": "pause", "redo": "begin the countdown again"}
_OFFERED: dict[Stage, dict[Key, str]] = {
    "ready": {"accept": "start the countdown"},
    "countdown": _UNDER_WAY,
    "moving": _UNDER_WAY,
    "review": {"accept": "keep it, next grasp", "redo": "do it again"},
    "paused": {"accept": "continue"},
    "done": {"accept": "finish"},
    "over": {},
}
# Keys that are not offered but still work.
_ALSO: dict[tuple[Stage, Key], Key] = {
    ("ready", "redo"): "accept",
    ("paused", "redo"): "accept",
    ("paused", "pause"): "accept",
}
# In these stages a trial waits for the user to start it.
_WAITING: tuple[Stage, ...] = ("ready", "paused")


class CollectionGuide:
    """Leads through `trials`: countdown, capture, judgement, one key per trial.

    stage, trial  the current state (trial: None if none is left)
    done          number of accepted trials, those of earlier sittings included
    skipped       number of trials skipped here; they come again in another sitting
    problem       why nothing could be captured, as a sentence; "" without a problem
    lost          what the trials need and is not read now, as a sentence: until it is back, no countdown starts
    step          counts every change of stage or trial
    """

    def __init__(
        self,
        trials: Sequence[Trial],
        recorder: Recorder,
        countdown_us: int,
        accepted: Sequence[int] = (),
        old_us: int = OLD_US,
    ) -> None:
        """Lead through the `trials` whose numbers are not `accepted`; these are in the order of acceptance. A device
        whose newest frame has an age of `old_us` is silent.

        The recorder's session must have a collection.
        """
        collection = recorder.session.collection
        assert collection is not None
        self.subject = collection.subject
        self.total = len(trials)
        self.problem = self.lost = ""
        self.step = 0
        self._old_us = old_us
        by_number, before = {trial.number: trial for trial in trials}, frozenset(accepted)
        self._past = [(by_number[number], True) for number in accepted]
        self._left = [trial for trial in reversed(trials) if trial.number not in before]
        self._recorder = recorder
        self._countdown_us = countdown_us
        self._zero_us = 0
        self._switches: SwitchFrame | None = None
        self._glove: GloveFrame | None = None
        self._captured: Frames = (None, None)
        self._whole_us: int | None = None
        self.stage: Stage = "ready" if self._left else "done"

    @property
    def accepted(self) -> tuple[int, ...]:
        """The numbers of the accepted trials, in the order of acceptance."""
        return tuple(trial.number for trial, accepted in self._past if accepted)

    @property
    def done(self) -> int:
        """The number of accepted trials."""
        return len(self.accepted)

    @property
    def skipped(self) -> int:
        """The number of trials skipped in this sitting."""
        return len(self._past) - self.done

    @property
    def session(self) -> Session:
        """What is recorded."""
        return self._recorder.session

    @property
    def trial(self) -> Trial | None:
        """The trial that is next or under way."""
        return self._left[-1] if self._left else None

    @property
    def captured(self) -> Frames:
        """The newest frames; in review, those that were captured."""
        return self._captured if self.stage == "review" else (self._switches, self._glove)

    @property
    def waits(self) -> bool:
        """Whether no countdown can start, because something is not read."""
        return bool(self.lost) and self.stage in _WAITING

    def offered(self) -> dict[Key, str]:
        """Return the keys that are active now, and their effects."""
        if self.stage == "over":
            return {}
        found = {} if self.waits else dict(_OFFERED[self.stage])
        if self._left:
            found["skip"] = "skip this one"
        if self._past:
            found["undo"] = f"undo the last ({self._past[-1][0].grasp})"
        if self._left:
            found["quit"] = "leave, and continue another time" if self.stage in _WAITING else "leave"
        return found

    def seconds_left(self, now_us: int) -> float:
        """Return the time left of the countdown, or of the movement."""
        return max(0, self._zero_us - now_us) / 1e6

    def take(self, now_us: int, arrived: Sequence[SwitchFrame | GloveFrame], disconnected: Sequence[str] = ()) -> None:
        """Record the arrived frames, except in a pause; after the countdown, capture the grasp, or begin the movement
        of the empty hand, which is captured when its time has passed. `disconnected` are names of devices. Raises
        FrameError.
        """
        for frame in arrived:
            if self.stage != "paused":
                self._recorder.frame(frame)
            if isinstance(frame, SwitchFrame):
                self._switches = frame
            else:
                self._glove = frame
        self.lost = self._lost(now_us, disconnected)
        if self.stage not in ("countdown", "moving") or now_us < self._zero_us:
            return
        if self.stage == "countdown" and self._left[-1].grasp == NONE:
            self._zero_us = now_us + MOVING_US
            self._become("moving")
            self._label(now_us, "begun")
        else:
            self._capture(now_us)

    def press(self, now_us: int, key: Key) -> None:
        """Carry out `key`, if it is active now."""
        key = _ALSO.get((self.stage, key), key)
        if self.stage == "over" or key not in {*self.offered(), "quit"}:
            return
        if key == "quit" or (self.stage == "done" and key == "accept"):
            self._become("over")
        elif key == "undo":
            self._undo(now_us)
        elif key == "skip":
            self._judge(now_us, "skipped")
        elif key == "pause":
            self._become("paused")
        elif self.stage == "review" and key == "accept":
            self._judge(now_us, "accepted")
        else:
            if self.stage == "review":
                self._label(now_us, "redone")
            self._begin(now_us)

    def _judge(self, now_us: int, event: Event) -> None:
        """Finish this trial, and go on to the next."""
        self._label(now_us, event)
        self._past.append((self._left.pop(), event == "accepted"))
        self._turn(now_us)

    def _undo(self, now_us: int) -> None:
        """Return to the previous trial, dropping one that was captured but not judged."""
        if self.stage == "review":
            self._label(now_us, "redone")
        self._left.append(self._past.pop()[0])
        self._label(now_us, "undone")
        if self.stage == "done":
            self.stage = "ready"
        self._turn(now_us)

    def _turn(self, now_us: int) -> None:
        """Begin the next trial, or wait for the user to start it if this one waited, too."""
        if self._left and self.stage in _WAITING:
            self.problem = ""
            self._become(self.stage)
        else:
            self._begin(now_us)

    def _begin(self, now_us: int) -> None:
        self.problem = ""
        if self._left and self.lost:
            self._become("ready")
            return
        self._zero_us = now_us + self._countdown_us
        self._become("countdown" if self._left else "done")
        if self._left and self._left[-1].grasp != NONE:
            self._label(now_us, "begun")

    def _become(self, stage: Stage) -> None:
        self.stage = stage
        self.step += 1

    def _capture(self, now_us: int) -> None:
        self.problem = self._lack(now_us, FRESH_US)
        if self.problem:
            self._become("ready")
            return
        self._captured = self._switches, self._glove
        self._label(now_us, "captured")
        self._become("review")

    def _lack(self, now_us: int, oldest_us: int) -> str:
        """Return the inputs that are not read in frames of at most this age, as a sentence; "" if all is."""
        session = self.session
        if session.switches or session.taxels:
            if self._switches is None or now_us - self._switches.time_us > oldest_us:
                return f"the {'switches' if session.switches else 'taxels'} are silent"
            if lost := self._switches.lost:
                names = [name for place, name in enumerate(session.switches) if lost >> place & 1]
                return f"switches cannot be read: {list_names(names)}"
            codes = self._switches.taxels or (None,) * len(session.taxels)
            if names := [name for name, code in zip(session.taxels, codes, strict=True) if code is None]:
                return f"taxels cannot be read: {list_names(names)}"
        if session.sensors and (self._glove is None or now_us - self._glove.time_us > oldest_us):
            return "the CyberGlove is silent"
        if self._glove is not None and not self._glove.plugged:
            return "the CyberGlove is not plugged into its box"
        return ""

    def _lost(self, now_us: int, disconnected: Sequence[str]) -> str:
        """Return the devices or inputs that count as lost."""
        if disconnected:
            return f"{list_names(disconnected)} not connected"
        lack = self._lack(now_us, self._old_us)
        if not lack or self._whole_us is None:
            self._whole_us = min(
                (frame.time_us for frame in (self._switches, self._glove) if frame is not None), default=now_us
            )
        return lack if now_us - self._whole_us > self._old_us else ""

    def _label(self, now_us: int, event: Event) -> None:
        trial = self._left[-1]
        self._recorder.label(Label(now_us, event, trial.number, trial.grasp, self.subject, trial.object))

"""A task: the grasps that demonstrations have in common, in order, and a hand's progress in it.

The progress when a segment begins, lasts or ends depends only on the task, the step and the segment, so a replay of a
recording gives the same steps. A grasp that is not a step's may be a detour: a type that was seen to follow.
"""

from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

from thenar.drivers.errors import SettingError

from .files import read_file
from .names import list_names, shortened
from .published import NONE, LiveGrasp

_LARGEST = 1 << 24
_Name = Annotated[str, Meta(min_length=1, max_length=200)]
_Seconds = Annotated[float, Meta(ge=0.0, le=1e9)]
Deviation = Literal["", "unexpected", "skipped", "too long"]


class TaskStep(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A grasp of a task.

    grasp      its type
    shown      how many demonstrations have it here
    preshape   the preshape of the robot's hand, by its name in the table of preshapes; None: the table has none, or no
               table was given
    joints     the reading of each joint, by name: the median of the demonstrations' medians
    median_s, spread_s  how long it was held: the median, and the median distance from it
    limit_s    a grasp held longer deviates; as taught, twice the longest shown
    then       types that may follow, as shown, the next step's first; none after the last
    """

    grasp: _Name
    shown: Annotated[int, Meta(ge=1)]
    preshape: _Name | None
    joints: dict[_Name, float]
    median_s: _Seconds
    spread_s: _Seconds
    limit_s: _Seconds
    then: tuple[_Name, ...]


class Task(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The content of task.json, written by `thenar teach`.

    build           checksum of the build that recognised the demonstrations; the steps have its types
    demonstrations  names of their files, or of the subjects and sessions of a set
    preshapes       the table with the steps' preshapes
    units           of the joints, by name
    first           types with which demonstrations begin, the first step's first
    """

    schema: Literal[1] = 1
    name: _Name
    build: str
    demonstrations: tuple[str, ...]
    preshapes: str | None
    units: dict[_Name, str]
    first: tuple[_Name, ...]
    steps: Annotated[tuple[TaskStep, ...], Meta(min_length=1)]

    def check(self, grasps: tuple[str, ...]) -> None:
        """Raise SettingError if a build that recognises `grasps` can never see a step."""
        if strange := [step.grasp for step in self.steps if step.grasp not in grasps]:
            raise SettingError(
                f"task {shortened(self.name)}: the build does not recognise {list_names(tuple(dict.fromkeys(strange)))}"
                ": use the build that the task was taught with"
            )


def load_task(path: Path) -> Task:
    """Return the task of a task.json. Raises SettingError that names the file and the fault, OSError."""
    data = read_file(path, _LARGEST, SettingError)
    try:
        return msgspec.json.decode(data, type=Task)
    except (msgspec.DecodeError, UnicodeDecodeError) as wrong:
        raise SettingError(f"{path} is not a task of `thenar teach`: {wrong}") from None


class Progress(Struct, frozen=True):
    """A hand's progress in a task.

    step       the number of the last step that began, from 1; 0 before the first; of `steps`
    grasp      the type that is held now, "none" between grasps
    expected   types that may come next, the next step's first; none after the last step
    deviation  of the newest grasp. "unexpected": its type is in no later step, and was never shown here. "skipped": it
               belongs to a step after the next. "too long": it is held longer than the step's limit
    detail     the deviation in a sentence, "" if there is none
    done       whether the last step has begun and ended
    """

    step: int
    steps: int
    grasp: str = NONE
    expected: tuple[str, ...] = ()
    deviation: Deviation = ""
    detail: str = ""
    done: bool = False

    @property
    def text(self) -> str:
        """The progress in one line: the step, the next types, and any deviation."""
        said = "task is done" if self.done else f"step {self.step} of {self.steps}"
        said += f", {self.grasp} held" if self.grasp != NONE else ""
        said += f"; next {self.expected[0]}" if self.expected else ""
        said += f" (or {', '.join(self.expected[1:])})" if self.expected[1:] else ""
        return f"{said}. {self.detail}" if self.detail else said


class ProgressLine(Progress, frozen=True, tag_field="kind", tag="task"):
    """The fields of `Progress`, as a line of JSON."""


def _at(task: Task, step: int, grasp: str = NONE, deviation: Deviation = "", detail: str = "") -> Progress:
    then = task.steps[step - 1].then if step else task.first
    return Progress(step, len(task.steps), grasp, then, deviation, detail)


def begun(task: Task, step: int, grasp: str) -> Progress:
    """Return the progress when a segment of type `grasp` begins after `step` steps."""
    left = [each.grasp for each in task.steps[step:]]
    if grasp in left[:1]:
        return _at(task, step + 1, grasp)
    if step and grasp == task.steps[step - 1].grasp:
        return _at(task, step, grasp)  # resumed
    if grasp in left:
        skipped = left[: left.index(grasp)]
        return _at(task, step + len(skipped) + 1, grasp, "skipped", f"skipped: {', '.join(skipped)}")
    here = _at(task, step, grasp)
    if grasp in here.expected:
        return here
    wanted = f"{' or '.join(here.expected)} was expected" if here.expected else "the task was over"
    return _at(task, step, grasp, "unexpected", f"{grasp} is unexpected: {wanted}")


class TaskFollower:
    """Follows a hand through a task, using the published segments."""

    __slots__ = ("_segment", "_told", "progress", "task")

    def __init__(self, task: Task) -> None:
        self.task, self.progress, self._segment = task, _at(task, 0), 0
        self._told: Progress | None = None

    @classmethod
    def of(cls, path: Path, grasps: tuple[str, ...]) -> "TaskFollower":
        """Load a task for a build that recognises `grasps`. Raises SettingError if it does not fit, OSError."""
        task = load_task(path)
        task.check(grasps)
        return cls(task)

    def update(self, grasp: LiveGrasp) -> Progress | None:
        """Return the progress at the first moment, and whenever it changes."""
        before = self.progress
        if grasp.state in ("held", "releasing"):
            self._hold(grasp)
        elif grasp.state == "none" and before.grasp != NONE:
            over = before.step == before.steps and before.grasp == self.task.steps[-1].grasp
            self.progress = msgspec.structs.replace(before, grasp=NONE, done=before.done or over)
        news = self.progress is not self._told
        self._told = self.progress
        return self.progress if news else None

    def _hold(self, grasp: LiveGrasp) -> None:
        before = self.progress
        if grasp.segment != self._segment:
            self._segment = grasp.segment
            after = begun(self.task, before.step, grasp.segment_type)
            self.progress = msgspec.structs.replace(after, done=before.done)
            return
        own = self.task.steps[before.step - 1] if before.step else None
        if own is None or before.deviation or grasp.segment_type != own.grasp or grasp.segment_us is None:
            return
        held_s = (grasp.time_us - grasp.segment_us) / 1e6
        if held_s > own.limit_s:
            detail = f"{own.grasp} is held for longer than {own.limit_s:g} s"
            self.progress = msgspec.structs.replace(before, deviation="too long", detail=detail)

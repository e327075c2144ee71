"""A task: the grasps that demonstrations have in common, in order."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

_Name = Annotated[str, Meta(min_length=1, max_length=200)]
_Seconds = Annotated[float, Meta(ge=0.0, le=1e9)]


class TaskStep(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A grasp of a task.

    grasp      its type
    shown      how many demonstrations have it here
    preshape   the preshape of the robot's hand, by its name in the table of preshapes; None: the table has none, or no
               table was given
    joints     the reading of each joint, by name: the median of the demonstrations' medians
    median_s, spread_s  how long it was held: the median, and the median distance from it
    limit_s    the longest that it is expected to last; as taught, twice the longest shown
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

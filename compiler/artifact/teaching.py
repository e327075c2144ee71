"""Demonstrations of a task, which are the grasps that a build segments in recordings, and their consensus as a task and
as a behaviour tree.

The demonstrations' sequences of types are aligned one after another: first the one with the smallest distance to all
others (the centre of a star), then the others by their distance from it. Dynamic programming places each into the
existing columns such that the sum of differences over all pairs of demonstrations is minimal: two different types, or a
type and a gap, count 1 (edit distance). A column is a step if most demonstrations have the same type there.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from statistics import median
from typing import Annotated, Literal, NamedTuple
from xml.etree import ElementTree

import msgspec
import numpy as np
from msgspec import Meta, Struct
from numpy.typing import NDArray

from thenar.runtime.build import Build
from thenar.runtime.live.replay import recognised
from thenar.runtime.policy import Policy
from thenar.runtime.preshape import PreshapeTable

from ..movements.segments import levenshtein, segments_of
from ..movements.streams import streams_of
from ..movements.transitions import Transitions
from ..recordings import RecordingError
from ..recordings.graspset import GraspSet
from ..samples import select_inputs
from .timeline import MCAP, Timeline, segment

# Holding a grasp this much longer than the longest demonstration is a deviation.
LIMIT = 2.0
Column = tuple[int | None, ...]
Codes = tuple[NDArray[np.int64], NDArray[np.uint16]]
# Of the action Grasp.
_PORTS = ("grasp", "preshape", "joints", "median_s", "limit_s")


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


class DemonstratedGrasp(NamedTuple):
    """A grasp of a demonstration: its type, its duration, and the median of each joint while it was held, in the
    build's units; empty if joints were not read.
    """

    grasp: str
    held_s: float
    joints: tuple[float, ...]


class Demonstration(NamedTuple):
    """A demonstration: its name, and its grasps in order."""

    name: str
    grasps: tuple[DemonstratedGrasp, ...]

    @property
    def types(self) -> tuple[str, ...]:
        """The types of its grasps."""
        return tuple(one.grasp for one in self.grasps)


def aligned(sequences: Sequence[Sequence[str]]) -> list[Column]:
    """Return the columns of an alignment: for each sequence, in order, the index of its item there; None: a gap.

    The result is deterministic; of equal alignments, the one with items in earlier columns is returned.
    """
    number_of = {name: number for number, name in enumerate(dict.fromkeys(chain(*sequences)))}
    numbers = [[number_of[name] for name in sequence] for sequence in sequences]
    apart = [[levenshtein(one, other) for other in numbers] for one in numbers]
    centre = min(range(len(sequences)), key=lambda one: (sum(apart[one]), one))
    order = sorted(range(len(sequences)), key=lambda one: (apart[centre][one], one != centre, one))
    columns = list[list[int | None]]()
    for done, number in enumerate(order):
        columns = _joined(columns, [sequences[one] for one in order[:done]], sequences[number])
    back = [order.index(number) for number in range(len(order))]
    return [tuple(column[place] for place in back) for column in columns]


def _joined(
    columns: list[list[int | None]], before: Sequence[Sequence[str]], sequence: Sequence[str]
) -> list[list[int | None]]:
    """Return the columns with one more sequence: the cheapest alignment, computed from the end."""
    rows, width, others = len(sequence), len(columns), len(before)
    filled = [sum(item is not None for item in column) for column in columns]

    def differ(column: int, item: str) -> int:
        pairs = zip(before, columns[column], strict=True)
        return sum(at is None or types[at] != item for types, at in pairs)

    cost = [[0] * (width + 1) for _ in range(rows + 1)]
    for row in range(rows, -1, -1):
        for column in range(width, -1, -1):
            ways = [cost[row + 1][column] + others] if row < rows else []
            ways += [cost[row][column + 1] + filled[column]] if column < width else []
            if row < rows and column < width:
                ways.append(cost[row + 1][column + 1] + differ(column, sequence[row]))
            cost[row][column] = min(ways, default=0)
    joined, row, column = list[list[int | None]](), 0, 0
    while row < rows or column < width:
        here = cost[row][column]
        if row < rows and column < width and here == cost[row + 1][column + 1] + differ(column, sequence[row]):
            joined.append([*columns[column], row])
            row, column = row + 1, column + 1
        elif column < width and here == cost[row][column + 1] + filled[column]:
            joined.append([*columns[column], None])
            column += 1
        else:
            joined.append([None] * others + [row])
            row += 1
    return joined


def taught(
    build: Build,
    shown: Sequence[Demonstration],
    name: str,
    preshapes: PreshapeTable | None = None,
    transitions: Transitions | None = None,
) -> Task:
    """Return the task that demonstrations have in common.

    Parameters
    ----------
    build : Build
        The build that recognised them.
    shown : sequence of Demonstration
        At least one.
    name : str
        The name of the task.
    preshapes : PreshapeTable, optional
        The preshapes of the robot's hand by type.
    transitions : Transitions, optional
        Counts from other recordings: a frequent transition there is allowed here.

    Raises
    ------
    RecordingError
        If no grasp occurs in most of them.
    """
    columns = aligned([one.types for one in shown])
    steps = [step for column in columns if (step := _majority(shown, column)) is not None]
    if not steps:
        raise RecordingError(
            f"the {len(shown)} demonstrations have no grasp that occurs in most of them: "
            f"{'; '.join(f'{one.name}: ' + ' '.join(one.types[:8]) for one in shown[:4])}"
        )
    next_types = [grasp for grasp, _ in steps[1:]] + [None]
    return Task(
        name=name,
        build=build.manifest.checksum,
        demonstrations=tuple(one.name for one in shown),
        preshapes=None if preshapes is None else preshapes.name,
        units={joint.name: joint.unit for joint in build.manifest.joints},
        first=_ordered(steps[0][0], Counter(one.types[0] for one in shown)),
        steps=tuple(
            _step(build, shown, grasp, places, following, preshapes, transitions)
            for (grasp, places), following in zip(steps, next_types, strict=True)
        ),
    )


def _majority(shown: Sequence[Demonstration], column: Column) -> tuple[str, dict[int, int]] | None:
    """Return the type that most demonstrations have in a column, and its index in each that does."""
    places = {number: at for number, at in enumerate(column) if at is not None}
    counts = Counter(shown[number].types[at] for number, at in places.items())
    grasp, count = counts.most_common(1)[0]
    places = {number: at for number, at in places.items() if shown[number].types[at] == grasp}
    return (grasp, places) if 2 * count > len(shown) else None


def _ordered(first: str | None, counts: Counter[str]) -> tuple[str, ...]:
    """Return `first`, then the others, the most frequent first, ties by name."""
    others = sorted(counts.keys() - {first}, key=lambda grasp: (-counts[grasp], grasp))
    return (*(() if first is None else (first,)), *others)


def _step(
    build: Build,
    shown: Sequence[Demonstration],
    grasp: str,
    places: dict[int, int],
    following: str | None,
    preshapes: PreshapeTable | None,
    transitions: Transitions | None,
) -> TaskStep:
    grasps = [shown[number].grasps[at] for number, at in places.items()]
    after = Counter(shown[number].types[at + 1] for number, at in places.items() if at + 1 < len(shown[number].types))
    then = _ordered(following, after)
    if transitions is not None and following is not None:
        then += tuple(name for name in transitions.frequent(grasp) if name not in then)
    durations = [one.held_s for one in grasps]
    read = [one.joints for one in grasps if one.joints]
    values = np.median(np.array(read), axis=0).round(2).tolist() if read else []
    joints = {joint.name: value for joint, value in zip(build.manifest.joints, values, strict=False)}
    preshape = None if preshapes is None else preshapes.chosen.get(grasp)
    return TaskStep(
        grasp=grasp,
        shown=len(places),
        preshape=None if preshape is None else preshape.name,
        joints=joints,
        median_s=round(median(durations), 3),
        spread_s=round(median(abs(one - median(durations)) for one in durations), 3),
        limit_s=round(LIMIT * max(durations), 3),
        then=then,
    )


def task_json(task: Task) -> bytes:
    """Return the content of a task.json."""
    text: bytes = msgspec.json.format(msgspec.json.encode(task), indent=2)
    return text + b"\n"


def behaviour_tree(task: Task) -> bytes:
    """Return the task as a tree of BehaviorTree.CPP 4: a Sequence of actions Grasp, with the ports _PORTS.

    `joints` are name=value, separated by semicolons; an empty `preshape` means none.
    """
    root = ElementTree.Element("root", {"BTCPP_format": "4", "main_tree_to_execute": "task"})
    tree = ElementTree.SubElement(root, "BehaviorTree", {"ID": "task"})
    sequence = ElementTree.SubElement(tree, "Sequence", {"name": task.name})
    for number, step in enumerate(task.steps, 1):
        joints = ";".join(f"{name}={value:g}" for name, value in step.joints.items())
        values = (step.grasp, step.preshape or "", joints, f"{step.median_s:g}", f"{step.limit_s:g}")
        ports = dict(zip(_PORTS, values, strict=True))
        ElementTree.SubElement(sequence, "Action", {"ID": "Grasp", "name": f"{number} {step.grasp}"} | ports)
    action = ElementTree.SubElement(ElementTree.SubElement(root, "TreeNodesModel"), "Action", {"ID": "Grasp"})
    for port in _PORTS:
        ElementTree.SubElement(action, "input_port", {"name": port})
    ElementTree.indent(root)
    tree_text: bytes = ElementTree.tostring(root, "utf-8")
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + tree_text + b"\n"


def demonstrations(folder: Path, recordings: Sequence[Path]) -> Iterator[Demonstration]:
    """Yield a demonstration for each recording (.mcap) of the build's inputs and for each stream of whole movements.

    Whole movements come from sets (.grasps). Raises RecordingError where a demonstration shows no grasp, and whatever
    `segment` raises.
    """
    build = Build.load(folder)
    for path in recordings:
        timelines = segment(folder, path, Policy().lag_us)
        if path.suffix.lower() == MCAP:
            # The codes of the joints, and when they were read, on the clock of the run's timelines.
            read = [
                (moment.grasp.unix_us, moment.codes) for moment in recognised(build, path) if moment.codes is not None
            ]
            codes = np.array([row for _, row in read], np.uint16).reshape(len(read), len(build.manifest.joints))
            times_us = np.array([time_us for time_us, _ in read], np.int64)
            # A gap in the readings splits a run into several timelines.
            yield _shown(build, path.name, timelines, [(times_us, codes)] * len(timelines))
            continue
        grasp_set = GraspSet.load(path)
        _, codes = select_inputs(grasp_set, build.manifest)
        tick_us = build.manifest.segmenting.tick_us
        for number, (timeline, stream) in enumerate(zip(timelines, streams_of(grasp_set, tick_us), strict=True), 1):
            times = stream.start_us + tick_us * np.arange(len(stream.rows))
            name = path.name if len(timelines) == 1 else f"{path.name} {number} ({timeline.name})"
            yield _shown(build, name, [timeline], [(times, codes[stream.rows])])


def _shown(build: Build, name: str, timelines: Sequence[Timeline], read: Sequence[Codes]) -> Demonstration:
    grasps = []
    for timeline, (times, codes) in zip(timelines, read, strict=True):
        for one in segments_of(timeline.states, len(timeline.types)):
            start, end = (timeline.start_us + tick * timeline.tick_us for tick in (one.start, one.end))
            own = codes[(times >= start) & (times < end)]
            grasps.append(DemonstratedGrasp(timeline.types[one.state], (end - start) / 1e6, _values(build, own)))
    if not grasps:
        raise RecordingError(f"{name} shows no grasp: look at it with thenar segment, or leave it out")
    return Demonstration(name, tuple(grasps))


def _values(build: Build, codes: NDArray[np.uint16]) -> tuple[float, ...]:
    """Return the median of each joint (n, j), in its unit; an empty tuple if there are no rows."""
    return (
        tuple(
            joint.value_a + (code - joint.code_a) * (joint.value_b - joint.value_a) / (joint.code_b - joint.code_a)
            for code, joint in zip(np.median(codes, axis=0).tolist(), build.manifest.joints, strict=True)
        )
        if len(codes)
        else ()
    )

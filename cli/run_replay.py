"""`thenar run --replay`: recorded frames recognised once more, from a set of grasps or a live recording."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from thenar.runtime.build import Build
from thenar.runtime.live.policy import Policy
from thenar.runtime.live.replay import replayed
from thenar.runtime.sinks.line import encode

from .common import warning
from .lines import echo

if TYPE_CHECKING:
    from thenar.compiler.recordings.graspset import GraspSet


class Line(msgspec.Struct, frozen=True):
    """One line of output: a recognition, and the grasp type that was recorded."""

    time_us: int
    grasp: str
    probability: float
    margin: int
    degraded: bool
    recorded: str


def replay_set(build: Build, replay: Path, period_us: int) -> None:
    """Recognise every row of a set of grasps: one JSON line each on stdout, the rate on stderr."""
    from thenar.compiler.recordings.graspset import GraspSet

    grasp_set = GraspSet.load(replay)
    stdout, correct = sys.stdout.buffer, 0
    for line in _rows(build, grasp_set, period_us):
        correct += line.grasp == line.recorded
        stdout.write(msgspec.json.encode(line) + b"\n")
    stdout.flush()
    rows = len(grasp_set)
    echo(f"{correct} of {rows} frames recognised as recorded ({correct / max(rows, 1):.1%})", err=True)


def replay_recording(build: Build, replay: Path, policy: Policy | None) -> None:
    """Recognise the frames of a live recording again, at the times at which they were recognised then.

    One JSON line each on stdout, as the live run wrote it; on stderr, how many came out as they did then.
    """
    stdout, same, frames = sys.stdout.buffer, 0, 0
    for then, now in replayed(build, replay, policy, warning):
        same += then == now
        frames += 1
        stdout.write(encode(now, None, None))
    stdout.flush()
    echo(f"{same} of {frames} frames recognised as they were recorded", err=True)


def _rows(build: Build, grasp_set: "GraspSet", period_us: int) -> Iterator[Line]:
    from thenar.compiler.artifact.select import select_inputs
    from thenar.runtime.recognizer import Frame, Recognizer

    recognizer = Recognizer(build)
    bits, codes = select_inputs(grasp_set, build.manifest)
    for row, (switches, joints) in enumerate(zip(bits, codes, strict=True)):
        found = recognizer.recognise(Frame(row * period_us, switches, joints))
        yield Line(
            time_us=found.time_us,
            grasp=found.grasp,
            probability=round(found.probability, 6),
            margin=found.margin,
            degraded=found.degraded,
            recorded=str(grasp_set.grasps[row]),
        )

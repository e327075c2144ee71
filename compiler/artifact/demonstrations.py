"""Demonstrations of a task: the grasps in recordings, as a live run of the build segments them."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.build import Build
from thenar.runtime.live.replay import recognised
from thenar.runtime.policy import Policy

from ..movements.scores import segments_of
from ..movements.streams import MovementError, streams_of
from ..movements.teaching import DemonstratedGrasp, Demonstration
from ..movements.timeline import Timeline
from ..recordings.graspset import GraspSet
from .segments import MCAP, segment
from .verify_firmware import select_inputs

Codes = tuple[NDArray[np.int64], NDArray[np.uint16]]


def demonstrations(folder: Path, recordings: Sequence[Path]) -> Iterator[Demonstration]:
    """Yield a demonstration for each recording (.mcap) of the build's inputs and for each stream of whole movements.

    Whole movements come from sets (.grasps). Raises MovementError where a demonstration shows no grasp, and whatever
    `segment` raises.
    """
    build = Build.load(folder)
    for path in recordings:
        timelines = segment(folder, path, Policy().lag_us)
        if path.suffix.lower() == MCAP:
            # A gap in the readings splits a run into several timelines.
            yield _shown(build, path.name, timelines, [_codes_of_run(build, path)] * len(timelines))
            continue
        grasp_set = GraspSet.load(path)
        _, codes = select_inputs(grasp_set, build.manifest)
        tick_us = build.manifest.segmenting.tick_us
        for number, (timeline, stream) in enumerate(zip(timelines, streams_of(grasp_set, tick_us), strict=True), 1):
            times = stream.start_us + tick_us * np.arange(len(stream.rows))
            name = path.name if len(timelines) == 1 else f"{path.name} {number} ({timeline.name})"
            yield _shown(build, name, [timeline], [(times, codes[stream.rows])])


def _codes_of_run(build: Build, path: Path) -> Codes:
    """Return the times at which the joints were read in a run, on the clock of its timelines, and their codes."""
    found = [(one.grasp.unix_us, one.codes) for one in recognised(build, path) if one.codes is not None]
    codes = np.array([codes for _, codes in found], np.uint16).reshape(len(found), len(build.manifest.joints))
    return np.array([time_us for time_us, _ in found], np.int64), codes


def _shown(build: Build, name: str, timelines: Sequence[Timeline], read: Sequence[Codes]) -> Demonstration:
    grasps = []
    for timeline, (times, codes) in zip(timelines, read, strict=True):
        for one in segments_of(timeline.states, len(timeline.types)):
            start, end = (timeline.start_us + tick * timeline.tick_us for tick in (one.start, one.end))
            own = codes[(times >= start) & (times < end)]
            grasps.append(DemonstratedGrasp(timeline.types[one.state], (end - start) / 1e6, _values(build, own)))
    if not grasps:
        raise MovementError(f"{name} shows no grasp: look at it with thenar segment, or leave it out")
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

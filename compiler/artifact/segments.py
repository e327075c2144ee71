"""`segment`: find a build's segments in whole movements, or in a recording of a live glove."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import SettingError
from thenar.runtime.build import Build
from thenar.runtime.live.replay import recognised
from thenar.runtime.rejection import refused
from thenar.runtime.segmenting.decoder import decode, emissions

from ..movements.learning import live_states
from ..movements.streams import MovementError, newest, streams_of
from ..movements.timeline import Timeline, probabilities
from ..recordings.graspset import GraspSet
from .documents import Progress
from .verify_firmware import select_inputs

_LONGEST_LAG_US = 10_000_000
MCAP = ".mcap"


def segment(
    folder: str | Path,
    recordings: GraspSet | str | Path,
    lag_us: int | None = None,
    progress: Progress | None = None,
    warn: Callable[[str], None] = lambda _: None,
) -> tuple[Timeline, ...]:
    """Find the segments of recordings.

    Parameters
    ----------
    folder : path
        The build.
    recordings : GraspSet or path
        Whole movements, as a set or its file; or a recording (.mcap) that has all inputs of the build: a live run of
        this or another build, or a collection.
    lag_us : int, optional
        Decide live, this long after each moment. None: decide from the whole stream, which is exact.
    progress : callable, optional
        Called with (done, total) after each stream.
    warn : callable, optional
        Called with a sentence for each fault of a recording.

    Returns
    -------
    tuple of Timeline
        One for each subject, session and stretch without a pause.

    Raises
    ------
    MovementError
        If the recordings are not whole movements, or are empty.
    SettingError
        If the lag is out of range, or a recording lacks an input of the build.
    BuildError, SealError, McapError, CompileError
        If a file is damaged, or the recordings lack inputs of the build.

    Examples
    --------
    >>> from thenar.compiler.artifact.segments import segment
    >>> timelines = segment("build", "movements.grasps")  # doctest: +SKIP
    >>> [(one.type, one.start_s, one.end_s) for one in timelines[0].segments()]  # doctest: +SKIP
    """
    if lag_us is not None and not 0 <= lag_us <= _LONGEST_LAG_US:
        raise SettingError(f"lag_us={lag_us}: the lag must be 0 to {_LONGEST_LAG_US} us")
    build = Build.load(folder)
    if not isinstance(recordings, GraspSet) and Path(recordings).suffix.lower() == MCAP:
        return _of_run(build, Path(recordings), lag_us, warn)
    grasp_set = recordings if isinstance(recordings, GraspSet) else GraspSet.load(recordings)
    return _of_movements(build, grasp_set, lag_us, progress)


def _of_movements(
    build: Build, grasp_set: GraspSet, lag_us: int | None, progress: Progress | None
) -> tuple[Timeline, ...]:
    """Return the timelines of whole movements, with their recorded types as the truth."""
    if not len(grasp_set):
        raise MovementError("the set has no rows to find segments in")
    bits, codes = select_inputs(grasp_set, build.manifest)
    streams = streams_of(grasp_set, build.manifest.segmenting.tick_us)
    types = build.grasps[: build.manifest.segmenting.n_types]
    number = {name: place for place, name in enumerate(types)}
    known = np.array([number.get(name, len(types)) for name in grasp_set.taxonomy.names], np.intp)
    found = []
    for done, stream in enumerate(streams, 1):
        own = bits[stream.rows], codes[stream.rows]
        scores, rejection = build.tables.scores(*own), build.manifest.rejection
        no = None if rejection is None else refused(rejection, scores, *own)
        states, likely = _decoded(build, scores, no, lag_us)
        found.append(
            Timeline(
                subject=stream.subject,
                session=stream.session,
                start_us=stream.start_us,
                tick_us=build.manifest.segmenting.tick_us,
                types=types,
                states=states,
                probabilities=likely,
                truth=known[grasp_set.labels[stream.rows]],
                continued=stream.continued,
            )
        )
        if progress is not None:
            progress(done, len(streams))
    return tuple(found)


def _decoded(
    build: Build, scores: NDArray[np.integer], no: NDArray[np.bool_] | None, lag_us: int | None
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the state of each tick of scores (T, n_lanes), some of which are rejected, and its probability."""
    model = build.manifest.segmenting
    if lag_us is None:
        states = decode(model, emissions(scores, model, no))
    else:
        states = live_states(model, scores, min(lag_us // model.tick_us, len(scores)), no)
    return states, probabilities(scores, states, build.tables.scale)


def _of_run(build: Build, path: Path, lag_us: int | None, warn: Callable[[str], None]) -> tuple[Timeline, ...]:
    """Return the timelines of a live run, cut where too little could be read for longer than a pause."""
    tick_us, types = build.manifest.segmenting.tick_us, build.grasps[: build.manifest.segmenting.n_types]
    read: list[tuple[int, Sequence[int], bool]] = []
    zero_us: int | None = None
    for moment in recognised(build, path, warn):
        zero_us = moment.grasp.unix_us if zero_us is None else zero_us
        if moment.scores is not None:
            read.append((moment.grasp.unix_us, moment.scores, moment.refused))
    if not read:
        raise MovementError(f"{path.name} holds no moment with enough readings for the build")
    times_us, biased_scores, no = (np.array(each) for each in zip(*read, strict=True))
    found = []
    for number, (start_us, rows) in enumerate(newest(times_us, tick_us), 1):
        states, likely = _decoded(build, biased_scores[rows], no[rows], lag_us)
        found.append(Timeline(path.stem, str(number), start_us, tick_us, types, states, likely, zero_us=zero_us or 0))
    return tuple(found)

"""Timelines: the segments that a build finds in whole movements or in a recording of a live glove, and their table and
picture.
"""

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.drivers.errors import SettingError
from thenar.runtime.build import Build
from thenar.runtime.live.replay import recognised
from thenar.runtime.scores import refused

from ..movements.segments import OVERLAPS, Span, live_states, score_streams, segments_of
from ..movements.streams import newest, streams_of
from ..pictures import on_paper, painting, rendered
from ..recordings import RecordingError
from ..recordings.graspset import GraspSet
from ..samples import select_inputs
from ..text import cell
from ..trainers.base import Report

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LONGEST_LAG_US = 10_000_000
MCAP = ".mcap"
_WIDTH_IN, _LINE_IN, _MOST_LINES = 11.0, 0.62, 60
# With this many seconds per line and this font size, the name of a type fits into most grasps.
_SECONDS, _POINTS = 10.0, 7.0
# The largest width of a letter, in units of the font size.
_LETTER = 0.75
# Colours of types, far enough from one another to tell neighbours apart; the name says which it is.
_COLOURS = ("switches", "joints", "both", "baseline-1", "baseline-2", "baseline-3", "link", "miss", "hit")


class FoundSegment(msgspec.Struct, frozen=True):
    """A segment: its start and end in seconds, its grasp type, and the mean probability of that type over its ticks.

    subject, session  of the stream
    """

    start_s: float
    end_s: float
    type: str
    confidence: float
    subject: str
    session: str


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """A stream of T ticks and the states found in it.

    start_us, tick_us  the time of the first tick, on the stream's clock, and the duration of a tick
    zero_us            the time from which seconds are counted
    types              names of states 0 to K - 1; state K means that nothing is held
    states, truth      (T,) found, and as recorded; None: unknown
    probabilities      (T,) of the states found
    continued          whether it begins in the middle of a recorded grasp that began in the timeline before
    """

    subject: str
    session: str
    start_us: int
    tick_us: int
    types: tuple[str, ...]
    states: NDArray[np.intp]
    probabilities: NDArray[np.float64]
    truth: NDArray[np.intp] | None = None
    zero_us: int = 0
    continued: bool = False

    @property
    def name(self) -> str:
        """The subject, and the session unless it is the first: "A", or "A 2"."""
        return self.subject if self.session == "1" else f"{self.subject} {self.session}"

    def seconds(self, tick: int) -> float:
        """Return the time of a tick in seconds."""
        return (self.start_us - self.zero_us + tick * self.tick_us) / 1e6

    def segments(self) -> tuple[FoundSegment, ...]:
        """Return the segments in order."""
        return tuple(
            FoundSegment(
                self.seconds(one.start),
                self.seconds(one.end),
                self.types[one.state],
                round(float(self.probabilities[one.start : one.end].mean()), 4),
                self.subject,
                self.session,
            )
            for one in segments_of(self.states, len(self.types))
        )


def probabilities(scores: NDArray[np.integer], states: NDArray[np.intp], scale: float) -> NDArray[np.float64]:
    """Return the softmax probabilities (T,) of the states found, for scores (T, n_lanes) at `scale` steps per unit.

    The probability of nothing held is 0 if the scores do not include it.
    """
    behind = np.exp((scores - scores.max(axis=1, keepdims=True)) / scale)
    shares = behind[np.arange(len(states)), np.minimum(states, scores.shape[1] - 1)] / behind.sum(axis=1)
    return np.asarray(np.where(states < scores.shape[1], shares, 0.0))


def overlap_f1(timelines: Sequence[Timeline]) -> tuple[float, ...] | None:
    """Return F1 at each of OVERLAPS, or None unless the truth of all streams is known and holds a grasp."""
    none = len(timelines[0].types)
    known = [(line.continued, line.truth, line.states, None) for line in timelines if line.truth is not None]
    if len(known) < len(timelines) or not any((truth < none).any() for _, truth, *_ in known):
        return None
    total = score_streams(known, none)
    return tuple(total.f1(place) for place in range(len(OVERLAPS)))


def segment(
    folder: str | Path,
    recordings: GraspSet | str | Path,
    lag_us: int | None = None,
    progress: Report | None = None,
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
    RecordingError
        If the recordings are not whole movements, or are empty.
    SettingError
        If the lag is out of range, or a recording lacks an input of the build.
    BuildError, FormatError, CompileError
        If a file is damaged, or the recordings lack inputs of the build.

    Examples
    --------
    >>> from thenar.compiler.artifact.timeline import segment
    >>> timelines = segment("build", "movements.grasps")  # doctest: +SKIP
    >>> [(one.type, one.start_s, one.end_s) for one in timelines[0].segments()]  # doctest: +SKIP
    """
    if lag_us is not None and not 0 <= lag_us <= _LONGEST_LAG_US:
        raise SettingError(f"lag_us={lag_us}: the lag must be 0 to {_LONGEST_LAG_US} µs")
    build = Build.load(folder)
    if not isinstance(recordings, GraspSet) and Path(recordings).suffix.lower() == MCAP:
        return _of_run(build, Path(recordings), lag_us, warn)
    grasp_set = recordings if isinstance(recordings, GraspSet) else GraspSet.load(recordings)
    return _of_movements(build, grasp_set, lag_us, progress)


def _of_movements(
    build: Build, grasp_set: GraspSet, lag_us: int | None, progress: Report | None
) -> tuple[Timeline, ...]:
    """Return the timelines of whole movements, with their recorded types as the truth."""
    if not len(grasp_set):
        raise RecordingError("the set has no rows to find segments in")
    bits, codes = select_inputs(grasp_set, build.manifest)
    streams = streams_of(grasp_set, build.manifest.segmenting.tick_us)
    types = build.grasps[: build.manifest.segmenting.n_types]
    number = {name: place for place, name in enumerate(types)}
    known = np.array([number.get(name, len(types)) for name in grasp_set.taxonomy.names], np.intp)
    timelines = []
    for done, stream in enumerate(streams, 1):
        inputs = bits[stream.rows], codes[stream.rows]
        scores, rejection = build.tables.scores(*inputs), build.manifest.rejection
        rejected = None if rejection is None else refused(rejection, scores, *inputs)
        states, likely = _decoded(build, scores, rejected, lag_us)
        timelines.append(
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
    return tuple(timelines)


def _decoded(
    build: Build, scores: NDArray[np.integer], rejected: NDArray[np.bool_] | None, lag_us: int | None
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the state of each tick of scores (T, n_lanes), some of which are rejected, and its probability."""
    model, whole = build.manifest.segmenting, len(scores)
    lag = whole if lag_us is None else min(lag_us // model.tick_us, whole)
    states = live_states(model, scores, lag, rejected)
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
        raise RecordingError(f"{path.name} holds no moment with enough readings for the build")
    times_us, biased_scores, rejected = (np.array(each) for each in zip(*read, strict=True))
    timelines = []
    for number, (start_us, rows) in enumerate(newest(times_us, tick_us), 1):
        states, likely = _decoded(build, biased_scores[rows], rejected[rows], lag_us)
        timelines.append(
            Timeline(path.stem, str(number), start_us, tick_us, types, states, likely, zero_us=zero_us or 0)
        )
    return tuple(timelines)


def as_csv(timelines: Sequence[Timeline]) -> bytes:
    """Return a table with one row per segment."""
    import csv

    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(FoundSegment.__struct_fields__)
    for timeline in timelines:
        for one in timeline.segments():
            names = cell(one.type), cell(one.subject), cell(one.session)
            writer.writerow((f"{one.start_s:.6f}", f"{one.end_s:.6f}", names[0], f"{one.confidence:.4f}", *names[1:]))
    return text.getvalue().encode()


def draw(timelines: Sequence[Timeline], kind: str) -> bytes:
    """Return the picture as the bytes of a "png" or "svg"; the same timelines give the same bytes.

    Raises RecordingError where there is nothing to draw, PictureError if matplotlib is not installed.
    """
    length = [len(timeline.states) * timeline.tick_us / 1e6 for timeline in timelines]
    if not any(length):
        raise RecordingError("the recordings have no frames to draw")
    # Long recordings get more seconds per line, and very long ones no names.
    seconds = _SECONDS * max(1.0, sum(length) / (_SECONDS * _MOST_LINES))
    lines = [
        (timeline, number * seconds)
        for timeline, lasts_s in zip(timelines, length, strict=True)
        for number in range(max(1, int(-(-lasts_s // seconds))))
    ]
    with painting(font_size=_POINTS):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(_WIDTH_IN, _LINE_IN * len(lines) + 0.6), dpi=120)
        every = figure.subplots(len(lines), 1, squeeze=False)[:, 0]
        figure.subplots_adjust(
            left=0.09,
            right=0.985,
            top=1 - 0.25 / figure.get_figheight(),
            bottom=0.45 / figure.get_figheight(),
            hspace=0.75,
        )
        for axes, (timeline, start_s) in zip(every, lines, strict=True):
            _draw_line(axes, timeline, start_s, seconds)
        every[-1].set_xlabel("time in s")
        return rendered(figure, kind)


def _draw_line(axes: "Axes", timeline: Timeline, start_s: float, seconds: float) -> None:
    tick_s = timeline.tick_us / 1e6
    rows = [("found", timeline.states)] + ([] if timeline.truth is None else [("true", timeline.truth)])
    first_s = timeline.seconds(0) + start_s
    axes.set_xlim(first_s, first_s + seconds)
    axes.set_ylim(0, len(rows))
    axes.set_yticks([number + 0.5 for number in range(len(rows))], [f"{timeline.name}, {name}" for name, _ in rows])
    axes.tick_params(length=2, pad=1)
    axes.spines["left"].set_visible(False)
    inch = 0.895 * _WIDTH_IN / seconds
    for number, (_, states) in enumerate(rows):
        for one in segments_of(states, len(timeline.types)):
            begin = max(timeline.seconds(0) + one.start * tick_s, first_s)
            width = min(timeline.seconds(0) + one.end * tick_s, first_s + seconds) - begin
            if width > 0:
                _draw_segment(axes, timeline.types[one.state], one, (begin, number + 0.08, width), inch)


def _draw_segment(axes: "Axes", name: str, one: Span, place: tuple[float, float, float], inch: float) -> None:
    from matplotlib.patches import Rectangle

    x, y, width = place
    colour = on_paper(_COLOURS[one.state % len(_COLOURS)])
    axes.add_patch(Rectangle((x, y), width, 0.84, facecolor=colour, edgecolor=on_paper("paper"), linewidth=0.6))
    if len(name) * _LETTER * _POINTS / 72 < width * inch:
        axes.text(x + width / 2, y + 0.42, name, color=on_paper("paper"), ha="center", va="center")

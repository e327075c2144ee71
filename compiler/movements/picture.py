"""Draw timelines: the segments found, with the true ones above them, a few seconds per line."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..pictures import on_paper, painting, rendered
from .scores import Span, segments_of
from .streams import MovementError
from .timeline import Timeline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WIDTH_IN, _LINE_IN, _MOST_LINES = 11.0, 0.62, 60
# With this many seconds per line and this font size, the name of a type fits into most grasps.
_SECONDS, _POINTS = 10.0, 7.0
# The largest width of a letter, in units of the font size.
_LETTER = 0.75
# Colours of types, far enough from one another to tell neighbours apart; the name says which it is.
_COLOURS = ("switches", "joints", "both", "baseline-1", "baseline-2", "baseline-3", "link", "miss", "hit")


def draw(timelines: Sequence[Timeline], kind: str) -> bytes:
    """Return the picture as the bytes of a "png" or "svg"; the same timelines give the same bytes.

    Raises MovementError where there is nothing to draw, PictureError if matplotlib is not installed.
    """
    length = [len(timeline.states) * timeline.tick_us / 1e6 for timeline in timelines]
    if not any(length):
        raise MovementError("the recordings have no frames to draw")
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

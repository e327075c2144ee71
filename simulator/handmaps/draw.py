"""The glove as a picture: hands side by side, palm up, the sides of the digits unfolded, every switch a circle.

Shades run from light to dark, perceptually uniform and monotonic in lightness, so that they work in grey and for the
colour-blind. In an SVG each circle has a tooltip.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.hand import HandShape, MapError
from thenar.compiler.pictures import on_paper, painting, rendered
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.summary import contacts as touches

from .handmap import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Dot:
    """A drawn switch: hollow, or of a shade from 0 to 1; `mark` is its text, `hint` its tooltip.

    absent: not in the set, drawn as a point.
    """

    hint: str
    shade: float | None = None
    mark: str = ""
    absent: bool = False


@dataclass(frozen=True, slots=True)
class Panel:
    """One hand: its title, a line under it, and a Dot for every switch of the map."""

    title: str
    note: str
    dots: tuple[Dot, ...]


@dataclass(frozen=True, slots=True)
class Picture:
    """The hand, once per panel side by side, the meanings of full and hollow dots ("" for none), and the value at shade
    1 of the colour bar.

    full: the meaning of a full dot if there is no colour bar, else the bar's title.
    """

    hand: HandShape
    panels: tuple[Panel, ...]
    full: str
    hollow: str
    bar_top: float | None = None


# The drawn event: as a word, for one switch, and for several.
_CLOSED = ("closed", "the switch closed", "switches closed")
_PRESSED = ("pressed", "the taxel was pressed", "taxels pressed")
_EITHER = ("touched", "the switch closed or the taxel was pressed", "switches and taxels touched")


def all_switches(glove: HandShape) -> Picture:
    """Return the glove with all its switches."""
    dots = tuple(Dot(f"{n} {name}") for n, name in enumerate(glove.names))
    return Picture(
        glove,
        (Panel(glove.glove, _counts(glove, np.arange(len(dots)), "switches"), dots),),
        "",
        "switch",
    )


def contacts(glove: HandShape, grasp_set: GraspSet, per_grasp: bool) -> Picture:
    """Return a picture of the frequency of closed switches and pressed taxels (above Otsu's threshold of all readings),
    over all rows in which something is held or, one hand each, in each grasp type that has rows.

    All hands share one scale, up to the largest share. Raises MapError if the set has no rows, no switches or taxels,
    or one that the glove does not have.
    """
    if not grasp_set.element_names:
        raise MapError("the set has no switches to draw: it holds joints only")
    grasp_set = grasp_set.without_none()
    if not len(grasp_set):
        raise MapError("a set without rows has no contacts to draw")
    numbers = glove.numbers_of(grasp_set.element_names)
    groups = [np.arange(len(grasp_set))]
    titles = ["all grasps"]
    if per_grasp:
        present = np.unique(grasp_set.labels)
        groups = [np.flatnonzero(grasp_set.labels == label) for label in present]
        titles = [_type_title(grasp_set, label) for label in present]
    touched, what = touches(grasp_set), _CLOSED if grasp_set.switch_names else _PRESSED
    word, full, plural = _EITHER if grasp_set.switch_names and grasp_set.taxel_columns else what
    closed = [touched[rows].sum(axis=0) for rows in groups]
    top = max(float((count / len(rows)).max()) for count, rows in zip(closed, groups, strict=True)) or 1.0
    panels = (
        _contact_panel(glove, title, numbers, count, len(rows), top, word, plural)
        for title, count, rows in zip(titles, closed, groups, strict=True)
    )
    return Picture(glove, tuple(panels), f"share of grasps in which {full}", f"never {word}", top)


def kept(glove: HandShape, placements: Sequence[tuple[str, Sequence[str]]]) -> Picture:
    """Return the glove once for each (title, names of switches in the order in which they were chosen).

    Raises MapError if a name is not a switch of the glove, or occurs twice in one placement.
    """
    panels = tuple(_kept_panel(glove, title, names) for title, names in placements)
    return Picture(glove, panels, "kept, in the order chosen", "left out")


def _contact_panel(
    glove: HandShape,
    title: str,
    numbers: NDArray[np.intp],
    closed: NDArray[np.intp],
    rows: int,
    top: float,
    word: str,
    plural: str,
) -> Panel:
    dots = [Dot(f"{name}: not in the set", absent=True) for name in glove.names]
    for number, count in zip(numbers.tolist(), closed.tolist(), strict=True):
        hint = f"{glove.names[number]}: {word} in {count} of {rows} grasps ({count / rows:.1%})"
        dots[number] = Dot(hint, count / rows / top if count else None)
    return Panel(title, f"{rows} grasps, {float(closed.sum()) / rows:.1f} {plural} on average", tuple(dots))


def _type_title(grasp_set: GraspSet, label: int) -> str:
    name, full = grasp_set.taxonomy.types[label], grasp_set.taxonomy.full_names[label]
    return name if name == full else f"{name}: {full}"


def _kept_panel(glove: HandShape, title: str, names: Sequence[str]) -> Panel:
    numbers = glove.numbers_of(names)
    twice = next((name for place, name in enumerate(names) if name in names[:place]), None)
    if twice is not None:
        raise MapError(f"{title}: switch {twice!r} is kept twice")
    dots = [Dot(f"{name}: left out") for name in glove.names]
    for place, (number, name) in reversed(list(enumerate(zip(numbers.tolist(), names, strict=True), 1))):
        # A taxel is marked by its first level.
        more = dots[number].hint.partition(": ")[2] if dots[number].shade is not None else ""
        level = name[len(glove.names[number]) :]
        hint = f"{glove.names[number]}: kept, number {place}{f' (counts {level})' * bool(level)}"
        dots[number] = Dot(hint + f", {more.removeprefix('kept, ')}" * bool(more), 1.0, str(place))
    return Panel(title, _counts(glove, numbers, f"of {len(dots)} kept"), tuple(dots))


def _counts(glove: HandShape, numbers: NDArray[np.intp], what: str) -> str:
    by_part = np.bincount(glove.parts[numbers], minlength=len(glove.part_names)).tolist()
    parts = [f"{part} {count}" for part, count in zip(glove.part_names, by_part, strict=True)]
    return f"{len(numbers)} {what}" + (f": {', '.join(parts)}" if len(parts) > 1 else "")


SKIN, SIDE, LINE, CREASE, INK = map(on_paper, ("skin", "side", "outline", "crease", "kept"))
_COLOURS, _LIGHTEST = "magma_r", 0.07  # a switch that closed at all is no longer white
_MARGIN_MM, _USUAL_MM = 3.0, 1.8  # around a hand; the radius of a dot whose edge is as thick as thin lines are
_LONGEST_TITLE = 40
_SPELT_OUT = 1.5  # points per mm of the map above which digits have full names


def bounds(glove: HandShape) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of a drawn hand, mm."""
    reach = np.array([glove.radius_mm, glove.radius_mm])
    points = np.concatenate([glove.outline, *glove.strips, glove.labels, glove.places - reach, glove.places + reach])
    (left, bottom), (right, top) = points.min(axis=0), points.max(axis=0)
    # The names of the digits extend beyond their positions.
    return left - 2 * _MARGIN_MM, right + 3 * _MARGIN_MM, bottom - _MARGIN_MM, top + 2 * _MARGIN_MM


def colour(dot: Dot, graded: bool) -> str:
    """Return the colour that fills a dot: white when hollow, of the scale when `graded`, else ink."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    if dot.shade is None:
        return "white"
    return to_hex(colormaps[_COLOURS](_LIGHTEST + (1.0 - _LIGHTEST) * dot.shade)) if graded else INK


def paint(axes: "Axes", glove: HandShape, panel: Panel, number: int, points: float, graded: bool) -> None:
    """Draw hand `number` of a page, at `points` (1/72 inch) per mm; dots' ids are dot-NUMBER-SWITCH."""
    left, right, bottom, top = bounds(glove)
    axes.set(xlim=(left, right), ylim=(bottom, top))
    axes.axis("off")
    _paint_skin(axes, glove, points)
    for switch, (dot, place) in enumerate(zip(panel.dots, glove.places, strict=True)):
        paint_dot(axes, dot, place, glove.radius_mm, points, graded, f"{number}-{switch}")
    title = panel.title if len(panel.title) <= _LONGEST_TITLE else f"{panel.title[: _LONGEST_TITLE - 1]}…"
    middle = (left + right) / 2
    axes.text(middle, top, panel.note, fontsize=min(8.0, 4.5 * points), color=LINE, ha="center", va="bottom")
    large = min(12.0, 6.8 * points)
    axes.annotate(
        title, (middle, top), (0, 1.2 * large), textcoords="offset points", fontsize=large, weight="bold", ha="center"
    )


def paint_dot(
    axes: "Axes", dot: Dot, place: Floats, radius: float, points: float, graded: bool, identity: str = ""
) -> None:
    """Draw one switch at `place` (2,); `radius` in units of the axes, of `points` each."""
    from matplotlib.patches import Circle

    x, y = place.tolist()
    circle = Circle((x, y), 0.25 * radius if dot.absent else radius, facecolor=colour(dot, graded), clip_on=False)
    circle.set(edgecolor=LINE, linewidth=0.16 * points * radius / _USUAL_MM, zorder=3)
    circle.set_gid(f"dot-{identity}" if identity else None)
    axes.add_patch(circle)
    if not dot.mark:
        return
    ink = "white" if dot.shade is not None else INK
    size = 2.0 * radius * points * (0.49 if len(dot.mark) > 2 else 0.71)
    text = axes.text(x, y, dot.mark, fontsize=size, color=ink, ha="center", va="center_baseline", zorder=4)
    text.set_gid(f"mark-{identity}" if identity else None)


def _paint_skin(axes: "Axes", glove: HandShape, points: float) -> None:
    thin = 0.16 * points
    axes.fill(*glove.outline.T, facecolor=SKIN, edgecolor=LINE, linewidth=2.4 * thin, joinstyle="round")
    for outline in glove.strips:
        axes.fill(*outline.T, facecolor=SIDE, edgecolor=LINE, linewidth=thin, joinstyle="round")
    for crease in glove.creases:
        axes.plot(*crease.T, color=CREASE, linewidth=2.0 * thin, solid_capstyle="round")
    for digit, (x, y) in zip(glove.part_names, glove.labels.tolist(), strict=False):
        name = digit if points >= _SPELT_OUT else digit[0].upper()
        size = min(9.0, max(5.0, 4.2 * points))
        axes.text(x, y, name, fontsize=size, color=LINE, ha="center", va="center")


_POINTS = 72.0  # of a printer, an inch
_KEY_INCHES, _TITLE_INCHES = 0.66, 0.42
_DOTS_AN_INCH = 160
_STEPS = 64  # of the colour bar
_DOT = re.compile(r'<g id="(?:dot|mark)-(\d+)-(\d+)">')


def draw(picture: Picture, kind: str) -> bytes:
    """Return `picture` as the bytes of a "png" or "svg"; the same picture gives the same bytes. Raises PictureError."""
    columns = next(count for count in range(1, 100) if count * count >= len(picture.panels))
    rows = -(-len(picture.panels) // columns)
    left, right, bottom, top = bounds(picture.hand)
    wide = {1: 8.5, 2: 5.4}.get(columns, max(2.6, 10.4 / columns))  # inches of one hand
    tall = wide * (top - bottom) / (right - left)
    width, height = columns * wide, rows * (tall + _TITLE_INCHES) + _KEY_INCHES
    with painting(font_size=8):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width, height), dpi=_DOTS_AN_INCH, facecolor="white")
        for number, panel in enumerate(picture.panels):
            row, column = divmod(number, columns)
            base = height - (row + 1) * (tall + _TITLE_INCHES)
            axes = figure.add_axes((column * wide / width, base / height, wide / width, tall / height))
            paint(axes, picture.hand, panel, number, wide * _POINTS / (right - left), picture.bar_top is not None)
        _draw_key(figure, picture)
        data = rendered(figure, kind)
    return _with_hints(data, picture) if kind == "svg" else data


def _draw_key(figure: "Figure", picture: Picture) -> None:
    """Draw the key of hollow and full dots, the strips and the colours, along the bottom."""
    width, height = figure.get_size_inches().tolist()
    axes = figure.add_axes((0, 0, 1, _KEY_INCHES / height))
    axes.set(xlim=(0, width), ylim=(0, _KEY_INCHES))
    axes.axis("off")
    graded = picture.bar_top is not None
    dots = [(Dot(""), picture.hollow)]
    if picture.full and not graded:
        dots.append((Dot("", 1.0, "7"), picture.full))
    if any(dot.absent for panel in picture.panels for dot in panel.dots):
        dots.append((Dot("", absent=True), "not in the set"))
    x, y = 0.35, 0.40
    for dot, words in dots:
        paint_dot(axes, dot, np.array([x, y]), 0.07, _POINTS, False)
        x = _say(axes, x + 0.14, y, words)
    if picture.hand.strips:
        axes.fill(
            [x, x + 0.34, x + 0.34, x], [y - 0.06, y - 0.06, y + 0.06, y + 0.06], facecolor=SIDE, edgecolor=LINE, lw=0.7
        )
        x = _say(axes, x + 0.42, y, "side of a digit, unfolded")
        axes.text(0.28, 0.13, "palm of the right hand", color=LINE, va="center")
    if picture.bar_top is not None:
        _draw_bar(figure, x, picture.full, picture.bar_top)


def _say(axes: "Axes", x: float, y: float, words: str) -> float:
    """Write `words` from `x` on and return the next free position."""
    axes.text(x, y, words, va="center")
    return x + 0.062 * len(words) + 0.3


def _draw_bar(figure: "Figure", x: float, title: str, top: float) -> None:
    width, height = figure.get_size_inches().tolist()
    bar = figure.add_axes((x / width, 0.34 / height, (width - 0.5 - x) / width, 0.14 / height))
    for step in range(_STEPS):
        shade = (step + 0.5) / _STEPS
        ends = (step / _STEPS * top, (step + 1) / _STEPS * top)
        bar.axvspan(*ends, facecolor=colour(Dot("", shade), True), edgecolor="none", antialiased=False)
    bar.set(xlim=(0, top), yticks=[])
    bar.xaxis.set_major_formatter(lambda share, _: f"{100 * share:.3g} %")
    bar.locator_params(axis="x", nbins=5)
    bar.tick_params(labelsize=7, length=2, pad=1.5)
    bar.set_title(title, fontsize=8, pad=2)


def _with_hints(svg: bytes, picture: Picture) -> bytes:
    def hinted(found: re.Match[str]) -> str:
        dot = picture.panels[int(found[1])].dots[int(found[2])]
        return f"{found[0]}<title>{escape(dot.hint)}</title>"

    return _DOT.sub(hinted, svg.decode()).encode()

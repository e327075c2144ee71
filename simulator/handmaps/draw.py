"""The glove as a picture: hands side by side, palm up, the sides of the digits unfolded, every switch a circle.

Shades run from light to dark, perceptually even and never back in lightness, so that they hold in grey and for the
colour-blind. In an SVG each circle says on hovering what it is.
"""

import re
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from thenar.compiler.pictures import painting, rendered

from .handpaint import LINE, SIDE, bounds, colour, paint, paint_dot
from .handpanels import Dot, Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_POINTS = 72.0  # of a printer, an inch
_KEY_INCHES, _TITLE_INCHES = 0.66, 0.42
_DOTS_AN_INCH = 160
_STEPS = 64  # of the colour bar
_DOT = re.compile(r'<g id="(?:dot|mark)-(\d+)-(\d+)">')


def draw(picture: Picture, kind: str) -> bytes:
    """Return `picture` as the bytes of a "png" or "svg"; the same picture gives the same bytes. Raises PictureError."""
    columns = next(count for count in range(1, 100) if count * count >= len(picture.panels))
    rows = -(-len(picture.panels) // columns)
    left, right, bottom, top = bounds()
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
            paint(axes, panel, number, wide * _POINTS / (right - left), picture.bar_top is not None)
        _draw_key(figure, picture)
        data = rendered(figure, kind)
    return _with_hints(data, picture) if kind == "svg" else data


def _draw_key(figure: "Figure", picture: Picture) -> None:
    """Draw what hollow and full dots, the strips and the colours mean, along the bottom."""
    width, height = figure.get_size_inches().tolist()
    axes = figure.add_axes((0, 0, 1, _KEY_INCHES / height))
    axes.set(xlim=(0, width), ylim=(0, _KEY_INCHES))
    axes.axis("off")
    graded = picture.bar_top is not None
    dots = [(Dot("", mark=picture.hollow_mark), picture.hollow)]
    if picture.full and not graded:
        dots.append((Dot("", 1.0, "7"), picture.full))
    if any(dot.absent for panel in picture.panels for dot in panel.dots):
        dots.append((Dot("", absent=True), "not in the set"))
    x, y = 0.35, 0.40
    for dot, words in dots:
        paint_dot(axes, dot, np.array([x, y]), 0.07, _POINTS, False)
        x = _say(axes, x + 0.14, y, words)
    axes.fill(
        [x, x + 0.34, x + 0.34, x], [y - 0.06, y - 0.06, y + 0.06, y + 0.06], facecolor=SIDE, edgecolor=LINE, lw=0.7
    )
    x = _say(axes, x + 0.42, y, "side of a digit, unfolded")
    axes.text(0.28, 0.13, "palm of the right hand", color=LINE, va="center")
    if picture.bar_top is not None:
        _draw_bar(figure, x, picture.full, picture.bar_top)


def _say(axes: "Axes", x: float, y: float, words: str) -> float:
    """Write `words` from `x` on and return where the next may begin."""
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

"""Common parts of pictures: one palette, also of pages; names that are not parsed as formulas, labels next to their
places, equal bytes, optional matplotlib.
"""

import io
import re
import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import chdir, contextmanager
from importlib import import_module
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from thenar.drivers.extras import missing
from thenar.runtime.errors import ThenarError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = ("png", "svg")
# Of a drawing that is this wide, letters are of 11 pixels where it is shown 400 pixels wide, as on a phone.
WIDTH, FONT = 5.6, 11.2  # inches, points
_SIZE = re.compile(rb'(<svg [^>]*?)width="[^"]*" height="[^"]*" ')
# Where a label is tried, relative to its place, and how far from it, in points.
_SIDES = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
_STEPS, _NEAR = (3.0, 7.0, 14.0, 22.0, 32.0, 44.0, 58.0, 74.0), 7.0
_WORTH = 15.0  # the distance in points that is as bad as a line that is crossed
_MARKER = 5.0  # points from the middle of a marker to its edge
_SHARES = tuple(np.linspace(0.3, 0.9, 7).tolist())

Label = tuple[float, float, str]
Box = tuple[float, float, float, float]

# The use of each colour, on light and on dark screens; files are light. Switches, joints and both have Okabe and Ito's
# colours, which the colour-blind can distinguish; baselines have other colours than inputs.
PALETTE: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        **{"paper": ("#ffffff", "#12161b"), "ink": ("#1b1f24", "#e7ebf0"), "soft": ("#57606a", "#a3adb8")},
        **{"line": ("#d0d7de", "#343c46"), "pale": ("#f5f7f9", "#1b2129"), "link": ("#0550ae", "#79b8ff")},
        **{"switches": ("#0072b2", "#6cb0ff"), "joints": ("#009e73", "#4cc38a"), "both": ("#d55e00", "#ff9d5c")},
        **{
            "baseline-1": ("#a86f00", "#e0b04c"),
            "baseline-2": ("#a3457c", "#ec9bc6"),
            "baseline-3": ("#6b6b6b", "#a9a9a9"),
        },
        **{"picked": ("#d1242f", "#ff6b74"), "hit": ("#1f5fa8", "#4b93dd"), "miss": ("#c2410c", "#e8743b")},
        **{"decision": ("#d3e0f2", "#24405f")},
        **{"skin": ("#f9f1e9", "#2a2622"), "side": ("#eee3d8", "#221f1c"), "outline": ("#57493e", "#b8a594")},
        **{"crease": ("#c9b09a", "#5e5146"), "kept": ("#14304f", "#cfe3ff"), "on-kept": ("#ffffff", "#10243d")},
    }
)


def on_paper(name: str) -> str:
    """Return a colour of PALETTE for files."""
    return PALETTE[name][0]


def colour_variables(names: Collection[str] = PALETTE) -> str:
    """Return colours of PALETTE as variables of a style sheet, for light screens and paper, and for dark screens."""
    light, dark = ("".join(f" --{name}: {PALETTE[name][side]};" for name in names) for side in (0, 1))
    return f":root {{{light} }}\n@media screen and (prefers-color-scheme: dark) {{ :root {{{dark} }} }}\n"


class PictureError(ThenarError, ValueError):
    """A picture cannot be drawn: no matplotlib, or a kind of file that is not among FORMATS."""


@contextmanager
def painting(font_size: float) -> Iterator[None]:
    """Set matplotlib up for drawing and rendering in this context. Raises PictureError if it is not installed."""
    mpl = _matplotlib()
    with mpl.rc_context(), warnings.catch_warnings():
        mpl.rcdefaults()
        mpl.rcParams.update(
            {
                "svg.hashsalt": "thenar",
                "font.size": font_size,
                "axes.spines.top": False,
                "axes.spines.right": False,
                "text.parse_math": False,  # a dollar in a name is a dollar
            }
        )
        # A letter that the font lacks is drawn as a box, which does not spoil the picture.
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font")
        yield


def _matplotlib() -> ModuleType:
    """Import matplotlib without a matplotlibrc of the current folder or the user's: it could run LaTeX.

    If it is already imported, as in a notebook, it has read theirs; pictures use its defaults.
    """
    found = find_spec("matplotlib")
    if found is None or found.origin is None:
        raise PictureError(f"drawing: {missing('matplotlib')}")
    # On import it reads the file of that name in the current folder first: point that at its bundled one.
    with chdir(Path(found.origin).with_name("mpl-data")):
        return import_module("matplotlib")


def rendered(figure: "Figure", kind: str) -> bytes:
    """Return `figure` as the bytes of a "png" or "svg", without date or version. Raises PictureError."""
    if kind not in FORMATS:
        raise PictureError(f"a picture ends in .png or .svg, not in .{kind}")
    file = io.BytesIO()
    figure.savefig(file, format=kind, metadata={"Date": None} if kind == "svg" else {"Software": None})
    # A drawing without a size fills the page or the window that shows it.
    return _SIZE.sub(rb"\1", file.getvalue(), count=1) if kind == "svg" else file.getvalue()


def write_beside(axes: "Axes", labels: Iterable[Label], taken: Iterable[Box], lines: Iterable[Box] = ()) -> None:
    """Write the text of each label next to its place, where it covers nothing; the first labels have the first choice.

    A text that is far from its place is joined to it by a line. One that finds no room within the axes is left out.

    Parameters
    ----------
    axes : Axes
        The finished axes: later changes of their limits move the places.
    labels : iterable of (x, y, text)
        In data coordinates.
    taken, lines : iterable of (left, bottom, right, top)
        What must not, and what should not, be covered, such as markers and intervals, in pixels of the figure.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = axes.get_figure(root=True)
    assert figure is not None
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    room, boxes, thin, unit = axes.get_window_extent(renderer).extents, list(taken), list(lines), figure.dpi / 72
    style: dict[str, Any] = {"ha": "center", "va": "center", "color": on_paper("ink"), "zorder": 6}
    style["bbox"] = {"facecolor": on_paper("paper"), "edgecolor": "none", "alpha": 0.8, "pad": 0.5}
    for x, y, words in labels:
        text = axes.text(0, 0, words)
        size = text.get_window_extent(renderer)
        text.remove()
        place, half = axes.transData.transform((x, y)), (size.width / 2 + 2 * unit, size.height / 2)
        found: list[tuple[float, int, list[Box], list[float], bool]] = []
        for far, side in product(_STEPS, _SIDES):
            ahead, joined = [one * (reach + far * unit) for one, reach in zip(side, half, strict=True)], far > _NEAR
            (left, bottom), (right, top) = place + ahead - half, place + ahead + half
            # Of the line, what lies between marker and text.
            joint = [tuple((place + share * np.array(ahead)).tolist() * 2) for share in _SHARES if joined]
            covered = [(left, bottom, right, top), *joint]
            inside = room[0] < left and room[1] < bottom and right < room[2] and top < room[3]
            if inside and not any(_meet(one, other) for one in covered for other in boxes):
                crossed = sum(_meet(covered[0], other) for other in thin)
                found.append((crossed + far / _WORTH, len(found), covered, ahead, joined))
        if found:
            _, _, covered, ahead, joined = min(found)
            boxes += covered
            arrow = {"arrowstyle": "-", "color": on_paper("soft"), "lw": 0.6} if joined else None
            offset = ahead[0] / unit, ahead[1] / unit
            axes.annotate(words, (x, y), offset, textcoords="offset points", arrowprops=arrow, **style)


def around(axes: "Axes", x: float, y: float) -> Box:
    """Return the box of the marker at a place in data coordinates, in pixels of the figure."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    (right, up), reach = axes.transData.transform((x, y)).tolist(), _MARKER * figure.dpi / 72
    return right - reach, up - reach, right + reach, up + reach


def _meet(one: Box, other: Box) -> bool:
    return one[0] <= other[2] and other[0] <= one[2] and one[1] <= other[3] and other[1] <= one[3]

"""What all pictures share: names are no formulas, equal pictures are equal bytes, and matplotlib may be missing."""

import io
import warnings
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from thenar.runtime.errors import ThenarError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "svg")


class PictureError(ThenarError, ValueError):
    """A picture cannot be drawn: no matplotlib, or a kind of file that is not among FORMATS."""


@contextmanager
def painting(font_size: float, *, letters: bool = False) -> Iterator[None]:
    """Set matplotlib up for what is made and rendered inside. Raises PictureError if it is not installed.

    With `letters`, text in SVG is text, in the font that the reader has, and not outlines.
    """
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
        if letters:
            mpl.rcParams.update({"svg.fonttype": "none", "font.sans-serif": ["DejaVu Sans", "Verdana", "sans-serif"]})
        # A letter that the font lacks is drawn as a box; the rest of the picture is still worth having.
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font")
        yield


def _matplotlib() -> ModuleType:
    """Import matplotlib without a matplotlibrc of the current folder or the user's: it could run LaTeX.

    Whoever has imported it before, such as a notebook, has read theirs already; pictures are drawn by its defaults.
    """
    found = find_spec("matplotlib")
    if found is None or found.origin is None:
        raise PictureError("drawing needs matplotlib: pip install 'thenar[compiler]'")
    # It reads the file of that name in the current folder first, while it is imported: here that is its own.
    with chdir(Path(found.origin).with_name("mpl-data")):
        return import_module("matplotlib")


def rendered(figure: "Figure", kind: str) -> bytes:
    """Return `figure` as the bytes of a "png" or "svg", without date or version. Raises PictureError."""
    if kind not in FORMATS:
        raise PictureError(f"a picture ends in .png or .svg, not in .{kind}")
    file = io.BytesIO()
    figure.savefig(file, format=kind, metadata={"Date": None} if kind == "svg" else {"Software": None})
    return file.getvalue()

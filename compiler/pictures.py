"""What all pictures share: names are no formulas, equal pictures are equal bytes, and matplotlib may be missing."""

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from thenar.runtime.errors import ThenarError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "svg")


class PictureError(ThenarError, ValueError):
    """A picture cannot be drawn: no matplotlib, or a kind of file that is not among FORMATS."""


@contextmanager
def painting(font_size: float) -> Iterator[None]:
    """Set matplotlib up for what is made and rendered inside. Raises PictureError if it is not installed."""
    try:
        import matplotlib as mpl
    except ImportError as reason:
        raise PictureError("drawing needs matplotlib: pip install 'thenar[compiler]'") from reason
    with (
        mpl.rc_context(
            {
                "svg.hashsalt": "thenar",
                "font.size": font_size,
                "axes.spines.top": False,
                "axes.spines.right": False,
                "text.parse_math": False,  # a dollar in a name is a dollar
            }
        ),
        warnings.catch_warnings(),
    ):
        # A letter that the font lacks is drawn as a box; the rest of the picture is still worth having.
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font")
        yield


def rendered(figure: "Figure", kind: str) -> bytes:
    """Return `figure` as the bytes of a "png" or "svg", without date or version. Raises PictureError."""
    if kind not in FORMATS:
        raise PictureError(f"a picture ends in .png or .svg, not in .{kind}")
    file = io.BytesIO()
    figure.savefig(file, format=kind, metadata={"Date": None} if kind == "svg" else {"Software": None})
    return file.getvalue()

"""Makes drawings fit light and dark pages, in place: python docs/figures/adapt.py docs/figures/*.svg

Files that thenar draws have the light colours of `thenar.compiler.pictures.PALETTE`. Each becomes a variable, which one
style sheet in the file sets for both schemes. A second run changes nothing.
"""

import re
import sys
from pathlib import Path

from thenar.compiler.pictures import PALETTE, colour_variables

# matplotlib writes no fill for black, so what has none gets the ink.
_REST = "svg { fill: var(--ink) }\n"
_SHEET = re.compile(r'\n<style id="schemes">.*?</style>', re.DOTALL)
# Of two names with the same light colour, the first counts. Black is matplotlib's default ink.
_NAMES = {light: name for name, (light, _) in reversed(PALETTE.items())} | {"#000000": "ink"}


def adapted(drawing: str) -> str:
    """Return an SVG drawing with variables in place of the light colours, and with the sheet that sets them."""
    body = re.sub("|".join(_NAMES), lambda found: f"var(--{_NAMES[found[0]]})", _SHEET.sub("", drawing))
    used = {"ink", *re.findall(r"var\(--([\w-]+)\)", body)}
    sheet = _REST + colour_variables([name for name in PALETTE if name in used])
    return re.sub(r"<svg\b[^>]*>", rf'\g<0>\n<style id="schemes">\n{sheet}</style>', body, count=1)


def main() -> None:
    """Adapt the files that are named on the command line."""
    for path in map(Path, sys.argv[1:]):
        path.write_text(adapted(path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()

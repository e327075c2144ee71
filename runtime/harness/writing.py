"""Write a Harness as the text of a `glove.toml`."""

import re

import msgspec
import tomli_w

from .wiring import Harness

# Two numbers; a name is in quotes.
_RANGE = re.compile(r"\[\n    ([-+.e\d]+),\n    ([-+.e\d]+),\n\]")
# Of a chip; a short one is an inline table.
_ADDRESS = re.compile(r'^(    \{ kind = "[^"]*", )?address = (\d+)', re.MULTILINE)


def harness_to_toml(harness: Harness) -> str:
    """Return the text of a file that `load_harness` reads as `harness`; addresses of chips are in hex."""
    # tomli_w has no hex; it writes every key on a separate line and no line break inside a text.
    text = tomli_w.dumps(msgspec.to_builtins(harness))
    text = _ADDRESS.sub(lambda found: f"{found[1] or ''}address = 0x{int(found[2]):02X}", text)
    return _RANGE.sub(lambda found: f"[{float(found[1]):.12g}, {float(found[2]):.12g}]", text)

"""A Harness as the text of a `glove.toml`."""

import re

import msgspec
import tomli_w

from .wiring import Harness

_ADDRESS = re.compile(r"^address = (\d+)$", re.MULTILINE)


def harness_to_toml(harness: Harness) -> str:
    """Return the text of a file that `load_harness` reads as `harness`; addresses are written in hex."""
    # tomli_w knows no hex; it writes every key on a line of its own and no line break inside a text.
    return _ADDRESS.sub(lambda found: f"address = 0x{int(found[1]):02X}", tomli_w.dumps(msgspec.to_builtins(harness)))

"""Write a Harness as the text of a `glove.toml`, or a measured record time into an existing file."""

import re
from pathlib import Path

import msgspec
import tomli_w

from ..errors import HarnessError
from ..files import write_atomically
from ..toml_source import read_source
from .loading import load_harness, parse_harness
from .wiring import Harness

_GLOVE = re.compile(r"(?ms)^\[cyberglove\][^\n]*\n(?:(?!^\[).)*")
_RECORD_US = re.compile(r"(?m)^record_us[ \t]*=[^\n]*\n?")
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


def write_record_us(path: Path, us: int) -> None:
    """Write the record time of a CyberGlove into its `glove.toml`; the rest of the file stays as it is.

    Raises HarnessError if the table of the CyberGlove is not spelled so that one of its lines can be changed.
    """
    text = read_source(path, HarnessError).text

    def measured(table: re.Match[str]) -> str:
        head, _, rest = _RECORD_US.sub("", table[0]).partition("\n")
        return f"{head}\nrecord_us = {us}\n{rest}"

    changed, harness = _GLOVE.sub(measured, text, count=1), load_harness(path)
    wanted = None
    if harness.cyberglove is not None:
        wanted = msgspec.structs.replace(harness.cyberglove, record_us=us, calibration=None)
    found = parse_harness(changed, path.name).cyberglove
    if found is None or msgspec.structs.replace(found, calibration=None) != wanted:
        raise HarnessError(f"{path} has no table [cyberglove] on separate lines: write `record_us = {us}` there")
    write_atomically(path, changed.encode())

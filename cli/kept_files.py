"""Files that say which switches are kept: a build, a placement, or a list of names."""

from pathlib import Path

import msgspec

from thenar.drivers.errors import ThenarError
from thenar.runtime.build import load_manifest
from thenar.runtime.files import read_file
from thenar.runtime.names import fault, shortened
from thenar.runtime.nesting import check_json

_LARGEST = 4_000_000  # bytes; a placement of the largest set has fewer
_WANTED = "take a build's folder, the file of `thenar place -o`, or a text of one name a line"


class KeptError(ThenarError, ValueError):
    """A file does not say which switches are kept."""


class _Chosen(msgspec.Struct, frozen=True):
    name: str


class _Placement(msgspec.Struct, frozen=True):
    """What of a placement, or of a build's description, is asked for here."""

    switches: tuple[_Chosen, ...]


def kept_names(path: Path) -> tuple[str, ...]:
    """Return the names of the kept switches, in the order in which they were chosen.

    path is a build's folder, a JSON file (what `thenar place -o` writes, or an array of names), or a text of one name a
    line. Raises KeptError if it is none of these or names no switch, BuildError if it is a damaged build.
    """
    names = _of_build(path) if path.is_dir() else _of_text(_text(path), path)
    for name in names:
        if reason := fault(name):
            raise KeptError(f"{path}: switch {shortened(repr(name))} {reason}")
    if not names:
        raise KeptError(f"{path} keeps no switches: there is nothing to draw")
    return names


def _of_build(folder: Path) -> tuple[str, ...]:
    return tuple(switch.name for switch in load_manifest(folder).switches)


def _text(path: Path) -> str:
    try:
        return read_file(path, _LARGEST, KeptError).decode()
    except UnicodeDecodeError:
        raise KeptError(f"{path} is no text: {_WANTED}") from None


def _of_text(text: str, path: Path) -> tuple[str, ...]:
    if text.lstrip()[:1] not in ("{", "["):
        return tuple(filter(None, map(str.strip, text.splitlines())))
    try:
        check_json(text.encode())
        found = msgspec.json.decode(text, type=_Placement | tuple[str, ...])
    except ValueError as reason:
        raise KeptError(f"{path} is no list of switches ({shortened(str(reason))}): {_WANTED}") from None
    return tuple(chosen.name for chosen in found.switches) if isinstance(found, _Placement) else found

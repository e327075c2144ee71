"""The names of kept switches, by a build, a placement or a list."""

from pathlib import Path
from typing import Any

import msgspec

from thenar.compiler.samples import TrainingError
from thenar.runtime.build import load_manifest
from thenar.runtime.files import read_file
from thenar.runtime.names import fault, shortened

_LARGEST_LIST = 4_000_000  # bytes; a placement of the largest set has fewer
_WANTED = "name a build folder, a file of `thenar place -o`, or a text file with one name per line"


def kept_names(path: Path) -> tuple[str, ...]:
    """Return the names of the kept switches, in the order in which they were chosen.

    path is a build's folder, a JSON file (a placement's document, or an array of names), or a text file with one name
    per line. Raises TrainingError if it is none of these or names no switch, BuildError if it is a damaged build.
    """
    names = tuple(kept.name for kept in load_manifest(path).switches) if path.is_dir() else _of_file(path)
    for name in names:
        if reason := fault(name):
            raise TrainingError(f"{path}: switch {shortened(repr(name))} {reason}")
    if not names:
        raise TrainingError(f"{path} keeps no switches: there is nothing to draw")
    return names


def _of_file(path: Path) -> tuple[str, ...]:
    try:
        text = read_file(path, _LARGEST_LIST, TrainingError).decode()
    except UnicodeDecodeError:
        raise TrainingError(f"{path} is not a text file: {_WANTED}") from None
    if text.lstrip()[:1] not in ("{", "["):
        return tuple(filter(None, map(str.strip, text.splitlines())))
    try:
        found = msgspec.json.decode(text)
        if isinstance(found, dict):
            # Of chosen sensors, joints have no place on the hand.
            sensors = msgspec.convert(found.get("switches", found.get("chosen")), list[dict[str, Any]])
            found = [sensor.get("name") for sensor in sensors if sensor.get("kind") != "joint"]
        return msgspec.convert(found, tuple[str, ...])
    except (ValueError, RecursionError) as reason:
        why = shortened(str(reason))
        raise TrainingError(f"{path} is not a list of switches ({why}): {_WANTED}") from None

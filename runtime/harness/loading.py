"""From `glove.toml` to a Harness; errors name file, line and key, and say what to do."""

from pathlib import Path

from msgspec.structs import replace

from ..errors import HarnessError
from ..names import sound_name
from ..toml_source import TomlText, read_source
from ..toml_struct import convert
from .checks import faults
from .wiring import Harness


def load_harness(path: str | Path) -> Harness:
    """Return the harness in a TOML file; a missing name is the file's, or "glove" if that is not a valid name.

    The paths of calibrations are returned as absolute. Raises HarnessError with file, line and key.
    """
    file = Path(path)
    return _calibrated(_harness_of(read_source(file, HarnessError), file.stem), file.parent)


def parse_harness(text: str, name: str) -> Harness:
    """Return the harness described by `text`, whose name in messages is `name`; calibration paths stay as written.

    Raises HarnessError as `load_harness` does.
    """
    return _harness_of(TomlText(name, text, HarnessError), name)


def _harness_of(source: TomlText, name: str) -> Harness:
    harness = convert(source, (), {"name": sound_name(name, "glove")} | source.tables(), Harness)
    for place, reason in faults(harness):
        raise source.error(place, reason)
    return harness


def _calibrated(harness: Harness, folder: Path) -> Harness:
    """Return the harness with the paths of its calibrations resolved from `folder`."""
    glove, taxels = harness.cyberglove, harness.taxel_settings
    streams = tuple(
        replace(stream, calibration=str(folder.resolve() / stream.calibration)) if stream.calibration else stream
        for stream in harness.streams
    )
    harness = replace(harness, streams=streams)
    if glove is not None and glove.calibration is not None:
        harness = replace(harness, cyberglove=replace(glove, calibration=str(folder.resolve() / glove.calibration)))
    if taxels.calibration is not None:
        taxels = replace(taxels, calibration=str(folder.resolve() / taxels.calibration))
        harness = replace(harness, taxel_settings=taxels)
    return harness

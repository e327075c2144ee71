"""A CyberGlove's calibration from its file, which `thenar calibrate` writes; errors name file, line and key."""

from pathlib import Path

from thenar.drivers.calibration import GloveCalibration
from thenar.drivers.errors import SettingError

from .toml_source import Source, read_source
from .toml_struct import convert


def load_calibration(path: Path) -> GloveCalibration:
    """Return the calibration in a file. Raises SettingError with file, line and key."""
    return _calibration_of(read_source(path, SettingError))


def parse_calibration(text: str, name: str) -> GloveCalibration:
    """Return the calibration that `text`, which messages call `name`, is. Raises SettingError likewise."""
    return _calibration_of(Source(name, text, SettingError))


def _calibration_of(source: Source) -> GloveCalibration:
    return convert(source, (), source.tables(), GloveCalibration)

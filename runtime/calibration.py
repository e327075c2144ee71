"""A CyberGlove's calibration from its file, which `thenar calibrate` writes; errors name file, line and key."""

from pathlib import Path

from thenar.drivers.calibration import GloveCalibration
from thenar.drivers.errors import SettingError

from .toml_source import read_source
from .toml_struct import convert


def load_calibration(path: Path) -> GloveCalibration:
    """Return the calibration in a file. Raises SettingError with file, line and key."""
    source = read_source(path, SettingError)
    return convert(source, (), source.tables(), GloveCalibration)

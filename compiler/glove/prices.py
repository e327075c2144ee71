"""Prices of sensors: a TOML file with the parts to buy, and the sensors that each is for.

[[part]]
name = "flex sensor, 2.2 inch"
number = "FS-L-055-253-ST"
price = 11.50
sensors = ["flex_*"]
"""

from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated

from msgspec import Meta, Struct

from thenar.drivers.errors import SettingError
from thenar.runtime.toml_source import read_source
from thenar.runtime.toml_struct import convert


class Part(Struct, frozen=True, forbid_unknown_fields=True):
    """A part to buy, its price, the names of the sensors that it is for, where * stands for any letters, and the number
    by which it is ordered.
    """

    name: str
    price: Annotated[float, Meta(ge=0.0, le=1e9)]
    sensors: tuple[str, ...]
    number: str = ""


class PriceList(Struct, frozen=True, forbid_unknown_fields=True):
    """The content of a price list."""

    part: tuple[Part, ...]


def load_prices(path: Path, names: Sequence[str]) -> dict[str, Part]:
    """Return the part for each of the sensors `names`: the first in the file that is for it.

    Raises SettingError, with the line, for a file that is no price list, and for a sensor without a part.
    """
    source = read_source(path, SettingError)
    parts = convert(source, (), source.tables(), PriceList).part
    found = {
        name: next((part for part in parts if any(fnmatchcase(name, each) for each in part.sensors)), None)
        for name in names
    }
    if lost := [name for name, part in found.items() if part is None]:
        raise SettingError(f"{path.name} has no part for {lost[0]!r}: add the name to the sensors of one")
    return {name: part for name, part in found.items() if part is not None}

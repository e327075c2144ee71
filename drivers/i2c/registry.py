"""Which chips there are, by the names that glove.toml calls them by."""

from collections.abc import Mapping
from types import MappingProxyType

from .chip import Chip
from .mcp23008 import Mcp23008
from .mcp23017 import Mcp23017
from .pca9555 import Pca9555, Tca9555
from .pcf8574 import Pcf8574, Pcf8574a
from .pcf8575 import Pcf8575
from .tca6424a import Tca6424a

CHIPS: Mapping[str, type[Chip]] = MappingProxyType(
    {chip.kind: chip for chip in (Mcp23017, Mcp23008, Pcf8575, Pcf8574, Pcf8574a, Pca9555, Tca9555, Tca6424a)}
)

"""Which chips can be emulated, by the names that glove.toml calls them by."""

from .i2c_device import Device
from .i2c_mcp230xx import Mcp23008, Mcp23017
from .i2c_pca95xx import Pca9555, Tca6424a
from .i2c_pcf857x import Pcf8574, Pcf8575

MODELS: dict[str, type[Mcp23008 | Mcp23017 | Pcf8574 | Pcf8575 | Pca9555 | Tca6424a]] = {
    "mcp23017": Mcp23017,
    "mcp23008": Mcp23008,
    "pcf8574": Pcf8574,
    "pcf8574a": Pcf8574,
    "pcf8575": Pcf8575,
    "pca9555": Pca9555,
    "tca9555": Pca9555,
    "tca6424a": Tca6424a,
}


def model(kind: str) -> Device:
    """Return a chip of this kind as after power-on, all pins high."""
    return MODELS[kind]()

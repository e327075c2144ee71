"""The live side: a build folder in, grasp types out. Imports with the base dependencies only."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .build import Build, Recognition
    from .errors import BuildError, FormatError, FrameError, ThenarError
    from .glove import Glove

# Names are imported on first use: devices take as long to import as everything else, and --help needs none of them.
_HOMES = {
    "Build": ".build",
    "BuildError": ".errors",
    "FrameError": ".errors",
    "Glove": ".glove",
    "Recognition": ".build",
    "FormatError": ".errors",
    "ThenarError": ".errors",
}

__all__ = ["Build", "BuildError", "FormatError", "FrameError", "Glove", "Recognition", "ThenarError"]


def __getattr__(name: str) -> object:
    if name == "__version__":
        return import_module("importlib.metadata").version("thenar")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name], __name__), name)


def __dir__() -> list[str]:
    return __all__

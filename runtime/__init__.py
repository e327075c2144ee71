"""The live side: a build folder in, grasp types out. Imports with the base dependencies alone."""

from importlib import import_module
from typing import TYPE_CHECKING

from .errors import BuildError, FrameError, SealError, ThenarError

if TYPE_CHECKING:
    from .build import Build, Recognition
    from .glove import Glove

__all__ = ["Build", "BuildError", "FrameError", "Glove", "Recognition", "SealError", "ThenarError"]

# Numpy and the devices take longer to import than all the rest, and a part of the runtime may need neither.
_LATER = {"Build": ".build", "Recognition": ".build", "Glove": ".glove"}


def __getattr__(name: str) -> object:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_LATER[name], __name__), name)


def __dir__() -> list[str]:
    return __all__

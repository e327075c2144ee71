"""The live side: a build folder in, grasp types out. Imports with the base dependencies alone."""

from typing import TYPE_CHECKING

from .build import Build, Recognition
from .errors import BuildError, FrameError, SealError, ThenarError

if TYPE_CHECKING:
    from .glove import Glove

__all__ = ["Build", "BuildError", "FrameError", "Glove", "Recognition", "SealError", "ThenarError"]


def __getattr__(name: str) -> object:
    # Its devices take as long to import as all the rest, and a frame by itself needs none.
    if name == "Glove":
        from .glove import Glove

        return Glove
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__

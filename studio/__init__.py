"""Pages of a project, from its first trial to a recogniser; they train, so they need the compiler.

`open_studio` serves them. The live page and the server are in runtime/web. A collection is led without the compiler:
every name is imported on first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .opening import open_studio
    from .project import Project
    from .studio import Studio

_HOMES = {"Project": ".project", "Studio": ".studio", "open_studio": ".opening"}

__all__ = ["Project", "Studio", "open_studio"]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name], __name__), name)

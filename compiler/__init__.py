"""The offline compiler: recordings in, a build folder out.

The five names below are loaded when first used, so that `thenar.compiler.recordings` stays light.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .artifact.compile import compile_build
    from .boosting.classifier import LogitBoostClassifier
    from .frontier.find import find_frontier
    from .placement.id3 import grow_id3
    from .recordings.graspset import GraspSet

__all__ = ["GraspSet", "LogitBoostClassifier", "compile_build", "find_frontier", "grow_id3"]

_HOMES = {
    "GraspSet": ".recordings.graspset",
    "LogitBoostClassifier": ".boosting.classifier",
    "compile_build": ".artifact.compile",
    "find_frontier": ".frontier.find",
    "grow_id3": ".placement.id3",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name], __name__), name)

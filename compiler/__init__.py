"""The offline compiler: recordings in, a build folder out.

Every name below is loaded when it is first used, so that `thenar.compiler.recordings` stays light.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .artifact.compile import compile_build
    from .artifact.documents import BuildReport, Documents
    from .artifact.errors import CompileError
    from .artifact.estimator import Build, compile  # noqa: A004
    from .artifact.verify import Verification, verify
    from .boosting.boost import BoostingError
    from .boosting.classifier import LogitBoostClassifier
    from .evaluation.study import Study, evaluate
    from .placement.id3 import grow_id3
    from .placement.methods.base import METHODS
    from .recordings.graspset import GraspSet, Joint
    from .samples import Samples
    from .tables.collapse import ScoreTables
    from .trainers.base import TRAINERS, Setting, Trainer

_HOMES = {
    ".artifact.compile": ("compile_build",),
    ".artifact.documents": ("BuildReport", "Documents"),
    ".artifact.errors": ("CompileError",),
    ".artifact.estimator": ("Build", "compile"),
    ".artifact.verify": ("Verification", "verify"),
    ".boosting.boost": ("BoostingError",),
    ".boosting.classifier": ("LogitBoostClassifier",),
    ".evaluation.study": ("Study", "evaluate"),
    ".placement.id3": ("grow_id3",),
    ".placement.methods.base": ("METHODS",),
    ".recordings.graspset": ("GraspSet", "Joint"),
    ".samples": ("Samples",),
    ".tables.collapse": ("ScoreTables",),
    ".trainers.base": ("TRAINERS", "Setting", "Trainer"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "METHODS",
    "TRAINERS",
    "BoostingError",
    "Build",
    "BuildReport",
    "CompileError",
    "Documents",
    "GraspSet",
    "Joint",
    "LogitBoostClassifier",
    "Samples",
    "ScoreTables",
    "Setting",
    "Study",
    "Trainer",
    "Verification",
    "compile",
    "compile_build",
    "evaluate",
    "grow_id3",
    "verify",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME_OF[name], __name__), name)


def __dir__() -> list[str]:
    return __all__

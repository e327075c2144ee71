"""The offline compiler: recordings in, a build folder out.

Every name below is loaded when it is first used, so that `thenar.compiler.recordings` stays light.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from thenar.drivers.extras import optional

if TYPE_CHECKING:
    from thenar.drivers.errors import ThenarError
    from thenar.runtime.build import Build
    from thenar.runtime.model.tables import ScoreTables
    from thenar.runtime.model.terms.base import Term
    from thenar.runtime.model.terms.bins import Bins
    from thenar.runtime.model.terms.bit import Bit
    from thenar.runtime.model.terms.grid import Grid
    from thenar.runtime.model.terms.line import Line
    from thenar.runtime.recipe import Recipe

    from .artifact import CompileError
    from .artifact.adapting import AdaptedBuild, adapt
    from .artifact.comparing import BuildComparison, compare_builds
    from .artifact.compile import compile_build
    from .artifact.documents import BuildReport, Documents
    from .artifact.exporting import export_c
    from .artifact.verify import FaultCheck, Verification, verify, verify_faults
    from .classifiers import LogitBoostClassifier
    from .evaluation.folds import EvaluationError
    from .evaluation.study import Study, StudyDesign, evaluate
    from .firmware.targets import TARGETS
    from .frontier.find import find_frontier
    from .frontier.points import Frontier
    from .frontier.search import Search
    from .placement.methods.base import METHODS
    from .placement.placement import Placement, place
    from .placement.tree import grow_id3
    from .recordings.columns import ColumnRoles
    from .recordings.export import from_dataframe, to_dataframe
    from .recordings.graspset import GraspSet, Joint
    from .recordings.merging import merge, split
    from .samples import Samples, TrainingError
    from .trainers.base import TRAINERS, Setting, Trainer

_HOMES = {
    "thenar.drivers.errors": ("ThenarError",),
    "thenar.runtime.build": ("Build",),
    "thenar.runtime.model.tables": ("ScoreTables",),
    "thenar.runtime.model.terms.base": ("Term",),
    "thenar.runtime.model.terms.bins": ("Bins",),
    "thenar.runtime.model.terms.bit": ("Bit",),
    "thenar.runtime.model.terms.grid": ("Grid",),
    "thenar.runtime.model.terms.line": ("Line",),
    "thenar.runtime.recipe": ("Recipe",),
    ".artifact.adapting": ("AdaptedBuild", "adapt"),
    ".artifact.comparing": ("BuildComparison", "compare_builds"),
    ".artifact.compile": ("compile_build",),
    ".artifact.documents": ("BuildReport", "Documents"),
    ".artifact": ("CompileError",),
    ".artifact.exporting": ("export_c",),
    ".artifact.verify": ("FaultCheck", "Verification", "verify", "verify_faults"),
    ".classifiers": ("LogitBoostClassifier",),
    ".evaluation.folds": ("EvaluationError",),
    ".evaluation.study": ("Study", "StudyDesign", "evaluate"),
    ".firmware.targets": ("TARGETS",),
    ".frontier.find": ("find_frontier",),
    ".frontier.points": ("Frontier",),
    ".frontier.search": ("Search",),
    ".placement.tree": ("grow_id3",),
    ".placement.methods.base": ("METHODS",),
    ".placement.placement": ("Placement", "place"),
    ".recordings.columns": ("ColumnRoles",),
    ".recordings.export": ("from_dataframe", "to_dataframe"),
    ".recordings.graspset": ("GraspSet", "Joint"),
    ".recordings.merging": ("merge", "split"),
    ".samples": ("Samples", "TrainingError"),
    ".trainers.base": ("TRAINERS", "Setting", "Trainer"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "METHODS",
    "TARGETS",
    "TRAINERS",
    "AdaptedBuild",
    "Bins",
    "Bit",
    "Build",
    "BuildComparison",
    "BuildReport",
    "ColumnRoles",
    "CompileError",
    "Documents",
    "EvaluationError",
    "FaultCheck",
    "Frontier",
    "GraspSet",
    "Grid",
    "Joint",
    "Line",
    "LogitBoostClassifier",
    "Placement",
    "Recipe",
    "Samples",
    "ScoreTables",
    "Search",
    "Setting",
    "Study",
    "StudyDesign",
    "Term",
    "ThenarError",
    "Trainer",
    "TrainingError",
    "Verification",
    "adapt",
    "compare_builds",
    "compile_build",
    "evaluate",
    "export_c",
    "find_frontier",
    "from_dataframe",
    "grow_id3",
    "merge",
    "place",
    "split",
    "to_dataframe",
    "verify",
    "verify_faults",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("importlib.metadata").version("thenar")
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with optional():
        return getattr(import_module(_HOME_OF[name], __name__), name)


def __dir__() -> list[str]:
    return __all__

"""The offline compiler: recordings in, a build folder out.

Every name below is loaded when it is first used, so that `thenar.compiler.recordings` stays light.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from thenar.drivers.extras import optional

if TYPE_CHECKING:
    from thenar.drivers.errors import ThenarError as ThenarError
    from thenar.runtime.build import Build as Build
    from thenar.runtime.model.tables import ScoreTables as ScoreTables
    from thenar.runtime.model.terms.base import Term as Term
    from thenar.runtime.model.terms.bins import Bins as Bins
    from thenar.runtime.model.terms.bit import Bit as Bit
    from thenar.runtime.model.terms.grid import Grid as Grid
    from thenar.runtime.model.terms.line import Line as Line
    from thenar.runtime.recipe import Recipe as Recipe

    from .artifact import CompileError as CompileError
    from .artifact.adapting import AdaptedBuild as AdaptedBuild
    from .artifact.adapting import adapt as adapt
    from .artifact.comparing import BuildComparison as BuildComparison
    from .artifact.comparing import compare_builds as compare_builds
    from .artifact.compile import compile_build as compile_build
    from .artifact.documents import BuildReport as BuildReport
    from .artifact.documents import Documents as Documents
    from .artifact.verify import FaultCheck as FaultCheck
    from .artifact.verify import Verification as Verification
    from .artifact.verify import verify as verify
    from .artifact.verify import verify_faults as verify_faults
    from .classifiers import LogitBoostClassifier as LogitBoostClassifier
    from .evaluation.folds import EvaluationError as EvaluationError
    from .evaluation.study import Study as Study
    from .evaluation.study import StudyDesign as StudyDesign
    from .evaluation.study import evaluate as evaluate
    from .firmware.generate import export_c as export_c
    from .firmware.targets import TARGETS as TARGETS
    from .frontier.find import find_frontier as find_frontier
    from .frontier.points import Frontier as Frontier
    from .frontier.search import Search as Search
    from .placement.methods.base import METHODS as METHODS
    from .placement.placement import Placement as Placement
    from .placement.placement import place as place
    from .placement.tree import grow_id3 as grow_id3
    from .recordings.columns import ColumnRoles as ColumnRoles
    from .recordings.export import from_dataframe as from_dataframe
    from .recordings.export import to_dataframe as to_dataframe
    from .recordings.graspset import GraspSet as GraspSet
    from .recordings.graspset import Joint as Joint
    from .recordings.merging import merge as merge
    from .recordings.merging import split as split
    from .samples import Samples as Samples
    from .samples import TrainingError as TrainingError
    from .trainers.base import TRAINERS as TRAINERS
    from .trainers.base import Setting as Setting
    from .trainers.base import Trainer as Trainer

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
    ".artifact.verify": ("FaultCheck", "Verification", "verify", "verify_faults"),
    ".classifiers": ("LogitBoostClassifier",),
    ".evaluation.folds": ("EvaluationError",),
    ".evaluation.study": ("Study", "StudyDesign", "evaluate"),
    ".firmware.generate": ("export_c",),
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

# Registries, then classes, then functions.
__all__ = sorted(_HOME_OF, key=lambda name: (not name.isupper(), name.islower(), name))


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("importlib.metadata").version("thenar")
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with optional():
        return getattr(import_module(_HOME_OF[name], __name__), name)


def __dir__() -> list[str]:
    return __all__

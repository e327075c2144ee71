"""What is known when a build is complete, for the documents that go with it: its report, the spec of its glove."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.runtime.harness.wiring import Harness
from thenar.runtime.manifest import Manifest
from thenar.runtime.scanning.scanmap import ScanMap
from thenar.runtime.tables import IntegerTables

from ..recordings.graspset import GraspSet
from ..tables.compare import Comparison
from .training import Trained


@dataclass(frozen=True, slots=True, eq=False)
class Made:
    """A build before it is published.

    tables_bytes  size of tables.bin
    confusion     (K, K): how often rows of each grasp type were answered by each in the folds; None without folds
    firmware, only_answer  as in BuildReport
    """

    grasp_set: GraspSet
    manifest: Manifest
    trained: Trained
    tables: IntegerTables
    tables_bytes: int
    comparison: Comparison
    confusion: NDArray[np.intp] | None
    harness: Harness | None
    scan: ScanMap | None
    firmware: str
    only_answer: str | None


REPORT_NAME, SPEC_FOLDER = "report.html", "spec"
# What is published with a build: path in its folder -> content. Other names than the report's, and a spec's in its
# folder, are not a build's: `staging` would not replace them.
Documents = Callable[[Made], Mapping[str, bytes]]


def no_documents(_made: Made) -> Mapping[str, bytes]:
    """Return nothing: the build alone."""
    return {}

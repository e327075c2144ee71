"""Codes at the ends of their range, neighbouring codes, and the coding of floating-point degrees on import."""

import csv
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.model.collapse import collapse
from thenar.compiler.recordings.columns import ColumnRoles, JointColumns
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.importer import ImportReport, import_table
from thenar.compiler.recordings.table import read_table
from thenar.compiler.trainers.logitboost import boost
from thenar.runtime.model.terms.base import HIGHEST_CODE

from ..finding import Finding

# Values and their coding grids: half a step from two codes, a billionth apart, far from zero, next to the finest grid
# allowed, subnormal, zeros, infinite binary fractions, huge and tiny.
HARD_DEGREES: tuple[tuple[tuple[float, ...], float], ...] = (
    ((0.24999, 0.25, 0.75, 1.25, 32767.5), 0.5),
    ((1.0, 1.000000001, 1.000000002), 0.5),
    ((1e-9, 2e-9, 3e-9, 65535e-9), 1e-9),
    ((1e12, 1e12 + 2000, 1e12 + 3000, 1e12 + 130e6), 2000.0),
    ((123456789.123, 123456789.223, 123456790.777), 0.2),
    ((-0.0, 0.0, 5e-324, -5e-324, 2.2e-308), 0.5),
    ((-0.0, -1e-9, 1e-9), 0.1),
    ((-180.0, 179.999999999, 180.0, 0.1, -0.1), 1 / 3),
    ((1e200, 3.3e200, 9e203), 1e200),
    ((1e-200, 1.4e-200, 2.3e-199), 1e-200),
)


EVERY_CODE = np.arange(HIGHEST_CODE + 1)


def findings(full: bool) -> Iterator[Finding]:
    """Evaluate every code with stumps and tables, and import hard values."""
    yield _every_code(60 if full else 6)
    yield from _coded()


def hard_codes(seed: int) -> tuple[NDArray[np.uint16], NDArray[np.intp]]:
    """Return codes (n, 6) and labels (n,): only ends, neighbours at both ends, all equal, two 1 apart, and random."""
    random = np.random.default_rng(seed)
    labels = np.arange(48) % 3
    within = int(random.integers(1, HIGHEST_CODE - 1))
    columns = [
        random.choice([0, HIGHEST_CODE], 48),
        random.choice([0, 1, HIGHEST_CODE - 1, HIGHEST_CODE], 48),
        np.full(48, HIGHEST_CODE),
        within + (labels == 1),
        random.choice([0, 1], 48),
        random.integers(0, HIGHEST_CODE + 1, 48),
    ]
    return np.stack(columns, axis=1).astype(np.uint16), labels


def _every_code(sets: int) -> Finding:
    """A bin of the tables holds exactly the codes that every stump of its joint sends to the same branch."""
    wrong = Finding.of("codes on different sides for tables and stumps", "every code there is", 0, "codes")
    for seed in range(sets):
        codes, labels = hard_codes(seed)
        stumps, _ = boost(codes, labels, 3, rounds=20)
        for column, steps in enumerate(collapse(stumps, 0).thresholds):
            # Compared as whole numbers: a double holds each code.
            used = stumps.thresholds[stumps.columns == column]
            changes = {int((threshold >= EVERY_CODE).sum()) for threshold in used} - {0, len(EVERY_CODE)}
            misplaced = changes ^ {int(step) + 1 for step in steps}
            wrong.see(len(misplaced), f"set {seed}, joint {column}", tried=len(EVERY_CODE))
    return wrong


def _coded() -> Iterator[Finding]:
    """A value is at most half a step from its code's value, and a code's value gets that code again.

    Half a step plus rounding: the origin, the difference, the quotient and the code's value each lose 2^-53 of at most
    1e9 steps (`Joint` rejects more) to 65536: 4.5e-7 of a step.
    """
    off = Finding.of("degrees compared with their codes", "fractions", 0.5 + 4.5e-7, "steps")
    reported = Finding.of("largest coding error that import reports", "fractions", 4.5e-7, "steps")
    again = Finding.of("codes that do not come back from their own value", "the code itself", 0, "codes")
    for values, grid in HARD_DEGREES:
        grasp_set, report = _imported(values, grid)
        joint, codes = grasp_set.joints[0], grasp_set.codes[:, 0]
        origin, step = Fraction(joint.value_a), Fraction(joint.value_b - joint.value_a) / (joint.code_b - joint.code_a)
        errors = [
            abs(Fraction(value) - origin - (int(code) - joint.code_a) * step) / step
            for value, code in zip(values, codes, strict=True)
        ]
        what = f"{values[0]!r} and on, grid {grid:g}"
        off.see(float(max(errors)), what, tried=len(values))
        reported.see(float(abs(max(errors) - Fraction(report.coding[0].largest_error) / step)), what)
        again.see(int((joint.code(joint.value(EVERY_CODE)) != EVERY_CODE).sum()), what, tried=len(EVERY_CODE))
    yield from (off, reported, again)


def _imported(values: Sequence[float], grid: float) -> tuple[GraspSet, ImportReport]:
    columns = ColumnRoles(
        "grasp", frames="independent", switches=("switch",), joints=(JointColumns(("joint",), grid=grid),)
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "table.csv"
        with path.open("w", newline="") as file:
            csv.writer(file).writerows([("grasp", "switch", "joint"), *(("a", "1", repr(value)) for value in values)])
        return import_table(read_table(path), columns)

"""A placement method of your own: switches by Pearson's chi-squared against the grasp type.

A package adds it with an entry point, which is all that thenar needs to list it, choose by it, and compare it:

    [project.entry-points."thenar.methods"]
    chi2 = "my_package.method:MEMBER"
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.placement.methods.base import Method, ranked


def by_chi2(bits: NDArray[np.bool_], labels: NDArray[np.intp]) -> Iterable[int]:
    """Return the columns of bits (n, s), the one that depends most on the grasp type labels (n,) first."""
    member = np.eye(labels.max() + 1)[labels]
    closed = bits.T.astype(float) @ member  # (s, types) rows in which the switch is closed
    expected = np.outer(bits.mean(axis=0), member.sum(axis=0))
    chi2 = ((closed - expected) ** 2 / np.maximum(expected, 1e-9)).sum(axis=1) / (1 - bits.mean(axis=0))
    return [int(column) for column in np.argsort(-chi2, kind="stable")]


MEMBER = Method(
    name="chi2",
    help="Those that depend most on the grasp type, alone, by Pearson's chi-squared",
    learn=ranked(by_chi2),
    sizes=(4, 16),
)

"""What a user should know about the folds before believing the rates."""

import numpy as np

from ..recordings.graspset import GraspSet
from .populations import Population, Scheme


def concerns(grasp_set: GraspSet, parts: tuple[Population, ...], scheme: Scheme, n_folds: int) -> tuple[str, ...]:
    """Return a sentence if the grasps are simulated, and for each grasp type that is alone, too rare for the folds, or
    tested but never trained.
    """
    made = grasp_set.simulated
    simulated = [f"these grasps are simulated ({made}): the rates are not those of recorded ones"] if made else []
    alone = [
        f"subject {part.name}: every row is of {grasp_set.taxonomy.types[part.grasps[0]]}, nothing is to be told apart"
        for part in parts
        if len(part.grasps) == 1
    ]
    found = [text for part in parts for text in _untrained(grasp_set, part)]
    if scheme == "stratified":
        found = [text for part in parts for text in _rare(grasp_set, part, n_folds)] + found
    return tuple(simulated + alone + found)


def _rare(grasp_set: GraspSet, part: Population, n_folds: int) -> list[str]:
    counts = np.bincount(grasp_set.labels[part.rows], minlength=len(grasp_set.taxonomy.types))
    return [
        f"subject {part.name} has {counts[label]} row(s) of {grasp_set.taxonomy.types[label]}: "
        f"fewer than the {n_folds} folds, so some folds do not test it"
        for label in part.grasps
        if counts[label] < n_folds
    ]


def _untrained(grasp_set: GraspSet, part: Population) -> list[str]:
    """Name the grasp types that some fold tests without having trained them, with the number of rows lost so."""
    lost: dict[int, int] = {}
    for fold in part.repeats[0]:
        tested = grasp_set.labels[fold.test]
        for label in np.setdiff1d(tested, grasp_set.labels[fold.train]).tolist():
            lost[label] = lost.get(label, 0) + int(np.count_nonzero(tested == label))
    return [
        f"{count} row(s) of {grasp_set.taxonomy.types[label]} of subject {part.name} are tested by a fold that trains "
        "no such row: they cannot be recognised"
        for label, count in sorted(lost.items())
    ]

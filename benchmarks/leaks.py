"""The optimism of an accuracy when frames of one trial are on both sides of a fold: a set with several frames per
trial.

The nearest neighbour, in the joints' codes and the switches, predicts the grasp type with frames in random folds, with
trials kept whole, and with each person left out.

    thenar import frames.csv.gz -o r2g.grasps --columns examples/columns/r2g.toml
    python benchmarks/leaks.py r2g.grasps
"""

import sys
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from sklearn.neighbors import KNeighborsClassifier

from thenar.compiler.evaluation.folds import Fold, leave_one_out, trial_folds, weka_folds
from thenar.compiler.evaluation.rates import Rate, rated
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.samples import Samples

if TYPE_CHECKING:
    from thenar.runtime.manifest import Of


def predicted(grasp_set: GraspSet, folds: list[Fold]) -> NDArray[np.intp]:
    """Return the label (n,) of each row's nearest neighbour in the training rows of the fold that tests it."""
    X, labels = Samples.of(grasp_set).inputs, grasp_set.labels
    found = np.zeros_like(labels)
    for fold in folds:
        nearest = KNeighborsClassifier(1).fit(X[fold.train], labels[fold.train])
        found[fold.test] = nearest.predict(X[fold.test])
    return found


def rates(grasp_set: GraspSet) -> dict[str, tuple[Rate, Rate | None]]:
    """Return the rates of trials and of frames under each cut."""
    labels, trials, subjects = grasp_set.labels, grasp_set.trial_ids, grasp_set.subjects
    cuts: dict[str, tuple[list[Fold], Of]] = {
        "frames in random folds: they leak": (weka_folds(labels, 4, 1), "pooled"),
        "trials apart": (trial_folds(labels, trials, 4, 1), "pooled"),
        "persons apart": (leave_one_out(subjects, "subject"), "new subject"),
    }
    return {
        name: rated(
            predicted(grasp_set, folds), labels, trials, of=of, groups=subjects if of == "new subject" else None
        )
        for name, (folds, of) in cuts.items()
    }


def main() -> None:
    """Print a table of both rates under each cut."""
    print("| folds | trials | frames |\n|---|---|---|")
    for name, both in rates(GraspSet.load(sys.argv[1])).items():
        print(f"| {name} | " + " | ".join("" if rate is None else str(rate) for rate in both) + " |")


if __name__ == "__main__":
    main()

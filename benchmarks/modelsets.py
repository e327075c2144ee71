"""The sets on which models are compared, and their folds: the same for all, with the switches placed inside."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.evaluation.folds import Fold, leave_one_out, trial_folds
from thenar.compiler.placement.placement import choose
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.importer import import_file
from thenar.compiler.samples import Samples
from thenar.runtime.manifest import Of
from thenar.simulator.pipeline.scene_file import load_scene
from thenar.simulator.pipeline.simulation import simulate

COLUMNS = Path(__file__).parents[1] / "examples" / "columns"
# Real recordings: their table, and a columns.toml.
RECORDED = {
    "icub": ("icub_tactile_encoders/trials.csv.gz", "icub.toml"),
    "aml": ("aml_flex6_grasptypes/trials.csv.gz", "aml.toml"),
    "r2g": ("r2g_apertures29/frames.csv.gz", "r2g.toml"),
}
SCENES = ("quick", "kamakura", "cutkosky")
SETS = ("quick", "icub", "aml", "kamakura", "cutkosky", "r2g")

SWITCHES, FOLDS, INNER, SEED = 33, 4, 3, 1
# More subjects than this are left out in this many groups, and there are no folds by trial.
MOST_SUBJECTS = 10
# Of trials with several frames, each third frame is used: neighbours add little.
EACH = 3

Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """Rows to train on and to test, with the switches that the training rows chose; inner folds keep `groups`
    (n_train,) together.
    """

    of: Of
    name: str
    train: Samples
    test: Samples
    groups: Rows

    def inner(self) -> list[Fold]:
        """Return folds of the training rows, for choosing settings."""
        distinct = np.unique(self.groups)
        if np.array_equal(self.groups, self.train.trials):
            return trial_folds(self.train.labels, self.groups, INNER, SEED)
        part = np.searchsorted(distinct, self.groups) % min(INNER, len(distinct))
        return leave_one_out(part.astype(np.str_), "group")


def load(name: str, data: Path) -> Samples:
    """Return a set by its name, or from a .grasps file. Raises FileNotFoundError if its table is not in `data`."""
    if name in SCENES:
        return Samples.of(simulate(load_scene(name)).grasp_set)
    if name not in RECORDED:
        return Samples.of(GraspSet.load(name))
    table, columns = RECORDED[name]
    samples = Samples.of(import_file(data / table, COLUMNS / columns)[0])
    first = np.unique(samples.trials, return_index=True)[1]
    if len(first) == len(samples.labels):
        return samples
    order = np.argsort(samples.trials, kind="stable")
    place = np.empty(len(order), np.intp)
    place[order] = np.concatenate([np.arange(count) for count in np.bincount(samples.trials)])
    return samples.rows(place % EACH == 0)


def cuts(samples: Samples) -> Iterator[Cut]:
    """Yield the folds with trials apart, and those with a subject, or a group of subjects, left out."""
    subjects = np.unique(samples.subjects)
    if len(subjects) <= MOST_SUBJECTS:
        for fold in trial_folds(samples.labels, samples.trials, FOLDS, SEED):
            yield _placed("within subject" if len(subjects) == 1 else "pooled", samples, fold)
    if len(subjects) > 1:
        group = np.random.default_rng(SEED).permutation(len(subjects)) % MOST_SUBJECTS
        for fold in leave_one_out(group[samples.subjects].astype(np.str_), "subject"):
            yield _placed("new subject", samples, fold)


def _placed(of: Of, samples: Samples, fold: Fold) -> Cut:
    train, test = samples.rows(np.sort(fold.train)), samples.rows(np.sort(fold.test))
    groups = train.subjects if of == "new subject" and np.ptp(train.subjects) else train.trials
    return with_switches(of, fold.name, train, test, groups)


def with_switches(of: Of, name: str, train: Samples, test: Samples, groups: Rows) -> Cut:
    """Return the fold with the switches that the training rows choose."""
    columns = choose(train)[0][:SWITCHES] if train.n_switches else ()
    return Cut(of, name, train.keeping(columns), test.keeping(columns), groups)

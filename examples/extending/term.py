"""A kind of term from another package, which adds a row where two joints are bent together, and a trainer of it."""

from dataclasses import dataclass, replace

import numpy as np

from thenar.compiler import TRAINERS, Grid, Term, Trainer


@dataclass(frozen=True, eq=False)
class Corner(Term):
    """A row (K,) that is added where the codes of two joints (2,) both exceed their thresholds (2,)."""

    name = "corner"

    joints: np.ndarray
    thresholds: np.ndarray
    row: np.ndarray

    @property
    def inputs(self):
        """Return the joints."""
        return tuple(self.joints.tolist())

    def of(self, *values):
        """Return the contribution (n, K) of codes (n,) of both joints."""
        both = (values[0] > self.thresholds[0]) & (values[1] > self.thresholds[1])
        return both[:, None] * self.row

    def core(self):
        """Return a grid of two by two cells, three of which are zero."""
        rows = np.zeros((2, 2, len(self.row)))
        rows[1, 1] = self.row
        return (Grid(self.inputs, (self.thresholds[:1], self.thresholds[1:]), rows),)


class LogitWithCorner(Trainer):
    """Add to the logit how much likelier each type bends the first two joints together than one by one."""

    name = "logit-corner"
    what = "the logit, with a corner of the first two joints"

    def train(self, samples, settings, report=None):
        """Return the tables of the logit, and the corner."""
        tables = TRAINERS["logit"].train(samples, {"penalty": 1.0, "smoothness": 4.0, "max_bins": 4})
        if samples.codes.shape[1] < 2:
            return tables
        members = samples.labels == np.arange(samples.n_classes)[:, None]
        thresholds = np.median(samples.codes[:, :2], axis=0).astype(np.uint16)
        bent = samples.codes[:, :2] > thresholds
        one, other, both = (
            np.log((members @ each + 1.0) / (members.sum(axis=1) + 2.0)) for each in (*bent.T, bent.all(axis=1))
        )
        corner = Corner(np.array([0, 1]), thresholds, both - one - other)
        return replace(tables, terms=(*tables.terms, corner))


KIND, MEMBER = Corner, LogitWithCorner()

"""The two protocols: which rows may choose the placement."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from .folds import Fold, Rows
from .populations import Population

ProtocolName = Literal["paper", "honest"]


@dataclass(frozen=True, slots=True)
class Protocol:
    """A protocol's name, and one sentence on what it means."""

    name: ProtocolName
    meaning: str

    def may_choose(self, part: Population, fold: Fold) -> Rows:
        """Return the rows from which the placement for this fold may be chosen."""
        return part.rows if self.name == "paper" else fold.train

    def may_choose_pooled(self, everyone: Rows, fold: Fold) -> Rows:
        """Return the rows from which a placement common to all subjects may be chosen for this fold."""
        return everyone if self.name == "paper" else np.setdiff1d(everyone, fold.test)


PAPER = Protocol(
    "paper",
    "The placement is chosen once, from all rows, test rows included, as the paper did: optimistic.",
)
HONEST = Protocol(
    "honest",
    "The placement is chosen anew inside each training fold; no test row has a say: what to expect of new grasps.",
)
PROTOCOLS = (PAPER, HONEST)

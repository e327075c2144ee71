"""The additive logit with tables of pairs of joints."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from .base import Report, Setting, Trainer
from .logit import MEMBER as LOGIT
from .logit import of_none

if TYPE_CHECKING:
    from thenar.runtime.model.tables import ScoreTables

    from ..samples import Samples


class Pairs(Trainer):
    """The logit with interactions of pairs of joints, chosen by their gain."""

    name = "pairs"
    what = "the logit, with tables for pairs of joints"
    rank = 2
    settings = (
        *(setting for setting in LOGIT.settings if setting.name != "linear"),
        Setting("pairs", "Use at most this many pairs of joints; each joint is in one pair at most.", int, 4, 1),
        # As additive.pairs.MOST_PAIR_BINS.
        Setting("pair_bins", "Give a joint at most this many bins in a pair.", int, 8, 2, 16),
        Setting("pair_smoothness", "Pull of a pair's neighbouring bins towards each other.", float, 0.5, 0.0, 1e6),
    )
    tried = (
        {"penalty": 1.0, "smoothness": 8.0, "max_bins": 32, "pair_smoothness": 1.0},
        {"penalty": 0.3, "smoothness": 2.0, "max_bins": 32, "pair_smoothness": 0.3},
    )

    def train(self, samples: "Samples", settings: Mapping[str, Any], report: Report | None = None) -> "ScoreTables":
        """Return the tables. Raises BoostingError for settings that make no sense."""
        from ..additive.logit import BINS
        from ..additive.pairs import fit_pairs

        given = {**settings, "max_bins": settings["max_bins"] or BINS}
        return fit_pairs(
            samples.switches, samples.codes, samples.labels, samples.n_classes, **given, **of_none(samples)
        )


MEMBER = Pairs()

"""LogitBoost on decision stumps, the paper's trainer."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from .base import Report, Setting, Trainer

if TYPE_CHECKING:
    from ..boosting.stumps import Stumps
    from ..samples import Samples


class LogitBoost(Trainer):
    """Rounds of one stump a class, as Weka 3.6 computes them, with exact sums."""

    name = "logitboost"
    what = "LogitBoost on decision stumps, the paper's"
    rank = -1
    settings = (
        Setting("rounds", "Rounds of LogitBoost.", int, 100, 1),
        Setting("shrinkage", "Share of each round that is kept.", float, 1.0),
        Setting("tolerance", "Stop after a round that changes the mean loss by less than this.", float, None),
        Setting("max_bins", "At most so many bins a joint: smaller tables.  [default: no limit]", int, None, 2),
    )

    def train(self, samples: "Samples", settings: Mapping[str, Any], report: Report | None = None) -> "Stumps":
        """Return the ensemble. Raises BoostingError for settings that make no sense."""
        from ..boosting.classifier import LogitBoostClassifier

        classifier = LogitBoostClassifier(**settings, classes=range(samples.n_classes))
        return classifier.fit(samples.inputs, samples.labels, progress=report).stumps_


MEMBER = LogitBoost()

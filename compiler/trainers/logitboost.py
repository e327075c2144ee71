"""LogitBoost on decision stumps, the paper's trainer."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .base import Number, Report, Setting, Trainer

if TYPE_CHECKING:
    from ..boosting.stumps import Stumps
    from ..samples import Samples


# As boosting.boost.TIES.
TIES = ("first", "least-used")


class LogitBoost(Trainer):
    """Rounds of one stump per class, as Weka 3.6 computes them, with exact sums."""

    name = "logitboost"
    what = "LogitBoost on decision stumps, as in the paper"
    rank = -1
    staged = True
    tried = (
        {"rounds": 30, "max_bins": 16, "ties": "least-used"},
        {"rounds": 100, "max_bins": 16, "ties": "least-used"},
        {"rounds": 100, "max_bins": 16, "ties": "least-used", "shrinkage": 0.3},
        {"rounds": 100},
    )
    settings = (
        Setting("rounds", "Rounds of LogitBoost.", int, 100, 1),
        # Equal to boosting.boost.SMALLEST_SHRINKAGE, which is not imported for a help text.
        Setting("shrinkage", "Factor on the contribution of each round.", float, 1.0, 1e-6, 1.0),
        Setting("tolerance", "Stop after a round that changes the mean loss by less than this.", float, None, 0),
        Setting("max_bins", "Most bins per joint; fewer make smaller tables.  [default: no limit]", int, None, 2),
        Setting("ties", "Between equal stumps, take the first or the least used input.", str, "first", names=TIES),
    )

    def candidates(self, given: Mapping[str, Number]) -> tuple[dict[str, Number], ...]:
        """Return the candidates to compare; given rounds mean the paper's recipe, which leaves nothing else open."""
        recipe = {"shrinkage": 1.0, "max_bins": None, "ties": "first"} if "rounds" in given else {}
        return super().candidates({**recipe, **given})

    def train(self, samples: "Samples", settings: Mapping[str, Any], report: Report | None = None) -> "Stumps":
        """Return the ensemble. Raises BoostingError for settings that make no sense."""
        from ..boosting.boost import boost

        return boost(samples.inputs, samples.labels, samples.n_classes, **settings, on_round=report)[0]

    def stages(self, samples: "Samples", settings: Mapping[str, Any], rounds: Sequence[int]) -> "tuple[Stumps, ...]":
        """Return the ensembles of the first rounds, cut from the longest training."""
        longest = self.train(samples, {**settings, "rounds": max(rounds)})
        return tuple(longest.first(each) for each in rounds)


MEMBER = LogitBoost()

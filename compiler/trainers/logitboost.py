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
    """Rounds of one stump a class, as Weka 3.6 computes them, with exact sums."""

    name = "logitboost"
    what = "LogitBoost on decision stumps, the paper's"
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
        # As boosting.boost.SMALLEST_SHRINKAGE, which is not imported for a help text.
        Setting("shrinkage", "Share of each round that is kept.", float, 1.0, 1e-6, 1.0),
        Setting("tolerance", "Stop after a round that changes the mean loss by less than this.", float, None, 0),
        Setting("max_bins", "At most so many bins a joint: smaller tables.  [default: no limit]", int, None, 2),
        Setting("ties", "Of equal stumps: the first input's, or the least used input's.", str, "first", names=TIES),
    )

    def candidates(self, given: Mapping[str, Number]) -> tuple[dict[str, Number], ...]:
        """Return what is compared; given rounds are the paper's recipe, of which nothing else is left open."""
        recipe = {"shrinkage": 1.0, "max_bins": None, "ties": "first"} if "rounds" in given else {}
        return super().candidates({**recipe, **given})

    def train(self, samples: "Samples", settings: Mapping[str, Any], report: Report | None = None) -> "Stumps":
        """Return the ensemble. Raises BoostingError for settings that make no sense."""
        from ..boosting.boost import boost

        return boost(samples.inputs, samples.labels, samples.n_classes, **settings, on_round=report)[0]

    def stages(self, samples: "Samples", settings: Mapping[str, Any], rounds: Sequence[int]) -> "tuple[Stumps, ...]":
        """Return the ensembles of the first rounds of the longest."""
        longest = self.train(samples, {**settings, "rounds": max(rounds)})
        return tuple(longest.first(each) for each in rounds)


MEMBER = LogitBoost()

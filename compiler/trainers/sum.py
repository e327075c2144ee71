"""The sum of boosted stumps and the additive logit."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .base import Report, Trainer
from .logit import MEMBER as LOGIT
from .logitboost import MEMBER as LOGITBOOST

if TYPE_CHECKING:
    from ..samples import Samples
    from ..tables.collapse import ScoreTables

# The settings of both trainers, each shared name once.
_SETTINGS = {setting.name: setting for setting in (*LOGIT.settings, *LOGITBOOST.settings)}


class Sum(Trainer):
    """The sum of two models' scores: both contributions of an input are in one table."""

    name = "sum"
    what = "the sum of logitboost and logit"
    rank = 1
    staged = True
    tried = ({"max_bins": 16, "ties": "least-used"},)
    settings = tuple(_SETTINGS.values())

    def train(self, samples: "Samples", settings: Mapping[str, Any], report: Report | None = None) -> "ScoreTables":
        """Return the tables. Raises BoostingError for settings that make no sense."""
        from ..tables.collapse import added, collapse

        boosted = LOGITBOOST.train(samples, _own(LOGITBOOST, settings), report)
        return added(collapse(boosted, samples.n_switches), LOGIT.train(samples, _own(LOGIT, settings)))

    def stages(
        self, samples: "Samples", settings: Mapping[str, Any], rounds: Sequence[int]
    ) -> "tuple[ScoreTables, ...]":
        """Return the logit's tables plus those of the first rounds of the longest boosting."""
        from ..tables.collapse import added, collapse

        still = LOGIT.train(samples, _own(LOGIT, settings))
        stages = LOGITBOOST.stages(samples, _own(LOGITBOOST, settings), rounds)
        return tuple(added(collapse(boosted, samples.n_switches), still) for boosted in stages)


def _own(trainer: Trainer, settings: Mapping[str, Any]) -> dict[str, Any]:
    return {setting.name: settings[setting.name] for setting in trainer.settings}


MEMBER = Sum()

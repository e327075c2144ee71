"""Multinomial logistic regression: a row of scores for each switch and each joint, and few of them if so asked.

A sparse model is fitted twice. The weights of joints are first compared in the deviation of their joint, relative to
the last class, as firmware adds them up; the smallest become 0, and the others are fitted again. A weight of 0 takes no
time and no flash in straight-line code.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from thenar.runtime.model.tables import ScoreTables

from .base import Report, Setting, Trainer
from .logit import MEMBER as LOGIT
from .logit import fit_logit, of_none
from .newton import DRAFT

if TYPE_CHECKING:
    from ..samples import Samples


class Linear(Trainer):
    """Multinomial logistic regression with a penalty, all or some of its weights; convex, so the solution is unique."""

    name = "linear"
    what = "multinomial logistic regression on a weight for each input"
    settings = (
        *(setting for setting in LOGIT.settings if setting.name != "max_bins"),
        Setting("sparsity", "Share of the joints' weights that are 0, which firmware skips.", float, 0.0, 0.0, 1.0),
    )
    drafting = DRAFT
    tried = ({"penalty": 3.0, "smoothness": 3.0}, {"penalty": 0.3, "smoothness": 1.0})

    def train(self, samples: "Samples", settings: Mapping[str, Any], report: Report | None = None) -> ScoreTables:
        """Return the tables. Raises TrainingError for settings that make no sense."""
        given = {**settings, **of_none(samples), "linear": True}
        tables = fit_logit(samples.inputs, samples.labels, samples.n_classes, **given)
        return tables.score_tables(samples.n_switches)


MEMBER = Linear()

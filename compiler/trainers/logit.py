"""The additive multinomial logit."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from .base import Report, Setting, Trainer

if TYPE_CHECKING:
    from thenar.runtime.model.tables import ScoreTables

    from ..samples import Samples


class Logit(Trainer):
    """Multinomial logistic regression on tables of each input, with a penalty; convex, so the solution is unique."""

    name = "logit"
    what = "multinomial logistic regression on a table for each input"
    settings = (
        Setting("penalty", "Pull of scores towards zero (logit).", float, 0.5, 1e-6, 1e6),
        Setting("smoothness", "Pull of a joint's neighbouring bins towards each other (logit).", float, 2.0, 0.0, 1e6),
        Setting(
            "max_bins", "Most bins per joint; fewer make smaller tables.  [default: no limit; logit: 16]", int, 16, 2
        ),
        Setting("linear", "1: joints add scores in proportion to their codes, without bins (logit).", int, 0, 0, 1),
    )

    # The best smoothness grows with the number of bins: more bins mean smaller steps between them.
    tried = (
        {"penalty": 1.0, "smoothness": 4.0, "max_bins": 16},
        {"penalty": 3.0, "smoothness": 24.0, "max_bins": 32},
        {"penalty": 1.0, "smoothness": 8.0, "max_bins": 32},
        {"penalty": 0.3, "smoothness": 1.5, "max_bins": 32},
        {"penalty": 1.0, "smoothness": 1.0, "linear": 1},
        {"penalty": 0.3, "smoothness": 1.0, "linear": 1},
    )

    def train(self, samples: "Samples", settings: Mapping[str, Any], report: Report | None = None) -> "ScoreTables":
        """Return the tables. Raises BoostingError for settings that make no sense."""
        from ..additive.logit import BINS, fit_logit

        given = {**settings, "max_bins": settings["max_bins"] or BINS, "linear": bool(settings["linear"])}
        tables = fit_logit(samples.inputs, samples.labels, samples.n_classes, **given, **of_none(samples))
        return tables.score_tables(samples.n_switches)


def of_none(samples: "Samples") -> dict[str, Any]:
    """Return additional arguments of the logit where some rows hold nothing.

    All switches are evidence against nothing held, so their number is an input too; static grasps are known to be held
    and teach the class of nothing held nothing.
    """
    return {"counted": samples.n_switches, "held": samples.given_held} if samples.has_none else {}


MEMBER = Logit()

"""The interface of trainers, the registry of all trainers, and the check of the rows that they train on."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thenar.drivers.members import Members
from thenar.runtime.manifest import Fitting
from thenar.runtime.model.tables import ScoreTables
from thenar.runtime.recipe import AUTO, Recipe

from ..elementary import Floats
from ..samples import TrainingError
from .stumps import Stumps

if TYPE_CHECKING:
    from ..samples import Samples

# The models that trainers return: score tables, or an ensemble that collapses to them.
Model = Stumps | ScoreTables
Report = Callable[[int, int], None]
Number = float | int | None


@dataclass(frozen=True, slots=True)
class Setting:
    """A number that configures a trainer: `--name` on the command line, with hyphens.

    Parameters
    ----------
    name : str
        An identifier, such as "max_bins".
    what : str
        The sentence in `--help`.
    kind : type
        int or float.
    default : int, float or None
        The value if none is given; None is a valid default.
    least, most : int or float, optional
        The range of valid numbers.

    Examples
    --------
    >>> from thenar.compiler import TRAINERS
    >>> [setting.name for setting in TRAINERS["logitboost"].settings]
    ['rounds', 'shrinkage', 'tolerance', 'max_bins']
    """

    name: str
    what: str
    kind: type[int] | type[float]
    default: Number
    least: float | None = None
    most: float | None = None

    def checked(self, value: Number | str) -> Number:
        """Return the value converted to its kind. Raises TrainingError for an invalid one."""
        if value is None:
            return None
        if isinstance(value, str):
            raise TrainingError(f"{self.name}={value!r} must be a number")
        if self.least is not None and not value >= self.least:
            raise TrainingError(f"{self.name}={value} must be at least {self.least}")
        if self.most is not None and not value <= self.most:
            raise TrainingError(f"{self.name}={value} must be at most {self.most}")
        return self.kind(value)


MAX_BINS = "Most bins per joint; fewer make smaller tables.  [default: no limit; logit: 16; discriminant: no bins]"


class Trainer(ABC):
    """A method that fits an additive model: a sum over inputs, F_k(x) = b_k + `sum over i of T_i[x_i][k]`.

    Each member of `TRAINERS` is an instance, defined in a module of this folder as `MEMBER`.

    Attributes
    ----------
    name : str
        The value of `--trainer NAME`.
    what : str
        A phrase for `--help`.
    settings : tuple of Setting
        The hyperparameters. Trainers that share a name share its meaning.
    tried : tuple of mapping
        Combinations of settings that are compared where settings are chosen automatically, the most regular first;
        other settings have their defaults. Empty: there is nothing to choose.
    automatic : bool
        Whether it is compared with others where the trainer is chosen automatically.
    staged : bool
        Whether `rounds` is a setting, and one training also gives the models of all smaller numbers of rounds.
    drafting : mapping
        Arguments that `train` takes among its settings where a less precise model will do.
    """

    name: str
    what: str
    settings: tuple[Setting, ...] = ()
    tried: tuple[Mapping[str, Number], ...] = ({},)
    automatic: bool = True
    staged: bool = False
    drafting: Mapping[str, Number] = {}

    @abstractmethod
    def train(self, samples: "Samples", settings: Mapping[str, Any], report: Report | None = None) -> Model:
        """Return a model of `samples`.

        Parameters
        ----------
        samples : Samples
            The rows to learn from: the kept switches (n, s), the joints' codes (n, j), and labels (n,).
        settings : mapping
            A value for each of the trainer's `settings`.
        report : callable, optional
            Called with (done, total) as the work proceeds.

        Returns
        -------
        ScoreTables or Stumps
            A model of these s switches and j joints, with a class for each of `samples.grasps`. It depends on samples
            and settings only, to the last bit.
        """

    def drafts(self, several: "Sequence[Samples]", settings: Mapping[str, Any]) -> Sequence[Model]:
        """Return models to compare settings and trainers by, which need not be as precise as those of `train`.

        Trainers override this method if several sets, each with inputs that vary, take less time together.
        """
        return [self.train(samples, {**settings, **self.drafting}) for samples in several]

    def stages(self, samples: "Samples", settings: Mapping[str, Any], rounds: Sequence[int]) -> tuple[Model, ...]:
        """Return a model for each of these numbers of rounds, from one training; see `train`.

        Staged trainers override this method. Each model is the one that `train` returns for that number of rounds, to
        the last bit; a trainer without stages returns the same one for all.
        """
        return (self.train(samples, settings),) * len(rounds)

    def candidates(self, given: Mapping[str, Number]) -> tuple[dict[str, Number], ...]:
        """Return all combinations of settings to compare when these settings are `given`.

        Raises TrainingError for an unknown setting, or a value out of its range.
        """
        fixed = self.checked(given)
        defaults = {setting.name: setting.default for setting in self.settings}
        found: list[dict[str, Number]] = []
        for tried in self.tried or ({},):
            values = {**defaults, **tried, **fixed}
            found += [] if values in found else [values]
        return tuple(found)

    def checked(self, given: Mapping[str, Number]) -> dict[str, Number]:
        """Return given settings as values of their kind.

        Raises TrainingError for an unknown setting, or a value out of its range.
        """
        settings = {setting.name: setting for setting in self.settings}
        values: dict[str, Number] = {}
        for name, value in given.items():
            if name not in settings:
                raise TrainingError(f"trainer {self.name!r} has no setting {name!r}: leave it out")
            values[name] = settings[name].checked(value)
        return values


TRAINERS: Members[Trainer] = Members("trainer", Trainer, "thenar.compiler.trainers", "thenar.trainers")  # type: ignore[type-abstract]


# Choices of a recipe that are settings of some trainers. None means not given.
SHARED = ("rounds", "shrinkage", "tolerance", "max_bins")


@dataclass(frozen=True, slots=True)
class Training:
    """A trainer by name, and values for all its settings: the information that a worker process needs to train.

    If `masked`, it also learns from rows in which inputs are lost.
    """

    trainer: str
    settings: Mapping[str, Number]
    masked: bool = False

    @classmethod
    def of(cls, options: Recipe) -> "Training":
        """Return the training that `options` define, with defaults for what is not given.

        If no trainer is given, the defaults are the paper's, of LogitBoost. Raises SettingError or TrainingError for
        invalid options.
        """
        trainer, given = _asked(options)[0]
        defaults = {setting.name: setting.default for setting in trainer.settings}
        return cls(trainer.name, defaults | trainer.checked(given), options.robust)

    @classmethod
    def candidates(cls, options: Recipe) -> "tuple[Training, ...]":
        """Return every training that `options` allow, to be compared: a single one if nothing is left open.

        Raises SettingError or TrainingError for invalid options.
        """
        asked = _asked(options)
        if options.trainer == AUTO and len(asked) > 1:
            asked = [(trainer, given) for trainer, given in asked if trainer.automatic]
        return tuple(
            cls(trainer.name, values, options.robust)
            for trainer, given in asked
            for values in trainer.candidates(given)
        )

    @classmethod
    def chosen(cls, fitting: Fitting, *, masked: bool = False) -> "Training":
        """Return the training that was chosen."""
        return cls(fitting.trainer, TRAINERS.named(fitting.trainer).checked(fitting.settings), masked)

    def train(self, samples: "Samples", report: Report | None = None) -> Model:
        """Return the trainer's model of `samples`."""
        return TRAINERS.named(self.trainer).train(self._rows(samples), self.settings, report)

    def draft(self, samples: "Samples") -> Model:
        """Return the trainer's model of `samples` for a comparison."""
        return self.drafts([samples])[0]

    def drafts(self, several: "Sequence[Samples]") -> Sequence[Model]:
        """Return the trainer's models of several samples for a comparison."""
        return TRAINERS.named(self.trainer).drafts([self._rows(samples) for samples in several], self.settings)

    def stages(self, samples: "Samples", rounds: Sequence[int]) -> tuple[Model, ...]:
        """Return the trainer's models of `samples` after each of these numbers of rounds."""
        return TRAINERS.named(self.trainer).stages(self._rows(samples), self.settings, rounds)

    def _rows(self, samples: "Samples") -> "Samples":
        return samples.masked() if self.masked else samples


def _asked(options: Recipe) -> list[tuple[Trainer, dict[str, Number]]]:
    """Return the trainers that may be used, and the settings given to each.

    A given setting that some trainers lack applies to the simplest trainer that has it, the one with the fewest
    settings: `rounds` means LogitBoost, not a trainer that boosts and does more. A trainer without bins keeps any limit
    of bins.
    """
    shared = {name: value for name in SHARED if (value := getattr(options, name)) is not None}
    if options.trainer != AUTO:
        trainer = TRAINERS.named(options.trainer)
        own = {setting.name for setting in trainer.settings}
        return [(trainer, {name: value for name, value in shared.items() if name in own} | options.settings)]
    given: dict[str, Number] = shared | options.settings
    names = {trainer.name: {setting.name for setting in trainer.settings} for trainer in TRAINERS.values()}
    takers = [name for name in names if names[name] | {"max_bins"} >= given.keys()]
    if not takers:
        lacking = sorted(given.keys() - set().union(*names.values()))
        wrong = (
            f"no trainer has the setting {lacking[0]!r}"
            if lacking
            else f"no trainer has all of {', '.join(sorted(given))}"
        )
        raise TrainingError(f"{wrong}: leave it out")
    if len(takers) < len(names):
        size = {name: len(names[name]) for name in takers}
        takers = [name for at, name in enumerate(takers) if not any(size[one] < size[name] for one in takers[:at])]
    return [(TRAINERS[name], {key: given[key] for key in given if key in names[name]}) for name in takers]


def check_rows(X: NDArray[np.generic], labels: NDArray[np.intp], n_classes: int, weights: Floats | None) -> None:
    """Raise TrainingError unless these arguments form a valid training set."""
    if X.ndim != 2 or len(X) == 0 or labels.shape != (len(X),):
        raise TrainingError(f"inputs {X.shape} and labels {labels.shape} must be (n, d) and (n,) with at least one row")
    if labels.min() < 0 or labels.max() >= n_classes:
        raise TrainingError(f"labels run from {labels.min()} to {labels.max()}, classes from 0 to {n_classes - 1}")
    if weights is not None:
        check_weights(weights, len(X))
    if X.dtype.kind == "f" and np.isinf(X).any():
        row, column = np.argwhere(np.isinf(X))[0]
        raise TrainingError(f"row {row}, column {column} is infinite; a joint angle is finite or NaN for missing")


def check_weights(weights: Floats, n: int) -> None:
    """Raise TrainingError unless these are valid weights of n rows."""
    if weights.shape != (n,) or not (np.isfinite(weights).all() and (weights >= 0).all() and weights.any()):
        raise TrainingError("row weights must be (n,) finite, non-negative numbers, not all zero")

"""The shape of a trainer, and the registry of all trainers."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from thenar.drivers.errors import ThenarError
from thenar.drivers.members import Members
from thenar.runtime.manifest import AUTO, Fitting, Options

if TYPE_CHECKING:
    from ..samples import Samples
    from ..tables.collapse import Model

Report = Callable[[int, int], None]
Number = float | int | str | None


class TrainerError(ThenarError, ValueError):
    """A setting that a trainer does not take, or a value that is out of its range."""


@dataclass(frozen=True, slots=True)
class Setting:
    """A number, or one of a few names, that a trainer takes: `--name` on the command line, with hyphens.

    Parameters
    ----------
    name : str
        An identifier, such as "max_bins".
    what : str
        The sentence of `--help`.
    kind : type
        int, float, or str.
    default : int, float, str or None
        Without a value; None is a value of its own.
    least, most : int or float, optional
        The least and the largest number that make sense.
    names : tuple of str, optional
        The values of a str.

    Examples
    --------
    >>> from thenar.compiler import TRAINERS
    >>> [setting.name for setting in TRAINERS["logitboost"].settings]
    ['rounds', 'shrinkage', 'tolerance', 'max_bins', 'ties']
    """

    name: str
    what: str
    kind: type[int] | type[float] | type[str]
    default: Number
    least: float | None = None
    most: float | None = None
    names: tuple[str, ...] = ()

    def checked(self, value: Number) -> Number:
        """Return the value as one of its kind. Raises TrainerError for one that makes no sense."""
        if value is None:
            return None
        if self.names or isinstance(value, str):
            if value not in self.names:
                wanted = f"one of {', '.join(self.names)}" if self.names else "a number"
                raise TrainerError(f"{self.name}={value!r} must be {wanted}")
            return value
        if self.least is not None and not value >= self.least:
            raise TrainerError(f"{self.name}={value} must be at least {self.least}")
        if self.most is not None and not value <= self.most:
            raise TrainerError(f"{self.name}={value} must be at most {self.most}")
        return self.kind(value)


class Trainer(ABC):
    """What makes an additive model: scores that are a sum over inputs, F_k(x) = b_k + `sum over i of T_i[x_i][k]`.

    A member of `TRAINERS` is an instance, that a module of this folder defines as `MEMBER`.

    Attributes
    ----------
    name : str
        How people choose it: `--trainer NAME`.
    what : str
        A sentence about it, for `--help`.
    settings : tuple of Setting
        The numbers that it takes. Trainers that share a name share its meaning.
    tried : tuple of mapping
        Settings, by name, of the ways to train that are compared where a trainer and its settings are chosen; the
        others have their defaults. The most regular first. Empty: only who names the trainer gets it.
    staged : bool
        Whether it takes `rounds`, and one training gives the models of all smaller numbers of rounds as well.
    """

    name: str
    what: str
    settings: tuple[Setting, ...] = ()
    tried: tuple[Mapping[str, Number], ...] = ({},)
    staged: bool = False

    @abstractmethod
    def train(self, samples: "Samples", settings: Mapping[str, Any], report: Report | None = None) -> "Model":
        """Return a model of `samples`.

        Parameters
        ----------
        samples : Samples
            The rows to learn from: the kept switches (n, s), the joints' codes (n, j), and labels (n,).
        settings : mapping
            A value for each of the trainer's `settings`.
        report : callable, optional
            Called with (done, total) as the work goes on.

        Returns
        -------
        ScoreTables or Stumps
            A model of these s switches and j joints, with a class for each of `samples.grasps`. It is a function of
            the samples and settings alone, to the last bit.
        """

    def stages(self, samples: "Samples", settings: Mapping[str, Any], rounds: Sequence[int]) -> "tuple[Model, ...]":
        """Return a model for each of these numbers of rounds, of one training; see `train`.

        Staged trainers override it. Each model is the one that `train` makes for that many rounds, to the last bit; a
        trainer without stages has the same one for all.
        """
        return (self.train(samples, settings),) * len(rounds)

    def candidates(self, given: Mapping[str, Number]) -> tuple[dict[str, Number], ...]:
        """Return values for all settings, for each way to train that is compared where these settings are `given`.

        Raises TrainerError for a setting that it does not take, or a value that is out of its range.
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

        Raises TrainerError for a setting that it does not take, or a value that is out of its range.
        """
        settings = {setting.name: setting for setting in self.settings}
        values: dict[str, Number] = {}
        for name, value in given.items():
            if name not in settings:
                raise TrainerError(f"trainer {self.name!r} takes no setting {name!r}: leave it out")
            values[name] = settings[name].checked(value)
        return values


def changed(options: Options, changes: Mapping[str, Any]) -> Options:
    """Return `options` with other values, by name; what is no option is a setting of the trainer."""
    fields = {name: value for name, value in changes.items() if name in Options.__struct_fields__}
    settings = {name: value for name, value in changes.items() if name not in fields}
    asked = replace(options, **fields)
    return replace(asked, settings={**asked.settings, **settings})


TRAINERS: Members[Trainer] = Members("trainer", Trainer, "thenar.compiler.trainers", "thenar.trainers")  # type: ignore[type-abstract]


# Options that are settings of some trainers. None is not given.
SHARED = ("rounds", "shrinkage", "tolerance", "max_bins")


@dataclass(frozen=True, slots=True)
class Training:
    """A trainer by its name, and values for all its settings: what a worker process needs to train; `masked`: it learns
    from rows in which inputs are lost as well.
    """

    trainer: str
    settings: Mapping[str, Number]
    masked: bool = False

    @classmethod
    def of(cls, options: Options) -> "Training":
        """Return what `options` ask for, with defaults for what they leave open: of LogitBoost, the paper's, where they
        leave open the trainer. Raises MemberError or TrainerError where that makes no sense.
        """
        trainer, given = _asked(options)[0]
        return cls(
            trainer.name,
            {setting.name: setting.default for setting in trainer.settings} | trainer.checked(given),
            options.robust,
        )

    @classmethod
    def candidates(cls, options: Options) -> "tuple[Training, ...]":
        """Return every way to train that `options` leave open, to be compared: one, where they leave none open.

        Raises MemberError or TrainerError where that makes no sense.
        """
        asked = _asked(options)
        if options.trainer == AUTO and len(asked) > 1:
            asked = [(trainer, given) for trainer, given in asked if trainer.tried]
        return tuple(
            cls(trainer.name, values, options.robust)
            for trainer, given in asked
            for values in trainer.candidates(given)
        )

    @classmethod
    def chosen(cls, fitting: Fitting, *, masked: bool = False) -> "Training":
        """Return the way that was chosen."""
        return cls(fitting.trainer, TRAINERS.named(fitting.trainer).checked(fitting.settings), masked)

    def train(self, samples: "Samples", report: Report | None = None) -> "Model":
        """Return the trainer's model of `samples`."""
        return TRAINERS.named(self.trainer).train(self._rows(samples), self.settings, report)

    def stages(self, samples: "Samples", rounds: Sequence[int]) -> "tuple[Model, ...]":
        """Return the trainer's models of `samples` after each of these numbers of rounds."""
        return TRAINERS.named(self.trainer).stages(self._rows(samples), self.settings, rounds)

    def _rows(self, samples: "Samples") -> "Samples":
        return samples.masked() if self.masked else samples


def _asked(options: Options) -> list[tuple[Trainer, dict[str, Number]]]:
    """Return the trainers that may make the model, and the settings that are given to each.

    A given setting that some trainers do not take is meant for the simplest that does, with fewer settings than those
    after it: `rounds` for LogitBoost, and not for a trainer that boosts and does more.
    """
    shared = {name: value for name in SHARED if (value := getattr(options, name)) is not None}
    if options.trainer != AUTO:
        trainer = TRAINERS.named(options.trainer)
        own = {setting.name for setting in trainer.settings}
        return [(trainer, {name: value for name, value in shared.items() if name in own} | options.settings)]
    given: dict[str, Number] = shared | options.settings
    names = {trainer.name: {setting.name for setting in trainer.settings} for trainer in TRAINERS.values()}
    takers = [name for name in names if names[name] >= given.keys()]
    if not takers:
        lacking = sorted(given.keys() - set().union(*names.values()))
        wrong = (
            f"no trainer takes the setting {lacking[0]!r}"
            if lacking
            else f"no trainer takes all of {', '.join(sorted(given))}"
        )
        raise TrainerError(f"{wrong}: leave it out")
    if len(takers) < len(names):
        size = {name: len(names[name]) for name in takers}
        takers = [name for at, name in enumerate(takers) if not any(size[one] < size[name] for one in takers[:at])]
    return [(TRAINERS[name], given) for name in takers]

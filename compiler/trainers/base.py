"""The shape of a trainer, and the registry of all trainers."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from thenar.drivers.errors import ThenarError
from thenar.drivers.members import Members
from thenar.runtime.manifest import Options

if TYPE_CHECKING:
    from ..samples import Samples
    from ..tables.collapse import Model

Report = Callable[[int, int], None]
Number = float | int | None


class TrainerError(ThenarError, ValueError):
    """A setting that a trainer does not take, or a value that is out of its range."""


@dataclass(frozen=True, slots=True)
class Setting:
    """A number that a trainer takes: `--name` on the command line, with hyphens.

    Parameters
    ----------
    name : str
        An identifier, such as "max_bins".
    what : str
        The sentence of `--help`.
    kind : type
        int or float.
    default : int, float or None
        Without a value; None is a value of its own.
    least, most : int or float, optional
        The least and the largest value that make sense.

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


class Trainer(ABC):
    """What makes an additive model: scores that are a sum over inputs, F_k(x) = b_k + sum over i of T_i[x_i][k].

    A member of `TRAINERS` is an instance, that a module of this folder defines as `MEMBER`.

    Attributes
    ----------
    name : str
        How people choose it: `--trainer NAME`.
    what : str
        A sentence about it, for `--help`.
    settings : tuple of Setting
        The numbers that it takes. Trainers that share a name share its meaning.
    staged : bool
        Whether it takes `rounds`, and one training gives the models of all smaller numbers of rounds as well.
    """

    name: str
    what: str
    settings: tuple[Setting, ...] = ()
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

    def given(self, options: Options) -> dict[str, Number]:
        """Return a value for each setting, as `options` give them. Raises TrainerError for what it does not take."""
        unknown = sorted(set(options.settings) - {setting.name for setting in self.settings})
        if unknown:
            raise TrainerError(f"trainer {self.name!r} takes no setting {unknown[0]!r}: leave it out")
        values: dict[str, Number] = {}
        for setting in self.settings:
            given = options.settings.get(setting.name, setting.default)
            value = getattr(options, setting.name, given)
            if value is not None and setting.least is not None and not value >= setting.least:
                raise TrainerError(f"{setting.name}={value} must be at least {setting.least}")
            if value is not None and setting.most is not None and not value <= setting.most:
                raise TrainerError(f"{setting.name}={value} must be at most {setting.most}")
            values[setting.name] = None if value is None else setting.kind(value)
        return values


def changed(options: Options, changes: Mapping[str, Any]) -> Options:
    """Return `options` with other values, by name; what is no option is a setting of the trainer."""
    fields = {name: value for name, value in changes.items() if name in Options.__struct_fields__}
    settings = {name: value for name, value in changes.items() if name not in fields}
    asked = replace(options, **fields)
    return replace(asked, settings={**asked.settings, **settings})


TRAINERS: Members[Trainer] = Members("trainer", Trainer, "thenar.compiler.trainers", "thenar.trainers")  # type: ignore[type-abstract]


@dataclass(frozen=True, slots=True)
class Training:
    """A trainer by its name, and values for all its settings: what a worker process needs to train."""

    trainer: str
    settings: Mapping[str, Number]

    @classmethod
    def of(cls, options: Options) -> "Training":
        """Return what `options` ask for. Raises MemberError or TrainerError where that makes no sense."""
        return cls(options.trainer, TRAINERS.named(options.trainer).given(options))

    def train(self, samples: "Samples", report: Report | None = None) -> "Model":
        """Return the trainer's model of `samples`."""
        return TRAINERS.named(self.trainer).train(samples, self.settings, report)

    def stages(self, samples: "Samples", rounds: Sequence[int]) -> "tuple[Model, ...]":
        """Return the trainer's models of `samples` after each of these numbers of rounds."""
        return TRAINERS.named(self.trainer).stages(samples, self.settings, rounds)

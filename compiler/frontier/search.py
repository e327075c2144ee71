"""What the frontier tries: placements under which parameters, inputs, rounds, widths, folds."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

from thenar.runtime.manifest import AUTO, PAPERS_TRAINER, Inputs, Options, TableBits

from ..placement.elements import LEVELS
from ..placement.methods.base import METHODS, usual
from ..trainers.base import TRAINERS, Number, Training, changed
from .points import FrontierError, PlacementChoice

# Baselines are only seen beside ours: a few sizes show their curves.
CURVE_SIZES = (4, 8, 16, 33, 66)
# The placement of inputs without switches.
NO_SWITCHES = PlacementChoice("none", 0.0)
USUAL_BASELINES = ("rfe", "forest", "mrmr", "mutual-information", "random", "sspoc", "qr")
ROUNDS = (1, 2, 3, 5, 8, 12, 20, 30, 50, 75, 100, 150, 200, 300)


class Shape(NamedTuple):
    """How integers are cut: no sum needs more than `width` bits; with table_bits 8 no look-up spans more than 255."""

    width: int
    table_bits: TableBits = 16


SHAPES = (*(Shape(width) for width in (16, 12, 8, 6, 5, 4)), Shape(16, 8))
# So many levels of each taxel there are to choose from, at most.
TAXEL_LEVELS = (1, 3, LEVELS)
# So many joints are tried besides all of them.
JOINTS = (2, 3, 4, 5, 6, 7, 8, 10, 12, 16)
# Rounds of whose ensembles integer tables are made, in every shape.
TABLED = (10, 30, 100)


# A method, whether it looks at the joints, and how many levels of a taxel it chooses from.
Choosing = tuple[str, bool, int | None]


@dataclass(frozen=True, slots=True)
class Candidate:
    """A way to choose elements, whether the joints are read besides, who trains, how many joints are kept (None: all),
    and how many levels of a taxel there are to choose from (None: no taxel is read); inputs "joints" have NO_SWITCHES.
    """

    placement: PlacementChoice
    inputs: Inputs
    trainer: str = PAPERS_TRAINER
    keep_joints: int | None = None
    levels: int | None = None

    @property
    def joints(self) -> bool:
        """Whether the joints are read."""
        return self.inputs != "switches"

    @property
    def learns_from_joints(self) -> bool:
        """Whether its switches are chosen by the joints as well."""
        return self.inputs == "both" and METHODS[self.placement.method].uses_joints

    @property
    def chosen_by(self) -> Choosing:
        """The method, whether it looks at the joints, and the levels that it chooses from."""
        return self.placement.method, self.learns_from_joints, self.levels


@dataclass(frozen=True, slots=True)
class Search:
    """How much is tried.

    Parameters
    ----------
    methods : tuple of str
        Placement methods that points are built from.
    baselines : tuple of str
        Placement methods of which only curves are seen beside those.
    folds, repeats, seed : int
        The stratified folds are cut `repeats` times, with seeds seed, seed + 1, ...
    screening : int
        Rounds with which every placement is screened, on the folds of the first repeat.
    rounds : int
        The most rounds that those on the front are trained for. A trainer without stages has one, and trains once.
    finalists : int
        The most placements that are looked at closely.
    by : {"subject", "trial"}, optional
        Whether points are chosen by subjects who are left out, or by trials of everybody; none given: by subjects where
        there are several.
    trainer : str
        What makes the models; "auto": each of the trainers that take the settings.
    settings : mapping
        Settings that are given, but for rounds.

    Raises
    ------
    MemberError
        For a method or a trainer that is not there.
    TrainerError
        For a setting that the trainer does not take.
    FrontierError
        Where nothing could come of it.
    """

    methods: tuple[str, ...] = field(default_factory=lambda: usual(ours=True))
    baselines: tuple[str, ...] = field(default_factory=lambda: usual(ours=False))
    folds: int = 4
    repeats: int = 3
    seed: int = 1
    screening: int = 60
    rounds: int = 300
    finalists: int = 12
    by: Literal["subject", "trial"] | None = None
    trainer: str = AUTO
    settings: Mapping[str, Number] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        for name in (*self.methods, *self.baselines):
            METHODS.named(name)
        if min(self.repeats, self.screening, self.rounds, self.finalists) < 1 or not self.methods:
            raise FrontierError("a frontier needs a method, a repeat, a round and a finalist at least")
        _ = self.training

    @property
    def trainers(self) -> tuple[str, ...]:
        """Who trains, the paper's trainer first; the other properties are of the first: see `alone`."""
        if self.trainer != AUTO:
            return (self.trainer,)
        names = dict.fromkeys(each.trainer for each in Training.candidates(self._asked(AUTO)))
        return tuple(sorted(names, key=lambda name: name != PAPERS_TRAINER))

    def alone(self, trainer: str) -> "Search":
        """Return the same search with one of its trainers."""
        return replace(self, trainer=trainer)

    @property
    def training(self) -> Training:
        """The trainer, and values for all its settings, of which those not given are defaults."""
        return Training.of(self._asked(self.trainers[0]))

    @property
    def candidates(self) -> tuple[Training, ...]:
        """Every way to train that the settings leave open; rounds are no part of it, where there are stages."""
        usual = {"rounds": self.training.settings["rounds"]} if self.staged else {}
        every = Training.candidates(self._asked(self.trainers[0]))
        found = {
            tuple(one.settings.items()): one for one in (Training(e.trainer, {**e.settings, **usual}) for e in every)
        }
        return tuple(found.values())

    def _asked(self, trainer: str) -> Options:
        return changed(Options(), {"trainer": trainer, **self.settings})

    @property
    def staged(self) -> bool:
        """Whether there are several numbers of rounds to try."""
        return TRAINERS.named(self.trainers[0]).staged

    @property
    def screened(self) -> int:
        """The rounds of screening: no more than those on the front are trained for."""
        return min(self.screening, self.stages[-1])

    @property
    def stages(self) -> tuple[int, ...]:
        """The numbers of rounds whose rates are taken from one training."""
        return self._up_to_last(ROUNDS)

    @property
    def tabled(self) -> tuple[int, ...]:
        """The numbers of rounds of which integer tables are made."""
        return self._up_to_last(TABLED)

    def _up_to_last(self, rounds: tuple[int, ...]) -> tuple[int, ...]:
        return (*(each for each in rounds if each < self.rounds), self.rounds) if self.staged else (1,)


def tried_placements(method: str, n_switches: int) -> tuple[PlacementChoice, ...]:
    """Return the placements of a method that are tried among so many switches."""
    return tuple(PlacementChoice(method, float(parameter)) for parameter in METHODS[method].ladder(n_switches))


def curve_placements(method: str, n_switches: int) -> tuple[PlacementChoice, ...]:
    """Return the placements of a baseline that its curve goes through."""
    return tuple(PlacementChoice(method, float(size)) for size in CURVE_SIZES if size <= n_switches)


def available_inputs(n_switches: int, n_joints: int) -> tuple[Inputs, ...]:
    """Return which inputs a set has; joints alone need no placement."""
    kinds: list[Inputs] = []
    if n_switches:
        kinds.append("switches")
    if n_joints:
        kinds.append("joints")
    return ("both", *kinds) if len(kinds) == 2 else tuple(kinds)

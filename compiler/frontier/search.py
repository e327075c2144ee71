"""The search space of the frontier: placements and their parameters, inputs, rounds, widths, folds.

A candidate is a `Recipe`: its placement with its number, its inputs, and its trainer; then its rounds, and the shape of
its tables.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from msgspec.structs import replace as changed_to

from thenar.runtime.recipe import AUTO, PAPERS_TRAINER, Inputs, Recipe, changed

from ..placement.elements import LEVELS
from ..placement.methods.base import FINE, METHODS, usual
from ..placement.sensors import SENSORS
from ..trainers.base import TRAINERS, Number, Training
from .points import FrontierError, PlacementChoice

ROUNDS = (1, 2, 3, 5, 8, 12, 20, 30, 50, 75, 100, 150, 200, 300)
PAPERS_ROUNDS = 100  # no point of our frontiers has more
# The shapes of integer tables: the bits that every sum fits; and one in which a byte is enough for an entry of a line.
SHAPES = (*(Recipe(width=width) for width in (16, 12, 8, 6, 5, 4)), Recipe(table_bits=8))
# The numbers of levels of each taxel to choose from, at most.
TAXEL_LEVELS = (1, 3, LEVELS)
# The numbers of joints that are tried in addition to all of them.
JOINTS = (2, 3, 4, 5, 6, 7, 8, 10, 12, 16)
# Rounds of whose ensembles integer tables are made, in every shape.
TABLED = (10, 30, 100)


def placed(method: str, number: int, trainer: str, inputs: Inputs, levels: int | None = None) -> Recipe:
    """Return the candidate whose elements a method chooses, given its number, and the levels of a taxel."""
    recipe = Recipe(placement=method, trainer=trainer, inputs=inputs, levels=levels)
    return changed_to(recipe, keep=number) if METHODS[method].by_number else changed_to(recipe, prune=number)


def placement_of(recipe: Recipe) -> PlacementChoice:
    """Return the placement of a candidate as a frontier writes it; of joints alone, none."""
    if recipe.sensors is not None:
        return PlacementChoice(SENSORS, float(recipe.sensors))
    if recipe.inputs == "joints":
        return PlacementChoice("none", 0.0)
    by_number = METHODS[recipe.placement].by_number
    return PlacementChoice(recipe.placement, float(recipe.keep or 0 if by_number else recipe.prune))


def tabled(recipe: Recipe, rounds: int, shape: Recipe = SHAPES[0]) -> Recipe:
    """Return a candidate of this number of rounds, and tables of this shape."""
    return changed_to(recipe, rounds=rounds, width=shape.width, table_bits=shape.table_bits)


@dataclass(frozen=True, slots=True)
class Search:
    """The size of a search.

    Parameters
    ----------
    methods : tuple of str
        Placement methods that points are built from.
    sensors : int, optional
        Build points from the best sensors instead, at most this many: switches, pads and joints in one pool.
    price : float, optional
        The same, as many as this pays for.
    folds, repeats, seed : int
        The stratified folds are cut `repeats` times, with seeds seed, seed + 1, ...
    screening : int
        Rounds for screening every placement, on the folds of the first repeat.
    rounds : int
        The most rounds for finalists. A trainer without stages has one, and trains once.
    finalists : int
        The most placements to evaluate fully.
    by : {"subject", "trial"}, optional
        Whether points are chosen by left-out subjects, or by trials of all subjects; by default by subjects if there
        are several.
    trainer : str
        The trainer of the models; "auto": each of the trainers that take the settings.
    settings : mapping
        Given settings, except for rounds.

    Raises
    ------
    SettingError
        For an unknown method or trainer.
    TrainingError
        For a setting that the trainer does not take.
    FrontierError
        If the search would be empty.
    """

    methods: tuple[str, ...] = field(default_factory=lambda: usual())
    folds: int = 4
    repeats: int = 3
    seed: int = 1
    screening: int = 60
    rounds: int = PAPERS_ROUNDS
    finalists: int = 12
    by: Literal["subject", "trial"] | None = None
    sensors: int | None = None
    price: float | None = None
    trainer: str = AUTO
    settings: Mapping[str, Number] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        for name in self.methods:
            METHODS.named(name)
        if min(self.repeats, self.screening, self.rounds, self.finalists) < 1 or not self.methods:
            raise FrontierError("a frontier needs a method, a repeat, a round and a finalist at least")
        _ = self.training

    @property
    def by_sensors(self) -> bool:
        """Whether points are built from the best sensors, not by methods."""
        return self.sensors is not None or self.price is not None

    def numbers(self, there: int) -> tuple[int, ...]:
        """Return the numbers of sensors that are tried of those that are there, or that are paid for."""
        most = min(there, self.sensors or there)
        return (*(number for number in FINE if number < most), most)

    @property
    def trainers(self) -> tuple[str, ...]:
        """The trainers, the paper's first; the other properties describe the first: see `alone`."""
        if self.trainer != AUTO:
            return (self.trainer,)
        recipe = self._recipe(AUTO)
        # The first that takes the settings is the paper's, which is compared with those that are chosen automatically.
        names = [training.trainer for training in (Training.of(recipe), *Training.candidates(recipe))]
        return tuple(sorted(dict.fromkeys(names), key=lambda name: name != PAPERS_TRAINER))

    def alone(self, trainer: str) -> "Search":
        """Return the same search with one of its trainers."""
        return replace(self, trainer=trainer)

    @property
    def training(self) -> Training:
        """The trainer, and values for all its settings: those given, and defaults."""
        return Training.of(self._recipe(self.trainers[0]))

    @property
    def candidates(self) -> tuple[Training, ...]:
        """All trainings that the settings leave open; trainers with stages are not varied by rounds."""
        usual = {"rounds": self.training.settings["rounds"]} if self.staged else {}
        several = Training.candidates(self._recipe(self.trainers[0]))
        several = tuple(Training(one.trainer, {**one.settings, **usual}) for one in several)
        return tuple(one for number, one in enumerate(several) if one not in several[:number])

    def _recipe(self, trainer: str) -> Recipe:
        return changed(Recipe(), {"trainer": trainer, **self.settings})

    @property
    def staged(self) -> bool:
        """Whether there are several numbers of rounds to try."""
        return TRAINERS.named(self.trainers[0]).staged

    @property
    def screened(self) -> int:
        """The rounds of screening: at most those of the finalists."""
        return min(self.screening, self.stages[-1])

    @property
    def stages(self) -> tuple[int, ...]:
        """The numbers of rounds that are evaluated in one training."""
        return self._up_to_last(ROUNDS)

    @property
    def tabled(self) -> tuple[int, ...]:
        """The numbers of rounds of which integer tables are made."""
        return self._up_to_last(TABLED)

    def _up_to_last(self, rounds: tuple[int, ...]) -> tuple[int, ...]:
        return (*(number for number in rounds if number < self.rounds), self.rounds) if self.staged else (1,)

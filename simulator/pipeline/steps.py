"""The steps of a scene, compiled once to a list, and the cost of each step.

Effects that the scene does not list are not imported; no step asks whether it is enabled.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter_ns
from typing import Any, Self

from ..contact.model import ContactModel
from ..errors import SceneError
from ..scenes.scene import Scene
from ..streams import Draw
from .batch import Batch
from .effect import EFFECTS, Effect, SceneSetting, Together
from .glove import STEPS, TAXEL_STEPS, rest_step


@dataclass(slots=True)
class StepCost:
    """The costs of one step so far.

    own          True for a step that every scene has, False for an effect that the scene lists
    calls        batches
    grasps       repetitions in them
    draws        random numbers
    nanoseconds  wall time
    counters     the step's own counts: solver steps, bytes sent, ...
    """

    own: bool
    calls: int = 0
    grasps: int = 0
    draws: int = 0
    nanoseconds: int = 0
    counters: Counter[str] = field(default_factory=Counter)

    def add(self, other: Self) -> None:
        """Add another worker's entry of the same step."""
        self.calls += other.calls
        self.grasps += other.grasps
        self.draws += other.draws
        self.nanoseconds += other.nanoseconds
        self.counters.update(other.counters)


@dataclass(slots=True)
class Ledger:
    """The entries by the name of the step, in the order in which the steps first ran."""

    entries: dict[str, StepCost] = field(default_factory=dict)

    def enter(self, name: str, own: bool, calls: int, grasps: int, nanoseconds: int, draws: Counter[str]) -> None:
        """Record `calls` calls of step `name`, one batch each, with `grasps` repetitions in total.

        `draws` holds the number of random numbers under that name, and the step's own counts under other names.
        """
        counters = draws.copy()
        drawn = counters.pop(name, 0)
        self._add(name, StepCost(own, calls, grasps, drawn, nanoseconds, counters))

    def merge(self, other: Self) -> None:
        """Add another worker's ledger."""
        for name, entry in other.entries.items():
            self._add(name, entry)

    @property
    def nanoseconds(self) -> int:
        """The time of all steps together."""
        return sum(entry.nanoseconds for entry in self.entries.values())

    def _add(self, name: str, entry: StepCost) -> None:
        self.entries.setdefault(name, StepCost(entry.own)).add(entry)


# The default contact model: every scene needs one.
DEFAULT_CONTACT = "contact.quasistatic"


@dataclass(frozen=True, slots=True)
class PipelineStep:
    """One step of a pipeline; `own` if every scene has it."""

    effect: Effect
    act: Together
    own: bool


@dataclass(frozen=True, slots=True)
class Pipeline:
    """The steps of a scene, in order."""

    setting: SceneSetting
    steps: tuple[PipelineStep, ...]

    def run(self, batches: Sequence[Batch], ledger: Ledger) -> None:
        """Run all steps on batches, and record the cost of each step in the ledger.

        Batches are processed together, which saves time in the contact model; they are independent of each other.
        """
        repetitions = sum(map(len, batches))
        for step in self.steps:
            draws = Counter[str]()
            sites = [Draw(self.setting.seed, step.effect.name, batch.site(), draws) for batch in batches]
            began = perf_counter_ns()
            step.act(batches, sites)
            ledger.enter(step.effect.name, step.own, len(batches), repetitions, perf_counter_ns() - began, draws)


def _closing(model: ContactModel) -> Together:
    def act(batches: Sequence[Batch], draws: Sequence[Draw]) -> None:
        contacts = model([batch.load() for batch in batches])
        for batch, contact, draw in zip(batches, contacts, draws, strict=True):
            batch.take(contact)
            draw.count("solver steps", contact.steps)

    return act


def compile_pipeline(scene: Scene) -> Pipeline:
    """Return the steps of `scene`.

    Raises SceneError if effects have impossible parameters; MissingPackageError if one needs a package that is not
    installed.
    """
    listed: dict[str, Mapping[str, Any]] = {name: dict(parameters) for name, parameters in scene.effects}
    effects = {name: EFFECTS[name] for name in listed}
    models = [effect for effect in effects.values() if effect.model is not None]
    if default := not models:
        models = [EFFECTS[DEFAULT_CONTACT]]
        listed[DEFAULT_CONTACT] = {}
    effects[models[0].name] = models[0]
    setting = SceneSetting.of(scene, effects.values())
    for name, effect in effects.items():
        if not setting.taxels and {"taxels", "taxels_n"} & {*effect.writes}:
            raise SceneError(f'effects.{name}: the glove has no taxels: list them in [glove], as in taxels = "all"')
    steps = [PipelineStep(effect, _prepared(effect, {}, setting), own=True) for effect in _own_steps(listed, setting)]
    assert models[0].model is not None
    model = models[0].model(setting, **listed[models[0].name])
    for name, effect in effects.items():
        if effect is models[0]:
            steps.append(PipelineStep(effect, _closing(model), own=default))
        elif effect.together is not None:
            steps.append(PipelineStep(effect, effect.together(setting, model, **listed[name]), own=False))
        else:
            steps.append(PipelineStep(effect, _prepared(effect, listed[name], setting), own=False))
    return Pipeline(setting, tuple(sorted(steps, key=lambda step: (step.effect.order, step.effect.name))))


def _own_steps(listed: Mapping[str, Mapping[str, Any]], setting: SceneSetting) -> Iterator[Effect]:
    yield from STEPS
    if setting.taxels:
        yield from TAXEL_STEPS
    if setting.on_wire:
        from .wire import RECEIVE, SEND

        yield from (SEND, RECEIVE)
    if setting.rest is not None:
        yield rest_step(listed, setting)


def _prepared(effect: Effect, parameters: Mapping[str, Any], setting: SceneSetting) -> Together:
    if effect.prepare is None:
        raise SceneError(f"effect {effect.name!r} has no step: give its record a `prepare`")
    step = effect.prepare(setting, **parameters)

    def act(batches: Sequence[Batch], draws: Sequence[Draw]) -> None:
        for batch, draw in zip(batches, draws, strict=True):
            step(batch, draw)

    return act

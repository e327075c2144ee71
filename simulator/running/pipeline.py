"""The pipeline: a scene, compiled once to a list of steps, and the cost of each step.

Effects that the scene does not list are not imported; no step asks whether it is enabled.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from time import perf_counter_ns
from typing import Self

from thenar.runtime.names import nearest

from ..contact.model import ContactModel
from ..errors import SceneError
from ..pipeline.batch import Batch
from ..pipeline.effect import EFFECTS, Effect, Place, Setting, Step, Together, in_order
from ..pipeline.glove import STEPS
from ..pipeline.rest import resting
from ..pipeline.taxels import STEPS as TAXEL_STEPS
from ..scenes.scene import Scene
from ..streams import Draw, Draws


@dataclass(slots=True)
class Cost:
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

    entries: dict[str, Cost] = field(default_factory=dict)

    def enter(self, name: str, own: bool, calls: int, grasps: int, nanoseconds: int, draws: Draws) -> None:
        """Record `calls` calls of step `name`, one batch each, with `grasps` repetitions in total.

        `draws` holds the number of random numbers under that name, and the step's own counts under other names.
        """
        counters = draws.counts.copy()
        drawn = counters.pop(name, 0)
        self._add(name, Cost(own, calls, grasps, drawn, nanoseconds, counters))

    def merge(self, other: Self) -> None:
        """Add another worker's ledger."""
        for name, entry in other.entries.items():
            self._add(name, entry)

    @property
    def nanoseconds(self) -> int:
        """The time of all steps together."""
        return sum(entry.nanoseconds for entry in self.entries.values())

    def _add(self, name: str, entry: Cost) -> None:
        self.entries.setdefault(name, Cost(entry.own)).add(entry)


# The default contact model: every scene needs one.
DEFAULT_CONTACT = "contact.quasistatic"


@dataclass(frozen=True, slots=True)
class Stop:
    """One step of a pipeline; `own` if every scene has it."""

    effect: Effect
    act: Together
    own: bool


@dataclass(frozen=True, slots=True)
class Pipeline:
    """The steps of a scene, in order."""

    setting: Setting
    stops: tuple[Stop, ...]

    def run(self, batches: Sequence[Batch], ledger: Ledger) -> None:
        """Run all steps on batches, and record the cost of each step in the ledger.

        Batches are processed together, which saves time in the contact model; they are independent of each other.
        """
        repetitions = sum(map(len, batches))
        for stop in self.stops:
            draws = Draws()
            sites = [Draw(self.setting.seed, stop.effect.name, batch.site(), draws) for batch in batches]
            began = perf_counter_ns()
            stop.act(batches, sites)
            ledger.enter(stop.effect.name, stop.own, len(batches), repetitions, perf_counter_ns() - began, draws)


def _each(step: Step) -> Together:
    def act(batches: Sequence[Batch], draws: Sequence[Draw]) -> None:
        for batch, draw in zip(batches, draws, strict=True):
            step(batch, draw)

    return act


def _closing(model: ContactModel) -> Together:
    def act(batches: Sequence[Batch], draws: Sequence[Draw]) -> None:
        contacts = model.solve([batch.load() for batch in batches])
        for batch, contact, draw in zip(batches, contacts, draws, strict=True):
            batch.take(contact)
            draw.count("solver steps", contact.steps)

    return act


def compile_pipeline(scene: Scene, without: str | None = None) -> Pipeline:
    """Return the steps of `scene`, except for the listed effect `without`.

    Raises SceneError if effects have impossible parameters; MissingPackageError if one needs a package that is not
    installed.
    """
    listed = list(_listed(scene, without))
    setting = scene.setting(place.effect for place in listed)
    _check_taxels(listed, setting)
    own = [Place(effect, own=True) for effect in _own_steps(setting)]
    if setting.rest is not None:
        own.append(resting({place.effect.name: place.parameters for place in listed}, setting))
    ordered = in_order([*own, *listed])
    acts = {place.effect.name: _prepared(place, setting) for place in own}
    closing = next(place for place in listed if place.effect.model is not None)
    assert closing.effect.model is not None
    model = closing.effect.model(closing.parameters, setting)
    acts[closing.effect.name] = _closing(model)
    for place in listed:
        if place.effect.together is not None:
            acts[place.effect.name] = place.effect.together(place.parameters, setting, model)
        elif place is not closing:
            acts[place.effect.name] = _prepared(place, setting)
    return Pipeline(setting, tuple(Stop(place.effect, acts[place.effect.name], place.own) for place in ordered))


def _listed(scene: Scene, without: str | None) -> Iterator[Place]:
    """Yield the effects that the scene lists, and the default contact model if it lists none."""
    names = [listed.name for listed in scene.effects]
    _check_without(names, without)
    closes = False
    for name, parameters in scene.effects:
        if name != without:
            place = Place(EFFECTS[name], own=False, parameters=parameters)
            closes = closes or place.effect.model is not None
            yield place
    if not closes:
        effect = EFFECTS[DEFAULT_CONTACT]
        yield Place(effect, own=True, parameters=effect.parameters())


def _check_without(names: list[str], without: str | None) -> None:
    if without is None:
        return
    if without not in names:
        raise SceneError(f"effect {without!r} cannot be left out: the scene does not list it{nearest(without, names)}")
    if without == DEFAULT_CONTACT:
        raise SceneError(f"effect {without!r} cannot be left out: without it nothing closes the hand on its object")


def _own_steps(setting: Setting) -> tuple[Effect, ...]:
    steps = (*STEPS, *TAXEL_STEPS) if setting.taxels else STEPS
    if not setting.on_wire:
        return steps
    from ..pipeline.wire import RECEIVE, SEND

    return (*steps, SEND, RECEIVE)


def _check_taxels(listed: Sequence[Place], setting: Setting) -> None:
    for place in listed:
        name = place.effect.name
        if not setting.taxels and {"taxels", "taxels_n"} & {*place.effect.writes}:
            raise SceneError(f'effects.{name}: the glove has no taxels: list them in [glove], as in taxels = "all"')


def _prepared(place: Place, setting: Setting) -> Together:
    effect = place.effect
    if effect.prepare is None:
        raise SceneError(f"effect {effect.name!r} has no step: give its record a `prepare`")
    return _each(effect.prepare(place.parameters, setting))

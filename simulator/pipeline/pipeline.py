"""The pipeline: what a scene calls for, compiled once into one list of steps, and nothing else.

The modules of effects that the scene does not list are not imported; no step asks whether it is enabled.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import perf_counter_ns

from thenar.compiler.recordings.names import nearest

from ..contact.model import ContactModel, load_of, take
from ..errors import SceneError
from ..scenes.scene import Scene
from ..streams import Draw, Draws, Site
from . import glove
from .batch import Batch
from .effect import Effect, EffectParameters, Setting, Step, Together
from .ledger import Ledger
from .ordering import Place, in_order
from .registry import CONTACTS, load

# What closes the hand on its object where the scene names no other: every scene needs one.
DEFAULT_CONTACT = "contact.quasistatic"
# The effect that asks the contact model again.
_RAMP = "contact.ramp"


@dataclass(frozen=True, slots=True)
class Stop:
    """One step of a pipeline; `own` if it is there whatever effects the scene lists."""

    effect: Effect
    act: Together
    own: bool


@dataclass(frozen=True, slots=True)
class Pipeline:
    """The steps of a scene, in order."""

    setting: Setting
    stops: tuple[Stop, ...]

    def run(self, batches: Sequence[Batch], ledger: Ledger) -> None:
        """Take batches through all steps, and enter in the ledger what each step cost.

        They go side by side, which saves time where hands are closed; none depends on which others are there.
        """
        repetitions = sum(map(len, batches))
        for stop in self.stops:
            draws = Draws()
            sites = [Draw(self.setting.seed, stop.effect.name, _site(batch), draws) for batch in batches]
            began = perf_counter_ns()
            stop.act(batches, sites)
            ledger.enter(stop.effect.name, stop.own, len(batches), repetitions, perf_counter_ns() - began, draws)


def _site(batch: Batch) -> Site:
    condition = batch.condition
    return Site(condition.subject, condition.grasp, condition.thing.name, batch.repetitions)


def _each(step: Step) -> Together:
    def act(batches: Sequence[Batch], draws: Sequence[Draw]) -> None:
        for batch, draw in zip(batches, draws, strict=True):
            step(batch, draw)

    return act


def _closing(model: ContactModel) -> Together:
    def act(batches: Sequence[Batch], draws: Sequence[Draw]) -> None:
        contacts = model.solve([load_of(batch) for batch in batches])
        for batch, contact, draw in zip(batches, contacts, draws, strict=True):
            take(batch, contact)
            draw.count("solver steps", contact.steps)

    return act


@dataclass(frozen=True, slots=True)
class _Part:
    """An effect that takes part, listed by the scene or (`own`) because there must be a contact model."""

    name: str
    parameters: EffectParameters
    effect: Effect
    own: bool


def compile_pipeline(scene: Scene, without: str | None = None) -> Pipeline:
    """Return the steps of `scene`, less the listed effect `without`.

    Raises SceneError where effects conflict, wait for one another in a circle, or cannot do with their parameters;
    SimMissingError where one needs a package that is not installed.
    """
    parts = list(_parts(scene, without))
    setting = scene.setting(tuple(part.effect for part in parts))
    own_steps = _own_steps(setting)
    places = [Place(effect, own=True) for effect, _ in own_steps]
    places += [Place(part.effect, part.own, _after(part, without)) for part in parts]
    ordered = in_order(places)
    steps = {effect.name: _each(make(setting)) for effect, make in own_steps} | _effect_steps(parts, setting)
    return Pipeline(setting, tuple(Stop(p.effect, steps[p.effect.name], p.own) for p in ordered))


def _parts(scene: Scene, without: str | None) -> Iterator[_Part]:
    names = [listed.name for listed in scene.effects]
    _check_without(names, without)
    for listed in scene.effects:
        if listed.name != without:
            yield _Part(listed.name, listed.parameters, load(listed.name).EFFECT, own=False)
    if not {*names} - {without} & {*CONTACTS}:
        module = load(DEFAULT_CONTACT)
        yield _Part(DEFAULT_CONTACT, module.Parameters(), module.EFFECT, own=True)


def _check_without(names: list[str], without: str | None) -> None:
    if without is None:
        return
    if without not in names:
        raise SceneError(f"effect {without!r} cannot be left out: the scene does not list it{nearest(without, names)}")
    if without == DEFAULT_CONTACT:
        raise SceneError(f"effect {without!r} cannot be left out: without it nothing closes the hand on its object")


def _after(part: _Part, without: str | None) -> tuple[str, ...]:
    return tuple(name for name in part.parameters.after if name != without)


def _own_steps(setting: Setting) -> tuple[glove.OwnStep, ...]:
    if not setting.on_wire:
        return glove.STEPS
    from .wire import RECEIVE, SEND

    return (*glove.STEPS, SEND, RECEIVE)


def _effect_steps(parts: list[_Part], setting: Setting) -> dict[str, Together]:
    closing = next(part for part in parts if part.name in CONTACTS)
    model: ContactModel = load(closing.name).model(closing.parameters, setting)
    steps = {closing.name: _closing(model)}
    for part in parts:
        if part.name == _RAMP:
            steps[part.name] = load(part.name).prepare(part.parameters, setting, model)
        elif part is not closing:
            steps[part.name] = _each(load(part.name).prepare(part.parameters, setting))
    return steps

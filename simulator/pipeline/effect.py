"""What an effect is: one record of one way to change a batch; and in which order effects and the glove's own steps act.

Such a module holds three things:

    class Parameters(EffectParameters)         what a scene may set, with defaults and limits
    def prepare(parameters, setting) -> Step   everything that is done once; the step does the rest, batch by batch
    MEMBER = Effect(...)                       its name, where it belongs, what it reads and writes, and these two

A contact model has `model(parameters, setting) -> ContactModel` instead of `prepare`. An effect that asks the contact
model again has `together(parameters, setting, contact) -> Together`.

`Effect.name` is the key of the scene: [effects.joint.noise] is "joint.noise", in the module effects/joint_noise.py.
Other packages add effects by entry points of that name in the group `thenar.effects`.

Stage by stage. Within a stage, an effect acts after the glove's own step that makes what it touches, and before the one
that reads what it alters; after those that `Effect.after` and the scene's `after` name; and else by its rank.
"""

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from thenar.drivers.members import MembersByName
from thenar.runtime.names import nearest

from ..contact.model import ContactModel
from ..errors import SceneError
from ..streams import Draw
from .batch import Batch

Stage = Literal["posture", "contact", "switch", "frame", "sense", "read", "wire"]
STAGES: tuple[Stage, ...] = ("posture", "contact", "switch", "frame", "sense", "read", "wire")

# What a contact model reads and writes of a batch (`Batch.load`, `Batch.take`).
CONTACT_READS = ("posture_deg", "pose", "grip_n")
CONTACT_WRITES = (
    *("posture_deg", "pose", "commanded_deg", "commanded_pose", "forces_n"),
    *("settled", "residual_n", "residual_nmm", "between_n"),
)

Step = Callable[[Batch, Draw], None]
# What is done with several batches at once, each with its draws.
Together = Callable[[Sequence[Batch], Sequence[Draw]], None]


class EffectParameters(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What every effect takes: names of effects that must act before it, beyond the usual order."""

    after: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Effect:
    """What the pipeline must know of an effect.

    place          among the effects of its stage, where nothing else decides
    reads, writes  fields of `Batch`
    after          effects that act before it when they are listed too
    conflicts      effects that cannot be listed beside it
    timed          True where the effect lives in time, so that whole streams of frames are simulated
    on_wire        True where it acts on bytes, so that frames are sent and received as bytes
    parameters     what a scene may set
    prepare, model, together   one of them makes what acts
    """

    name: str
    summary: str
    stage: Stage
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    place: int = 0
    after: tuple[str, ...] = ()
    conflicts: tuple[str, ...] = ()
    timed: bool = False
    on_wire: bool = False
    parameters: type[EffectParameters] = EffectParameters
    prepare: Callable[[Any, "Setting"], Step] | None = None
    model: Callable[[Any, "Setting"], ContactModel] | None = None
    together: Callable[[Any, "Setting", ContactModel], Together] | None = None

    @property
    def rank(self) -> tuple[int, int]:
        """Who goes first where nothing else decides."""
        return STAGES.index(self.stage), self.place


@dataclass(frozen=True, slots=True)
class Setting:
    """What of a scene the effects and the glove itself must know.

    seed, session_trials  trials of one subject's session
    threshold_n           what closes a switch (the paper: 1.0 N)
    period_us, first_us, hold_us, release_us   frames are scanned every period_us from first_us (the transition before
                          contact is negative) to hold_us, where the row is read out, and on through release_us more
    timed, on_wire        whether any effect of the scene is
    taxels                numbers of the places that bear taxels, not switches
    every_frame           whether every frame becomes a row
    rest, rest_us         the posture (`RESTS_DEG`) of the rest between grasps, and how long it is; None: there is none
    """

    seed: int
    session_trials: int
    threshold_n: float
    period_us: int
    first_us: int
    hold_us: int
    release_us: int
    timed: bool
    on_wire: bool
    taxels: tuple[int, ...] = ()
    every_frame: bool = False
    rest: str | None = None
    rest_us: int = 0

    @property
    def released_us(self) -> int:
        """When the release is over, and the hand goes to its rest."""
        return self.hold_us + self.release_us

    @property
    def let_go_us(self) -> int | None:
        """When the hand lets go: as the frame after the read-out begins, so that a row that takes a while to read is
        still whole. None where the recording ends before.
        """
        return self.hold_us + self.period_us if self.release_us > 0 else None


# A scene imports the effects that it lists, and no other.
EFFECTS = MembersByName("effect", Effect, "thenar.simulator.effects", "thenar.effects")


Integers = NDArray[np.int64]

# So many frames are simulated at a time: with all that is worked out of them, each takes two to five kilobytes.
_MOST = 50_000


def frame_times(setting: Setting) -> Integers:
    """Return when the frames (F,) of a repetition begin, in microseconds from first contact.

    They are counted from the one at hold_us, whose row is read out: so it is always among them. Where nothing lives in
    time it is the only one.
    """
    if not setting.timed:
        return np.array([setting.hold_us], dtype=np.int64)
    # The hand goes to its rest in the time in which it comes from there.
    away_us = 0 if setting.rest is None else setting.rest_us - setting.first_us
    after = (setting.release_us + away_us) // setting.period_us
    return setting.hold_us + setting.period_us * np.arange(-hold_frame(setting), after + 1, dtype=np.int64)


def hold_frame(setting: Setting) -> int:
    """Return the number of the frame at hold_us."""
    return (setting.hold_us - setting.first_us) // setting.period_us if setting.timed else 0


def at_a_time(setting: Setting, repetitions: int) -> int:
    """Return how many repetitions are simulated at a time where `repetitions` would be if they had one frame each.

    Fewer where each has so many frames that they would fill the memory, but at least one.
    """
    return max(min(repetitions, _MOST // len(frame_times(setting))), 1)


def drawn_rows(setting: Setting) -> NDArray[np.intp]:
    """Return which row of the random numbers of a repetition each frame (F,) takes.

    The frame at hold_us takes the first, so that its numbers are the same whether or not there are others; frames after
    the release take the last, so that no other's change by a rest.
    """
    times, held = frame_times(setting), hold_frame(setting)
    frames, moving = np.arange(len(times), dtype=np.intp), int((times <= setting.released_us).sum())
    return np.where(frames < moving, (frames - held) % moving, frames)


@dataclass(frozen=True, slots=True)
class Place:
    """A step that wants its place: `own` steps keep the order they have, `parameters` are what the scene sets."""

    effect: Effect
    own: bool
    parameters: EffectParameters = field(default_factory=EffectParameters)


def in_order(places: Sequence[Place]) -> list[Place]:
    """Return the steps in the order in which they act.

    Raises SceneError where two conflict, where an `after` names an effect that is not there, or where some wait for one
    another in a circle.
    """
    _check_conflicts(places)
    _check_after(places)
    return [place for stage in STAGES for place in _sorted([p for p in places if p.effect.stage == stage])]


def _check_conflicts(places: Sequence[Place]) -> None:
    names = {place.effect.name for place in places}
    for place in places:
        for other in place.effect.conflicts:
            if other in names:
                raise SceneError(f"effects {place.effect.name!r} and {other!r} exclude each other: list one of the two")


def _check_after(places: Sequence[Place]) -> None:
    stages = {place.effect.name: STAGES.index(place.effect.stage) for place in places}
    listed = [place.effect.name for place in places if not place.own]
    for place in places:
        name, stage = place.effect.name, place.effect.stage
        for other in place.parameters.after:
            if other not in listed:
                raise SceneError(
                    f"effects.{name}.after: the scene lists no effect {other!r}{nearest(other, listed)}: "
                    "list it too, or leave it out here"
                )
        for other in (*place.parameters.after, *place.effect.after):
            if stages.get(other, 0) > STAGES.index(stage):
                raise SceneError(
                    f"effects.{name}.after: a circle: {name} -> {other} -> {name}: {other!r} belongs to the stage "
                    f"{STAGES[stages[other]]!r}, which comes after {stage!r}, where {name!r} acts"
                )


def _sorted(places: list[Place]) -> Iterator[Place]:
    by_name = {place.effect.name: place for place in places}
    sorter = TopologicalSorter({name: _waits_for(place, places) for name, place in by_name.items()})
    try:
        sorter.prepare()
    except CycleError as reason:
        raise SceneError(f"effects act after each other in a circle: {' -> '.join(reason.args[1])}") from None
    ready: list[tuple[tuple[int, int], str]] = []
    while sorter.is_active():
        for name in sorter.get_ready():
            heapq.heappush(ready, (by_name[name].effect.rank, name))
        _, name = heapq.heappop(ready)
        yield by_name[name]
        sorter.done(name)


def _waits_for(place: Place, places: list[Place]) -> set[str]:
    """Return the names of those of one stage that act before `place`."""
    named = {*place.parameters.after, *place.effect.after} & {other.effect.name for other in places}
    return named | {other.effect.name for other in places if other is not place and _precedes(other, place, places)}


def _precedes(first: Place, second: Place, places: list[Place]) -> bool:
    one, two = first.effect, second.effect
    if first.own and second.own:
        return places.index(first) < places.index(second)
    if first.own:
        return bool({*two.reads, *two.writes} & {*one.writes})
    if second.own:
        return bool({*one.writes} & {*two.reads}) and not {*one.writes} & {*two.writes}
    return False

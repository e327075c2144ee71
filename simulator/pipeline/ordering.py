"""In which order the steps of a scene act.

Stage by stage. Within a stage, an effect acts after the glove's own step that makes what it touches, and before the one
that reads what it alters; after those that `Effect.after` and the scene's `after` name; and else by its rank.
"""

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter

from thenar.compiler.recordings.names import nearest

from ..errors import SceneError
from .effect import STAGES, Effect, EffectParameters


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

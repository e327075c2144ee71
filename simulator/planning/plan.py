"""Plans: an object for hands of all lengths, and the objects of a scene that have no shipped postures.

A plan is kept in the user's cache folder, in a file whose name is a digest of all that the plan depends on.
"""

import hashlib
import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np

from thenar.compiler.elementary import Floats
from thenar.compiler.workers import in_workers

from ..body.condition import PlannedGrasp, Thing
from ..body.hand import Hand, Size
from ..errors import SceneError
from ..scenes.scene import Scene, SceneObject
from .planner import TOLERANCE_MM, Plan, measure, plan
from .postures import Entry, HeldAt, Postures
from .prehension import Prehension, load_prehensions

# Spacing of planned hand lengths in mm, and the average ratio of breadth to length (AIST 2012: 83.3 of 183.4 mm).
EVERY_MM = 15.0
BREADTH = 0.455
# The lengths planned for any object, as far as hands of these sizes can hold it, and the first planned length: both are
# fixed, so that other subjects of a scene do not change postures.
USUAL_LENGTHS_MM = (150.0, 225.0)
START_MM = 195.0
_BETTER = 0.99  # a ratio of costs that is not just rounding


@dataclass(frozen=True, slots=True)
class Work:
    """An object to plan, for hands from `shortest_mm` to `longest_mm` at least."""

    grasp: str
    prehension: Prehension
    thing: Thing
    shortest_mm: float
    longest_mm: float

    def at(self, length_mm: float, near: Plan | None = None) -> Plan:
        """Return a plan for one hand length. Raises SceneError."""
        return plan(average_hand(length_mm), self.grasp, self.prehension, self.thing, near.held if near else None)


def average_hand(length_mm: float) -> Hand:
    """Return the average hand of a length, which is planned."""
    return Hand(Size(length_mm, BREADTH * length_mm))


def plan_object(work: Work) -> Entry:
    """Return an object's postures for hands of all lengths.

    Raises SceneError if a requested length fails; beyond these, the usual ones are planned until one fails.
    """
    plans = _outwards(work)
    entry = entry_of(work, plans)
    if _worst_halfway(entry, work.thing) > TOLERANCE_MM:
        entry = entry_of(work, _evened(work, plans))
    return entry


def _outwards(work: Work) -> dict[float, Plan]:
    """Return plans by hand length, in order: outwards from a middle length, each from the previous one."""
    first = min(max(START_MM, work.shortest_mm), work.longest_mm)
    plans = {first: work.at(first)}
    for step, needed, usual in (
        (EVERY_MM, work.longest_mm, max(work.longest_mm, USUAL_LENGTHS_MM[1])),
        (-EVERY_MM, work.shortest_mm, min(work.shortest_mm, USUAL_LENGTHS_MM[0])),
    ):
        for length in np.arange(first + step, usual + step / 2, step).tolist():
            try:
                plans[length] = work.at(length, plans[length - step])
            except SceneError:
                if (needed - length) * step >= 0.0:
                    raise
                break
    return dict(sorted(plans.items()))


def _evened(work: Work, plans: dict[float, Plan]) -> dict[float, Plan]:
    """Return plans, with those replaced that are worse than a plan from their neighbours.

    Two lengths may hold an object differently, so that halfway a finger goes through it: one is a local minimum.
    """
    found, lengths = dict(plans), list(plans)
    for order in (lengths, lengths[::-1]):
        for before, length in pairwise(order):
            with suppress(SceneError):
                again = work.at(length, found[before])
                if again.cost < _BETTER * found[length].cost:
                    found[length] = again
    return found


def _worst_halfway(entry: Entry, thing: Thing) -> float:
    """Return the widest gap or greatest depth in mm of hands halfway between two planned lengths."""
    postures = Postures("", (entry,))
    lengths = [held.length_mm for held in entry.held]
    hands = [average_hand((low + high) / 2) for low, high in pairwise(lengths)]
    measured = [measure(hand, postures.held(hand, entry.grasp, thing), entry.shape) for hand in hands]
    return max((max(gap, sunk) for gap, sunk in measured), default=-math.inf)


def entry_of(work: Work, plans: dict[float, Plan]) -> Entry:
    """Return plans by hand length, in order, as data: rounded, each rotation close to the previous one."""
    held: list[HeldAt] = []
    for length, one in plans.items():
        pose = one.held.pose.copy()
        if held:
            pose[3:] = _nearest_turn(pose[3:], np.array(held[-1].pose[3:]))
        held.append(_held_at(length, one.held, pose))
    first = next(iter(plans.values())).held
    spheres = tuple(pad.sphere for pad in first.pads)
    down = tuple(round(float(x), 6) for x in first.down)
    return Entry(
        work.grasp, work.thing.name, work.thing.shape, first.grip_n, (down[0], down[1], down[2]), spheres, tuple(held)
    )


def _held_at(length: float, held: PlannedGrasp, pose: Floats) -> HeldAt:
    return HeldAt(
        length,
        tuple(round(float(angle), 2) for angle in held.posture_deg),
        (*(round(float(x), 2) for x in pose[:3]), *(round(float(x), 5) for x in pose[3:])),
        tuple(round(pad.share, 4) for pad in held.pads),
    )


def _nearest_turn(vector: Floats, before: Floats) -> Floats:
    """Return the equivalent rotation vector nearest to `before`: a rotation has two, in opposite directions."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return vector
    others = [vector * (1.0 + turns * 2.0 * math.pi / angle) for turns in (-1, 0, 1)]
    return min(others, key=lambda other: float(np.linalg.norm(other - before)))


Progress = Callable[[int, int], None]


def postures_of(scene: Scene, jobs: int = -1, progress: Progress | None = None) -> Postures:
    """Return the postures of a scene's objects: shipped ones, those planned in an earlier call, and new plans.

    `progress(done, all)` is called after every new plan. Raises SceneError if the taxonomy has no table of prehensions,
    or if a hand of the scene cannot hold an object.
    """
    shipped = Postures.shipped(scene.taxonomy)
    works = list(lacking(scene, shipped))
    found = {work: _kept(work) for work in works}
    new = [work for work, entry in found.items() if entry is None]
    for work, entry in zip(new, planned(new, jobs, progress), strict=True):
        found[work] = entry
        # Without a cache folder it is planned again next time.
        with suppress(OSError, RuntimeError):
            path = _cached(work)
            path.parent.mkdir(parents=True, exist_ok=True)
            Postures(scene.taxonomy, (entry,)).save(path)
    return Postures(scene.taxonomy, (*shipped.entries, *filter(None, found.values())))


def _kept(work: Work) -> Entry | None:
    """Return the plan in the cache folder, if a valid one is there."""
    with suppress(OSError, RuntimeError, ValueError):
        (entry,) = Postures.load(_cached(work)).entries
        return entry
    return None


def _cached(work: Work) -> Path:
    """Return the file of a plan in the user's cache folder. Raises RuntimeError if there is no home folder."""
    folder = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    given = (version("thenar"), work.grasp, work.prehension, work.thing.shape, work.shortest_mm, work.longest_mm)
    return Path(folder, "thenar", f"postures-{hashlib.sha256(msgspec.json.encode(given)).hexdigest()}.json")


def planned(works: Sequence[Work], jobs: int = -1, progress: Progress | None = None) -> list[Entry]:
    """Return the plans of objects, the same for any `jobs`; `progress(done, all)` is called after each.

    Raises the first SceneError, in the order of the objects, and names the others that cannot be held.
    """
    results: dict[int, Entry | SceneError] = {}
    for number, result in in_workers(_result, enumerate(works), jobs if len(works) > 1 else 1):
        results[number] = result
        if progress is not None:
            progress(len(results), len(works))
    return _successes([results[number] for number in range(len(works))], works)


def shipped_prehensions(taxonomy: str) -> dict[str, Prehension]:
    """Return the table of a taxonomy's grasp types. Raises SceneError if there is none."""
    table = files(__package__) / "data" / f"{taxonomy}.toml"
    if not table.is_file():
        raise SceneError(
            f"there is no table of prehensions for the grasp types of {taxonomy!r}: nothing can be planned"
        )
    return load_prehensions(table)


def lacking(scene: Scene, known: Postures) -> Iterator[Work]:
    """Yield the objects without known postures for the scene's hands, once each. Raises SceneError."""
    hands = [subject.hand_length_mm for subject in scene.subjects]
    shortest, longest = EVERY_MM * math.floor(min(hands) / EVERY_MM), EVERY_MM * math.ceil(max(hands) / EVERY_MM)
    items: dict[object, SceneObject] = {}
    for item in scene.objects:
        entry = known.entry(item.grasp, item.thing())
        if entry is None or not (entry.covers(min(hands)) and entry.covers(max(hands))):
            items.setdefault((item.grasp, item.shape), item)
    prehensions = shipped_prehensions(scene.taxonomy) if items else {}
    for item in items.values():
        if item.grasp not in prehensions:
            raise SceneError(
                f"{scene.taxonomy} has no prehension for grasp type {item.grasp!r}: {item.name!r} cannot be planned"
            )
        yield Work(item.grasp, prehensions[item.grasp], item.thing(), shortest, longest)


def _successes(results: Sequence[Entry | SceneError], works: Sequence[Work]) -> list[Entry]:
    """Return the results. Raises the first SceneError among them, in the scene's order, and names the other objects."""
    failed = [(result, work) for result, work in zip(results, works, strict=True) if isinstance(result, SceneError)]
    if failed:
        others = ", ".join(f"{work.thing.name!r} ({work.grasp})" for _, work in failed[1:])
        raise SceneError(f"{failed[0][0]}; nor can these be held: {others}" if others else str(failed[0][0]))
    return [result for result in results if isinstance(result, Entry)]


def _result(task: tuple[int, Work]) -> tuple[int, Entry | SceneError]:
    # Failures are results, too, so that an error does not depend on which worker is first.
    number, work = task
    try:
        return number, plan_object(work)
    except SceneError as reason:
        return number, reason

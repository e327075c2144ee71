"""`plan_scene`: postures for everything in a scene that has none yet, on all cores."""

import math
from collections.abc import Callable, Iterator, Sequence
from importlib.resources import files

from thenar.compiler.workers import in_workers

from ..errors import PlanError, SceneError
from ..scenes.scene import Scene, SceneObject
from .object_plan import EVERY_MM, Planned, Work, plan_object
from .postures import Postures
from .prehension import Prehension, load_prehensions

__all__ = ["Planned", "plan_scene", "shipped_prehensions"]

Progress = Callable[[int, int], None]


def plan_scene(
    scene: Scene, jobs: int = -1, progress: Progress | None = None, *, anew: bool = False
) -> tuple[Postures, list[Planned]]:
    """Return the postures of a scene, and what of them was planned now: what had none, or all of it `anew`.

    The scene's objects come in their order, before what else was known; neither depends on `jobs`. Raises SceneError
    where the taxonomy has no table of prehensions, PlanError where a hand of the scene cannot hold an object.
    """
    known = _known(scene, anew)
    works = list(_works(scene, known))
    answers: dict[int, Planned | PlanError] = {}
    for number, answer in in_workers(_answer, enumerate(works), jobs):
        answers[number] = answer
        if progress is not None:
            progress(len(answers), len(works))
    planned = _successes([answers[number] for number in range(len(works))], works)
    found = Postures(scene.taxonomy, (*known.entries, *(one.entry for one in planned)))
    own = [found.entry(item.grasp, item.thing()) for item in scene.objects]
    return Postures(scene.taxonomy, (*filter(None, own), *found.entries)), planned


def shipped_prehensions(taxonomy: str) -> dict[str, Prehension]:
    """Return the table of a taxonomy's grasp types. Raises SceneError if there is none."""
    table = files(__package__) / "data" / f"{taxonomy}.toml"
    if not table.is_file():
        raise SceneError(
            f"there is no table of how the grasp types of {taxonomy!r} hold things: nothing can be planned"
        )
    return load_prehensions(table)


def _known(scene: Scene, anew: bool) -> Postures:
    """Return what needs no planning. The scene may name the file that is only to be written."""
    if anew:
        return Postures(scene.taxonomy, ())
    if scene.postures is not None and not scene.postures.exists():
        return Postures.shipped(scene.taxonomy)
    return Postures.of(scene)


def _works(scene: Scene, known: Postures) -> Iterator[Work]:
    """Yield what lacks postures for the scene's hands, once each."""
    hands = [subject.hand_length_mm for subject in scene.subjects]
    shortest, longest = EVERY_MM * math.floor(min(hands) / EVERY_MM), EVERY_MM * math.ceil(max(hands) / EVERY_MM)
    lacking: dict[object, SceneObject] = {}
    for item in scene.objects:
        if not _covered(item, known, hands):
            lacking.setdefault((item.grasp, item.shape), item)
    prehensions = shipped_prehensions(scene.taxonomy) if lacking else {}
    for item in lacking.values():
        if item.grasp not in prehensions:
            raise SceneError(
                f"{scene.taxonomy} has no table of how grasp type {item.grasp!r} holds things: "
                f"{item.name!r} cannot be planned"
            )
        yield Work(item.grasp, prehensions[item.grasp], item.thing(), shortest, longest)


def _covered(item: SceneObject, known: Postures, hands_mm: Sequence[float]) -> bool:
    entry = known.entry(item.grasp, item.thing())
    return entry is not None and entry.covers(min(hands_mm)) and entry.covers(max(hands_mm))


def _successes(answers: Sequence[Planned | PlanError], works: Sequence[Work]) -> list[Planned]:
    """Return the answers. Raises the first PlanError among them, in the scene's order, and names the other objects."""
    failed = [(answer, work) for answer, work in zip(answers, works, strict=True) if isinstance(answer, PlanError)]
    if failed:
        others = ", ".join(f"{work.thing.name!r} ({work.grasp})" for _, work in failed[1:])
        raise PlanError(f"{failed[0][0]}; nor can these be held: {others}" if others else str(failed[0][0]))
    return [answer for answer in answers if isinstance(answer, Planned)]


def _answer(task: tuple[int, Work]) -> tuple[int, Planned | PlanError]:
    # Which worker is first must not decide which object an error names: failures are answers, too.
    number, work = task
    try:
        return number, plan_object(work)
    except PlanError as reason:
        return number, reason

"""What pictures of the glove say of every switch: all of them, how often each closed, or which are kept."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thenar.compiler.recordings.graspset import GraspSet

from .handmap import PARTS, HandMap, MapError, hand_map


@dataclass(frozen=True, slots=True)
class Dot:
    """A switch as drawn: hollow, or of a shade from 0 to 1; `mark` is written into it, `hint` is said on hovering.

    absent: not in the set, a mere point.
    """

    hint: str
    shade: float | None = None
    mark: str = ""
    absent: bool = False


@dataclass(frozen=True, slots=True)
class Panel:
    """One hand: its title, a line under it, and a Dot for every switch of the map."""

    title: str
    note: str
    dots: tuple[Dot, ...]


@dataclass(frozen=True, slots=True)
class Picture:
    """Hands side by side, what full and hollow dots mean ("" for none), and what shade 1 of the colour bar is worth.

    full: what a full dot means when there is no colour bar, and the bar's title when there is one.
    """

    panels: tuple[Panel, ...]
    full: str
    hollow: str
    bar_top: float | None = None
    hollow_mark: str = ""  # what the key writes into its hollow dot


def all_switches(numbered: bool) -> Picture:
    """Return the glove with all its switches, with their numbers in the set (from 0) if `numbered`."""
    glove = hand_map()
    dots = tuple(Dot(f"{n} {name}", mark=str(n) if numbered else "") for n, name in enumerate(glove.names))
    words = "switch and its number, from 0" if numbered else "switch"
    return Picture(
        (Panel("murakami160", _counts(glove, np.arange(len(dots)), "switches"), dots),),
        "",
        words,
        hollow_mark="7" if numbered else "",
    )


def contacts(grasp_set: GraspSet, per_grasp: bool) -> Picture:
    """Return how often each switch closed over all rows or, one hand each, in each grasp type that has rows.

    All hands share one scale, up to the largest share. Raises MapError if the set has no rows, no switches, or a switch
    that the glove does not have.
    """
    if not grasp_set.switch_names:
        raise MapError("the set has no switches to draw: it holds joints only")
    if not len(grasp_set):
        raise MapError("a set without rows has no contacts to draw")
    numbers = hand_map().numbers_of(grasp_set.switch_names)
    groups = [np.arange(len(grasp_set))]
    titles = ["all grasps"]
    if per_grasp:
        present = np.unique(grasp_set.labels)
        groups = [np.flatnonzero(grasp_set.labels == label) for label in present]
        titles = [_type_title(grasp_set, label) for label in present]
    closed = [grasp_set.switches[rows].sum(axis=0) for rows in groups]
    top = max(float((count / len(rows)).max()) for count, rows in zip(closed, groups, strict=True)) or 1.0
    panels = (
        _contact_panel(title, numbers, count, len(rows), top)
        for title, count, rows in zip(titles, closed, groups, strict=True)
    )
    return Picture(tuple(panels), "share of grasps in which the switch closed", "never closed", top)


def kept(placements: Sequence[tuple[str, Sequence[str]]]) -> Picture:
    """Return the glove once for each (title, names of switches in the order in which they were chosen).

    Raises MapError if a name is not a switch of the glove, or stands twice in one placement.
    """
    panels = tuple(_kept_panel(title, names) for title, names in placements)
    return Picture(panels, "kept, in the order chosen", "left out")


def _contact_panel(title: str, numbers: NDArray[np.intp], closed: NDArray[np.intp], rows: int, top: float) -> Panel:
    glove = hand_map()
    dots = [Dot(f"{name}: not in the set", absent=True) for name in glove.names]
    for number, count in zip(numbers.tolist(), closed.tolist(), strict=True):
        hint = f"{glove.names[number]}: closed in {count} of {rows} grasps ({count / rows:.1%})"
        dots[number] = Dot(hint, count / rows / top if count else None)
    return Panel(title, f"{rows} grasps, {float(closed.sum()) / rows:.1f} switches closed on average", tuple(dots))


def _type_title(grasp_set: GraspSet, label: int) -> str:
    name, full = grasp_set.taxonomy.types[label], grasp_set.taxonomy.full_names[label]
    return name if name == full else f"{name}: {full}"


def _kept_panel(title: str, names: Sequence[str]) -> Panel:
    glove = hand_map()
    numbers = glove.numbers_of(names)
    twice = next((name for place, name in enumerate(names) if name in names[:place]), None)
    if twice is not None:
        raise MapError(f"{title}: switch {twice!r} is kept twice")
    dots = [Dot(f"{name}: left out") for name in glove.names]
    for place, number in enumerate(numbers.tolist(), 1):
        dots[number] = Dot(f"{glove.names[number]}: kept, number {place}", 1.0, str(place))
    return Panel(title, _counts(glove, numbers, f"of {len(dots)} kept"), tuple(dots))


def _counts(glove: HandMap, numbers: NDArray[np.intp], what: str) -> str:
    by_part = np.bincount(glove.parts[numbers], minlength=len(PARTS)).tolist()
    return f"{len(numbers)} {what}: " + ", ".join(f"{part} {count}" for part, count in zip(PARTS, by_part, strict=True))

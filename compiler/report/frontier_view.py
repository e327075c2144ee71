"""The frontier as tables, and what is shown of a point that is picked."""

from collections.abc import Iterable
from dataclasses import dataclass

from ..frontier.drawing.sentence import sentence
from ..frontier.drawing.words import featured
from ..frontier.points import Frontier, Point
from ..hand import HandShape
from ..text import NBSP, counted, interval, microseconds
from ..text import sentence as as_sentence
from .frontier_tables import frontier_tables
from .hand_picture import HandPicture, hand_picture
from .plain_table import PlainTable
from .point_view import Detail, point_detail, point_latency, point_placement

COLUMNS = (
    *("Switches", "Inputs", "Method", "Rate, %", "Frame, µs"),
    *("Latency, µs", "99th pct., µs", "Missed, %", "Flash, bytes"),
)
_FOREIGN = "This frontier is of other recordings than the build."


@dataclass(frozen=True, slots=True)
class PointRow:
    """A point in the table: its number, what is under COLUMNS, whether it is picked at first."""

    number: int
    cells: tuple[str, ...]
    picked: bool


@dataclass(frozen=True, slots=True)
class FrontierView:
    """What the section holds besides its charts; hand is None where nobody knows where the switches lie."""

    columns: tuple[str, ...]
    rows: tuple[PointRow, ...]
    details: tuple[Detail, ...]
    picked: Detail | None
    hand: HandPicture | None
    tables: tuple[PlainTable, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]


def frontier_view(
    frontier: Frontier, fingerprint: str, hand: HandShape | None, built: int | None = None
) -> FrontierView:
    """Return the section of `frontier` in a build from the recordings of that fingerprint, which is point `built`."""
    details = tuple(point_detail(point, frontier.source) for point in frontier.points)
    first = featured(frontier) if built is None else frontier.point(built)
    picked = None if first is None else point_detail(first, frontier.source)
    return FrontierView(
        columns=COLUMNS,
        rows=tuple(_row(point, picked) for point in frontier.points),
        details=details,
        picked=picked,
        hand=_hand(frontier, hand, picked),
        tables=tuple(frontier_tables(frontier)),
        warnings=() if frontier.fingerprint == fingerprint else (_FOREIGN,),
        notes=(*_notes(frontier), *(() if built is None else (f"This build is point {built}.",))),
    )


def _row(point: Point, picked: Detail | None) -> PointRow:
    cells = (
        str(len(point.switches)),
        point.setting.inputs,
        point_placement(point),
        interval(point.rate),
        microseconds(point.frame.us),
        *point_latency(point),
        f"{100 * point.latency.missed:.1f}",
        f"{point.flash:,}",
    )
    return PointRow(point.number, cells, picked is not None and point.number == picked.number)


def _hand(frontier: Frontier, hand: HandShape | None, picked: Detail | None) -> HandPicture | None:
    if hand is None or picked is None or not all(hand.knows(point.switches) for point in frontier.points):
        return None
    return hand_picture(hand, picked.switches, "picked-hand", "Switches of the picked point on the hand", picked.said)


def _notes(frontier: Frontier) -> Iterable[str]:
    yield sentence(frontier)
    yield (
        f"{frontier.combinations:,} combinations of {frontier.source}: {counted(frontier.rows, 'row')}, "
        f"{counted(frontier.subjects, 'subject')}, {counted(frontier.n_switches, 'switch', 'switches')}, "
        f"{counted(frontier.n_joints, 'joint')}; target {frontier.target}. Rates are honest: {frontier.folds} folds, "
        f"{counted(frontier.repeats, 'repeat')}, placements chosen within the training folds; with 95{NBSP}% intervals."
    )
    if frontier.wanted and frontier.picked is not None:
        yield f"Point {frontier.picked} was picked for {frontier.wanted}."
    yield from map(as_sentence, frontier.skipped)

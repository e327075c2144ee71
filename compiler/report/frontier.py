"""The section on the Pareto front that a build was picked from: its points, the reference points, and sentences."""

from collections.abc import Iterator

from ..evaluation.rates import interval
from ..frontier.points import Frontier
from ..frontier.words import (
    counted_of,
    elements_of,
    folds_of,
    of_time,
    rates_of,
    remarks_on_rates,
    summary,
    trainer_of,
    way_of,
    wiring_of,
)
from ..text import DASH, NBSP, counted, microseconds, sentence
from .content import PlainTable


def points_table(frontier: Frontier) -> PlainTable:
    """Return the table of all points."""
    columns = (
        "Point",
        counted_of(frontier).capitalize(),
        "Inputs",
        "Method",
        "Trainer",
        "Wiring",
        *rates_of(frontier),
        of_time(frontier, "Frame, µs"),
        "Flash, bytes",
    )
    rows = tuple(
        (
            str(point.number),
            str(point.size),
            point.setting.inputs,
            way_of(point.setting) if point.switches else DASH,
            trainer_of(point.setting),
            wiring_of(point.setting) or DASH,
            *(interval(rate(point)) for rate in rates_of(frontier).values()),
            microseconds(point.frame.us),
            f"{point.flash:,}",
        )
        for point in frontier.points
    )
    caption = f"Points of the frontier; accuracy in % with 95{NBSP}% intervals"
    return PlainTable(caption, columns, rows, words=(0, 2, 3, 4, 5))


def marks_table(frontier: Frontier) -> PlainTable | None:
    """Return the table of reference points, None if there are none."""
    if not frontier.marks:
        return None
    kept, trainer = elements_of(frontier).capitalize(), "".join(frontier.trainers[:1]) or "none"
    rows = tuple(
        (mark.name, str(mark.n_switches), interval(mark.rate), microseconds(mark.frame_us)) for mark in frontier.marks
    )
    caption = f"Reference points; trainer: {trainer}, that of a build as compiled"
    return PlainTable(caption, ("What", kept, f"{frontier.by}, %", of_time(frontier, "Frame, µs")), rows)


def notes(frontier: Frontier, built: int | None) -> Iterator[str]:
    """Yield sentences on the search, and on the point that the build is."""
    yield summary(frontier)
    taxels = f"{counted(frontier.n_taxels, 'taxel')} of {frontier.n_levels} levels, " if frontier.n_taxels else ""
    yield (
        f"{frontier.combinations:,} combinations of {frontier.source}: {counted(frontier.rows, 'row')}, "
        f"{counted(frontier.trials, 'trial')}, "
        f"{counted(frontier.subjects, 'subject')}, {counted(frontier.n_switches, 'switch', 'switches')}, "
        f"{taxels}{counted(frontier.n_joints, 'joint')}; times on {frontier.machine}. "
        f"{folds_of(frontier)}, placement inside the fold, with 95{NBSP}% intervals. {remarks_on_rates(frontier)}"
    )
    if frontier.wanted and frontier.picked is not None:
        yield f"Point {frontier.picked} was picked for {frontier.wanted}."
    yield from map(sentence, frontier.skipped)
    if built is not None:
        yield f"This build is point {built}."

"""The frontier's tables beside the points: what to compare with, rivals, what was screened, how far models are off."""

from collections.abc import Iterable

from ..frontier.points import Frontier
from ..text import interval, microseconds
from .plain_table import PlainTable


def frontier_tables(frontier: Frontier) -> Iterable[PlainTable]:
    """Yield the tables that have rows."""
    if frontier.marks:
        rows = tuple(
            (mark.name, str(mark.n_switches), interval(mark.rate), microseconds(mark.frame_us))
            for mark in frontier.marks
        )
        yield PlainTable("To compare with", ("What", "Switches", "Rate, %", "Frame, µs"), rows)
    if frontier.curves:
        yield _curves(frontier)
    if frontier.tried:
        yield _tried(frontier)
    if frontier.checks:
        checks = tuple(
            (check.what, check.how, str(check.n), f"{100 * check.mean_error:.1f}", f"{100 * check.worst_error:.1f}")
            for check in frontier.checks
        )
        heads = ("Model of", "Held against", "Points", "Mean error, %", "Worst error, %")
        yield PlainTable("How far the models of times are off", heads, checks)


def _curves(frontier: Frontier) -> PlainTable:
    sizes = sorted({size for curve in frontier.curves for size in curve.sizes})
    rows = []
    for curve in frontier.curves:
        rates = dict(zip(curve.sizes, curve.rates, strict=True))
        cells = (f"{100 * rates[size].mean:.1f}" if size in rates else "" for size in sizes)
        rows.append((f"{curve.method}{' (ours)' if curve.ours else ''}", *cells))
    heads = ("Method", *(f"{size:g}" for size in sizes))
    return PlainTable("Recognition rate in %, switches alone, against the number of switches", heads, tuple(rows))


def _tried(frontier: Frontier) -> PlainTable:
    rows = tuple(
        (
            f"{tried.way.method} {tried.way.parameter:g}",
            tried.inputs,
            str(tried.n_switches),
            str(tried.rounds),
            interval(tried.rate),
            microseconds(tried.frame_us),
        )
        for tried in frontier.tried
    )
    heads = ("Placement", "Inputs", "Switches", "Rounds", "Rate, %", "Frame, µs")
    return PlainTable("Placements that were screened", heads, rows)

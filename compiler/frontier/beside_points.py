"""What is seen beside the points: everything that was tried, the paper's placements, all switches, the user's build."""

from collections.abc import Sequence

from ..placement.methods.base import BEST, PAPERS
from .candidates import Choice
from .closeup import Close, papers_tables
from .points import Mark, Tried, Way
from .screening import Screening, fastest_us
from .settings import Search

# The paper's S.
_PAPERS = (62.0,)


def choices_to_mark(n_switches: int, n_joints: int) -> dict[Choice, str]:
    """Return what to mark, with its name: the paper's placement and all switches, alone and with the joints."""
    if not n_switches:
        return {}
    marked = {Way(PAPERS, prune): f"paper, S = {prune:g}" for prune in _PAPERS}
    # Whichever method says so, to keep all of them is the same.
    marked[Way(BEST, float(n_switches))] = f"all of {n_switches}"
    alone = {Choice(way, "switches"): name for way, name in marked.items()}
    return alone | ({Choice(way, "both"): f"{name}, joints" for way, name in marked.items()} if n_joints else {})


def marks_of(named: dict[Choice, str], closes: Sequence[Close], search: Search, joints: int) -> tuple[Mark, ...]:
    """Return the marks of these choices that were looked at closely, with the paper's rounds and whole scans."""
    found = []
    for close in closes:
        name, tabled = named.get(close.screened.choice), papers_tables(search)
        if name is not None:
            priced = next(tables for tables in close.priced.tables if tables.tabled == tabled)
            us = fastest_us(priced, joints if close.screened.choice.joints else 0)
            if us is not None:
                found.append(Mark(name, len(close.screened.columns), close.rates[tabled], us))
    return tuple(found)


def tried(screening: Screening, closes: Sequence[Close], search: Search) -> tuple[Tried, ...]:
    """Return everything that was screened, and the finalists after every stage of their training."""
    screened = [
        Tried(one.choice.way, one.choice.inputs, len(one.columns), search.screened, one.rate, one.frame_us)
        for one in screening.screened
    ]
    stages = [
        Tried(one.choice.way, one.choice.inputs, len(one.columns), rounds, rate, one.frame_us)
        for close, one in ((close, close.screened) for close in closes)
        for rounds, rate in close.stages.items()
    ]
    return (*screened, *stages)

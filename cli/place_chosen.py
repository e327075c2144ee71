"""`thenar place --method`: a placement by one of the methods beside the paper's, and how far it is from the best."""

from typing import TYPE_CHECKING

import msgspec

from .common import out, progress
from .lines import echo

if TYPE_CHECKING:
    from thenar.compiler.placement.costaware import PortCosts
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.compiler.samples import Columns, Samples


class Kept(msgspec.Struct, frozen=True):
    """One switch that is kept: its number in the set, and its name."""

    number: int
    name: str


class Exactly(msgspec.Struct, frozen=True):
    """Pairs of rows of different grasp types that look alike: in the placement, in the best subset of as many switches
    that was found, and the least that any such subset leaves. proved: the best found is the best there is.
    """

    pairs: int
    alike: int
    best_found: int
    least: int
    best: tuple[Kept, ...]
    proved: bool


class Choice(msgspec.Struct, frozen=True):
    """What `thenar place --method` finds. parameter: S of ID3, how many switches to keep of all others."""

    method: str
    what: str
    parameter: float
    joints: bool
    switches: tuple[Kept, ...]
    n_switches: int
    rows: int
    fingerprint: str
    exact: Exactly | None


def learning_of(grasp_set: "GraspSet", *, joints: bool) -> "Samples":
    """Return the rows of a set as methods learn from them. Raises PlacementError if it has none."""
    from thenar.compiler.samples import Samples

    return Samples.of(grasp_set, "both" if joints else "switches")


def named(grasp_set: "GraspSet", columns: "Columns") -> tuple[Kept, ...]:
    """Return switches with their names."""
    return tuple(Kept(number, grasp_set.switch_names[number]) for number in columns)


def chosen(
    grasp_set: "GraspSet", method: str, parameter: float, *, joints: bool, exact: bool, ports: "PortCosts | None"
) -> Choice:
    """Return what `method` chooses from all rows, where reading takes what `ports` say (None: every switch alike).

    Raises PlacementError, for a name that is no method's too.
    """
    from thenar.compiler.placement.ways import METHODS, chooser

    learning = learning_of(grasp_set, joints=joints)
    with progress(f"choosing switches by {method}"):
        columns = chooser(method, learning, ports)(parameter)
    return Choice(
        method,
        METHODS[method].what,
        parameter,
        joints,
        named(grasp_set, columns),
        len(grasp_set.switch_names),
        len(grasp_set),
        grasp_set.fingerprint(),
        _exactly(grasp_set, learning, columns) if exact else None,
    )


def _exactly(grasp_set: "GraspSet", learning: "Samples", columns: "Columns") -> Exactly:
    from thenar.compiler.placement.pairs import Pairs
    from thenar.compiler.placement.subset import best_subset

    with progress(f"looking for the best {len(columns)} switches") as report:
        best = best_subset(learning, len(columns), starts=(columns,), on_round=report)
    alike = Pairs(learning).alike(columns)
    return Exactly(best.pairs, alike, best.alike, best.least, named(grasp_set, best.columns), best.proved)


def print_chosen(choice: Choice) -> None:
    """Print the switches in their order, and how far they are from the best."""
    from rich.table import Table

    table = Table("order", "switch", "name", title="Placement")
    for order, kept in enumerate(choice.switches, 1):
        table.add_row(str(order), str(kept.number), kept.name)
    out().print(table)
    share = len(choice.switches) / choice.n_switches
    beside = ", beside the joints" if choice.joints else ""
    echo(f"{len(choice.switches)} of {choice.n_switches} switches ({share:.0%}){beside}. {choice.what}")
    if choice.exact is not None:
        _print_exactly(choice.exact, len(choice.switches))


def _print_exactly(exact: Exactly, m: int) -> None:
    if not exact.pairs:
        echo("all rows are of one grasp type: there is nothing to tell apart")
        return
    echo(
        f"of {exact.pairs:,} pairs of rows of different grasp types, {exact.alike / exact.pairs:.3%} look alike in "
        f"these {m} switches: no classifier tells them apart"
    )
    if exact.proved:
        echo(f"the best {m} switches leave {exact.best_found / exact.pairs:.3%}, which is proved")
    else:
        echo(
            f"the best {m} switches found leave {exact.best_found / exact.pairs:.3%}; no {m} switches leave less than "
            f"{exact.least / exact.pairs:.3%}"
        )
    echo(f"so this placement is at most {100 * (exact.alike - exact.least) / exact.pairs:.3f} points from the best")
    names = ", ".join(kept.name for kept in exact.best)
    echo(f"the best found: {names}")

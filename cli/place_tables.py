"""What `thenar place` prints: the kept switches in their order, and remarks on how they were found."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from thenar.compiler.placement.drawing import BETTERED

from .common import out
from .lines import echo

if TYPE_CHECKING:
    from thenar.compiler.placement.placement import Exactly, Placement, Standard
    from thenar.compiler.placement.tree import Tree


def print_placement(placement: "Placement") -> None:
    """Print the table of switches, what they are worth, and remarks on how they were found."""
    from rich.table import Table

    title = "Placement" if placement.study is None else "Standard placement"
    if placement.tree is not None:
        table = Table("switch", "name", "gain, bits", "cumulative share", title=title)
        for kept in placement.switches:
            table.add_row(str(kept.number), kept.name, f"{kept.gain_bits:.4f}", f"{kept.cumulative_share:.1%}")
    else:
        table = Table("order", "switch", "name", title=title)
        for order, kept in enumerate(placement.switches, 1):
            table.add_row(str(order), str(kept.number), kept.name)
    out().print(table)
    if placement.study is not None:
        _print_served(placement.study)
    for sentence in _sentences(placement):
        echo(sentence)


def _sentences(placement: "Placement") -> Iterator[str]:
    kept = f"{len(placement.switches)} of {placement.n_switches} switches"
    share = f"({len(placement.switches) / placement.n_switches:.0%})"
    if placement.study is not None:
        yield from _of_study(kept, placement.study)
    elif placement.tree is not None:
        tree, prune = placement.tree, placement.tree.min_samples
        yield (
            f"{kept} {share} bring {placement.gain_bits:.3f} of {placement.entropy_bits:.3f} bits; the tree has "
            f"{len(tree.nodes) - tree.n_leaves} decisions, {tree.n_leaves} leaves, depth {tree.depth}"
            + (f", pruned at S = {prune}" if prune else "")
        )
        yield from _of_tree(placement, tree)
    else:
        yield f"{kept} {share}{', beside the joints' if placement.joints else ''}. {placement.how}"
    if placement.exact is not None:
        yield from _of_exact(placement.exact, len(placement.switches))


def _of_tree(placement: "Placement", tree: "Tree") -> Iterator[str]:
    """Yield what should not pass in silence: why nothing was decided, or decided without a gain."""
    if placement.entropy_bits == 0:
        yield "all rows are of one grasp type: there is nothing to tell apart"
    elif placement.rows < tree.min_samples:
        yield f"no decision was made: the {placement.rows} rows are fewer than S = {tree.min_samples}"
    yield from tree.remarks("switch")


def _of_exact(exact: "Exactly", m: int) -> Iterator[str]:
    if not exact.pairs:
        yield "all rows are of one grasp type: there is nothing to tell apart"
        return
    yield (
        f"of {exact.pairs:,} pairs of rows of different grasp types, {exact.alike / exact.pairs:.3%} look alike in "
        f"these {m} switches: no classifier tells them apart"
    )
    best = f"the best {m} switches"
    if exact.proved:
        yield f"{best} leave {exact.best_found / exact.pairs:.3%}, which is proved"
    else:
        yield (
            f"{best} found leave {exact.best_found / exact.pairs:.3%}; no {m} switches leave less than "
            f"{exact.least / exact.pairs:.3%}"
        )
    yield f"so this placement is at most {100 * (exact.alike - exact.least) / exact.pairs:.3f} points from the best"
    yield f"the best found: {', '.join(kept.name for kept in exact.best)}"


def _of_study(kept: str, study: "Standard") -> Iterator[str]:
    yield (
        f"{kept}, chosen by {study.method}, {BETTERED[study.aim]}: this did best within the subjects learnt from. "
        f"Learnt again from {study.rows} rows of all {study.subjects} subjects"
    )
    yield (
        "bettered: the switches chosen last exchanged for the next ones, where half of the subjects learnt from then "
        "recognise the other half better. Counting badly served subjects more often was tried on 80 simulated hands, "
        "gained no more than another draw of rows did, and is not done"
    )


def _print_served(study: "Standard") -> None:
    """Print how held-out subjects are served."""
    from rich.table import Table

    table = Table(
        *("subjects", "placement", "mean, %", "worst tenth, %", "lowest, %"),
        title=f"Recognition of {study.held_out} held-out subjects",
    )
    for point in study.curve:
        rates = (point.served.mean, point.served.worst_tenth, point.served.lowest)
        table.add_row(str(point.subjects), BETTERED[point.aim], *(f"{100 * rate:.1f}" for rate in rates))
    out().print(table)

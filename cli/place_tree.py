"""What `thenar place` says of the paper's placement: the switches that ID3's tree asks for, and what each brought."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from .common import out
from .lines import echo

if TYPE_CHECKING:
    from thenar.compiler.placement.placement import Placement


def print_placement(placement: "Placement") -> None:
    """Print the table of switches, and remarks on how the tree came out."""
    from rich.table import Table

    table = Table("switch", "name", "gain, bits", "cumulative share", title="Placement")
    for chosen in placement.switches:
        share = f"{chosen.cumulative_share:.1%}"
        table.add_row(str(chosen.number), chosen.name, f"{chosen.gain_bits:.4f}", share)
    out().print(table)
    pruned = f", pruned at S = {placement.prune}" if placement.prune else ""
    echo(
        f"{len(placement.switches)} of {placement.n_switches} switches ({placement.kept_share:.0%}) bring "
        f"{placement.gain_bits:.3f} of {placement.entropy_bits:.3f} bits; the tree has {placement.decision_nodes} "
        f"decisions, {placement.leaves} leaves, depth {placement.depth}{pruned}"
    )
    for remark in _remarks(placement):
        echo(remark)


def _remarks(placement: "Placement") -> Iterator[str]:
    """Yield what should not pass in silence: why nothing was decided, or decided without a gain."""
    if placement.entropy_bits == 0:
        yield "all rows are of one grasp type: there is nothing to tell apart"
    elif placement.rows < placement.prune:
        yield f"no decision was made: the {placement.rows} rows are fewer than S = {placement.prune}"
    if placement.zero_gain_nodes:
        yield (
            f"at {placement.zero_gain_nodes} of the decisions no switch gains anything alone: "
            "the lowest-numbered one that varies was taken"
        )
    if placement.undecided_leaves:
        yield (
            f"at {placement.undecided_leaves} of the leaves rows of several grasp types agree in every switch: "
            "no switch tells them apart"
        )

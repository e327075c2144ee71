"""`thenar place`: which switches to keep."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .common import existing_file, json_flag, keep_apart, out, output_file, picture_file, print_json, progress

if TYPE_CHECKING:
    from ..compiler.placement.placement import Placement


@click.command("place")
@click.argument("grasps", type=existing_file)
@click.option("--prune", type=click.IntRange(min=0), default=0, metavar="S", help="End nodes of fewer than S rows.")
@click.option("--tree", "show_tree", is_flag=True, help="Also print the tree.")
@click.option("--draw", type=picture_file, help="Also draw the tree: an .svg or .png file to write.")
@click.option("-o", "--output", type=output_file, help="Also store the placement: a .json file to write.")
@json_flag
def command(grasps: Path, prune: int, show_tree: bool, draw: Path | None, output: Path | None, as_json: bool) -> None:
    """Choose the switches of GRASPS that tell its grasp types apart, with ID3: those that its tree asks for.

    They stand in the order in which the tree asks for them, each with the information it brought and the share of
    the grasp types' entropy that it and all before it brought.

    \b
    Example:
        thenar place set.grasps
        thenar place set.grasps --prune 13 --draw tree.svg -o placement.json
    """
    from ..compiler.placement.placement import place
    from ..compiler.recordings.graspset import GraspSet

    if as_json and show_tree:
        raise click.UsageError("--tree is for people and --json for machines: take one of them")
    keep_apart(grasps, draw, output)
    grasp_set = GraspSet.load(grasps)
    with progress(f"growing the tree of {grasps.name}"):
        placement, tree = place(grasp_set, prune)
    types = [grasp_set.taxonomy.types[number] for number in map(int, tree.classes)]
    if draw is not None:
        from ..compiler.placement.draw import draw_tree

        draw_tree(tree, draw, grasp_set.switch_names, types)
    if output is not None:
        _store(placement, output)
    if as_json:
        print_json(placement)
        return
    if show_tree:
        click.echo(tree.text(grasp_set.switch_names, types))
    _print(placement)


def _store(placement: "Placement", path: Path) -> None:
    import msgspec

    from ..runtime.files import write_atomically

    write_atomically(path, msgspec.json.format(msgspec.json.encode(placement), indent=2) + b"\n")


def _print(placement: "Placement") -> None:
    from rich.table import Table

    table = Table("switch", "name", "gain, bits", "cumulative share", title="Placement")
    for chosen in placement.switches:
        share = f"{chosen.cumulative_share:.1%}"
        table.add_row(str(chosen.number), chosen.name, f"{chosen.gain_bits:.4f}", share)
    out().print(table)
    pruned = f", pruned at S = {placement.prune}" if placement.prune else ""
    click.echo(
        f"{len(placement.switches)} of {placement.n_switches} switches ({placement.kept_share:.0%}) bring "
        f"{placement.gain_bits:.3f} of {placement.entropy_bits:.3f} bits; the tree has {placement.decision_nodes} "
        f"decisions, {placement.leaves} leaves, depth {placement.depth}{pruned}"
    )
    for remark in _remarks(placement):
        click.echo(remark)


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

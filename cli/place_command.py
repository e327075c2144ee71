"""`thenar place`: choose the switches to keep."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from thenar.runtime.recipe import AUTO

from .options import (
    CHOOSING,
    TrainingCommand,
    asked_settings,
    glove_option,
    layout_option,
    recipe_options,
    terms_of,
    trainer_option,
)
from .parameters import OutputFile, existing_file, jobs_option, keep_apart, overwrite_flag, picture_file
from .printing import echo, json_flag, out, print_json, progress, table, wants_json, write_json

if TYPE_CHECKING:
    from thenar.compiler.placement.placement import Placement
    from thenar.runtime.recipe import Recipe


@click.command("place", cls=TrainingCommand)
@click.argument("grasps", type=existing_file)
@recipe_options(*CHOOSING)
@recipe_options("inputs")
@layout_option
@glove_option
@recipe_options("folds", default=0, help="Folds that measure the accuracy with the kept elements; 0: do not.")
@recipe_options("seed", "by")
@trainer_option(AUTO)
@jobs_option()
@click.option("--tree", "show_tree", is_flag=True, help="Also print ID3's tree.")
@click.option("--draw", type=picture_file, help="Also draw ID3's tree: an .svg or .png file.")
@click.option("-o", "--output", type=OutputFile(".json"), help="Also store the placement as JSON.")
@overwrite_flag
@json_flag
@click.pass_context
def command(
    context: click.Context,
    /,
    grasps: Path,
    jobs: int,
    layout: Path | None,
    glove: Path | None,
    show_tree: bool,
    draw: Path | None,
    output: Path | None,
    **chosen: Any,
) -> None:
    """Choose the switches and levels of GRASPS, a .grasps file, that distinguish its grasp types.

    The paper's method, ID3, keeps the switches of its tree, printed in the order of their decisions, each with its
    information gain and the cumulative share of the grasp types' entropy. Other methods keep a given number of
    switches, best first. `thenar compile` with the same options keeps the same; --folds says how well the kept ones
    recognise new trials.

    \b
    Example:
        thenar place set.grasps
        thenar place set.grasps --prune 13 --draw tree.svg -o placement.json
        thenar place set.grasps --method elimination --keep 16
        thenar place set.grasps --method elimination --keep 16 --folds 4 --trainer logit
        thenar place set.grasps --method id3-cost --keep 16 --glove glove.toml
        thenar place set.grasps --method elimination --keep 16 --keep-these thumb_distal_5 --apart-mm 8
    """
    from thenar.compiler.artifact.training import fold_results, samples_of
    from thenar.compiler.placement.placement import place
    from thenar.compiler.recordings.graspset import GraspSet
    from thenar.runtime.recipe import Recipe, changed

    training = asked_settings(context, chosen)
    recipe = changed(Recipe(), chosen | training)
    _check(context, recipe, training, show_tree, draw)
    keep_apart(grasps, glove, layout, draw, output)
    grasp_set = GraspSet.load(grasps)
    terms = terms_of(recipe, grasp_set, layout, glove)
    with progress(f"choosing switches by {recipe.placement}") as report:
        placement = place(grasp_set, recipe, **terms)
        tested = None
        if recipe.folds:
            samples = samples_of(grasp_set, recipe)
            tested = fold_results(grasp_set, samples, recipe, **terms, jobs=jobs, report=report)
    rates = () if tested is None else tested.rates
    document = placement.document() | ({"rates": rates} if rates else {})
    if draw is not None:
        from thenar.compiler.placement.drawing import draw_placement

        draw_placement(placement, draw)
    if output is not None:
        write_json(output, document)
    if wants_json():
        print_json(document)
        return
    if show_tree and placement.tree is not None:
        echo(placement.tree.text(placement.all_names, placement.grasps))
    _print(placement)
    for rate in rates:
        out().print(f"accuracy, {rate}")


def _check(
    context: click.Context, recipe: "Recipe", training: dict[str, Any], show_tree: bool, draw: Path | None
) -> None:
    """Raise UsageError if options conflict, or are for an accuracy that is not measured."""
    from thenar.compiler.placement.methods.base import PAPERS

    if wants_json() and show_tree:
        raise click.UsageError("--tree is for people and --json for machines: give one of them")
    if show_tree and recipe.placement != PAPERS:
        raise click.UsageError("--tree prints the tree of the paper's ID3 only: leave it out")
    if draw is not None and recipe.placement != PAPERS:
        raise click.UsageError("--draw draws the tree of the paper's ID3 only: leave it out")
    for name in () if recipe.folds else ("by", "seed", *training):
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            raise click.UsageError(f"--{name.replace('_', '-')} is for an accuracy: add --folds, or leave it out.")


def _print(placement: "Placement") -> None:
    """Print the table of switches, their value, and remarks on how they were found."""
    tree, sensors = placement.tree, str(placement.sensors)
    if tree is None:
        rows = ((str(order), str(kept.number), kept.name) for order, kept in enumerate(placement.switches, 1))
        out().print(table(("order", "column", "name"), title="Placement", rows=rows))
        echo(f"{sensors}{', in addition to the joints' if placement.joints else ''}. {placement.how}")
    else:
        switches = table(("column", "name", "gain, bits", "cumulative share"), title="Placement")
        for kept in placement.switches:
            switches.add_row(str(kept.number), kept.name, f"{kept.gain_bits:.4f}", f"{kept.cumulative_share:.1%}")
        out().print(switches)
        pruned = f", pruned at S = {tree.min_samples}" if tree.min_samples else ""
        bits = f"{placement.gain_bits:.3f} of {placement.entropy_bits:.3f} bits of the grasp type"
        echo(
            f"{sensors}: {bits}; the tree has "
            f"{len(tree.nodes) - tree.n_leaves} decisions, {tree.n_leaves} leaves, depth {tree.depth}{pruned}"
        )
        if placement.entropy_bits == 0:
            echo("all rows are of one grasp type: there is nothing to distinguish")
        elif placement.rows < tree.min_samples:
            echo(f"no decision was made: the {placement.rows} rows are fewer than S = {tree.min_samples}")
        for remark in tree.remarks("switch"):
            echo(remark)
    if placement.kept_joints:
        echo(f"the kept joints, in addition: {', '.join(placement.kept_joints)}")
